"""A package of a user's own, as pip leaves it in a folder of the path: modules, and metadata with its entry points."""

from __future__ import annotations

from pathlib import Path


def install(folder: Path, module: str, code: str, entry_points: dict[str, str]) -> None:
    """Install `module` with `code` into `folder`; `entry_points`: `module:Class` by `group/name`."""
    (folder / f"{module}.py").write_text(code)
    metadata = folder / f"{module}-0.1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 0.1\n")
    lines: list[str] = []
    for name, place in entry_points.items():
        group, _, short = name.rpartition("/")
        lines += [f"[{group}]", f"{short} = {place}"]
    (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")
