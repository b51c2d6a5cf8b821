"""Order in which a program of `lfa` looks for modules: what is installed, then the folders of PYTHONPATH.

Plug-ins in such a folder are found; a `random.py` beside them stands in for nothing that `lfa` imports. Python by
itself looks there first. Each program imports this module before any other; a script of a user's own does not.
"""

import os
import sys


def reorder(path: list[str], named: str, home: str, standard: str) -> list[str]:
    """Move the folders in `path` that `named` (PYTHONPATH) names to its end; return them.

    `home`, from which `lfa` itself is imported, and `standard`, Python's own library, keep their places.
    """
    kept = {home, standard}
    folders = {os.path.abspath(folder) for folder in named.split(os.pathsep) if folder} - kept
    behind = [folder for folder in path if os.path.abspath(folder) in folders]
    path[:] = [folder for folder in path if folder not in behind] + behind
    return behind


def stand_ins(behind: list[str]) -> list[str]:
    """Return the files in the folders `behind` that Python imported in place of modules of its own, before `lfa`."""
    folders = {os.path.abspath(folder) for folder in behind}
    files = (getattr(sys.modules.get(name), "__file__", None) for name in sys.stdlib_module_names)
    return sorted(file for file in files if file and os.path.dirname(os.path.abspath(file)) in folders)


def _installed_first() -> None:
    if not sys.flags.ignore_environment:
        here = os.path.dirname(os.path.abspath(__file__))
        home = os.path.dirname(os.path.dirname(os.path.dirname(here)))
        found = stand_ins(reorder(sys.path, os.environ.get("PYTHONPATH", ""), home, os.path.dirname(os.__file__)))
        if found:
            right = "must have another name, or its folder leave PYTHONPATH"
            print(f"lfa: {found[0]}: hides a module of Python's own: {right}", file=sys.stderr)
            sys.exit(2)


_installed_first()
