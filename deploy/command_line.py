"""Common frame of all `lfa` scripts: parse the command line, run, map errors to one line and an exit code."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from lfa.deploy.terminal_text import print_visible
from lfa.protocol.output import write_line

if TYPE_CHECKING:
    import typer

    from lfa.protocol.errors import Refused

DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.EISDIR, errno.ENOTDIR)
"""errno values of a file system that refuses a write during a run: not an error of the program (exit code 1)."""
NAMES = (errno.ENAMETOOLONG, errno.ELOOP, errno.ENOENT)
"""errno values of a path that cannot exist, or in a folder that does not: bad input (exit code 2)."""


def run_cli(name: str, app: typer.Typer) -> int:
    """Run `app` on the command line and return the exit code. Used by all scripts of `deploy`."""
    import typer

    try:
        return _guarded(name, lambda: _called(name, app))
    except typer.Abort:
        return 130


def print_text(name: str, text: str) -> int:
    """Print `text` for the script `name`, without its parser; return the exit code."""

    def write() -> int:
        print_visible(text, flush=True)
        return 0

    return _guarded(name, write)


def _guarded(name: str, call: Callable[[], int]) -> int:
    """Return what `call` returns; what an output refuses is a line and an exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without a degree sign must not fail
    try:
        return call()
    except BrokenPipeError:  # the reader of the pipe has exited
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        if error.errno in NAMES and error.filename:
            return print_errors(name, f"{error.filename}: {error.strerror}: must be the path of a file or a folder")
        if error.errno not in DISK:
            raise
        where = f"{error.filename}: " if error.filename else ""
        print_errors(name, f"{where}{error.strerror}: must be a place that has room, and that this user may use")
        return 1


def _called(name: str, app: typer.Typer) -> int:
    """Run the command that is called, or print why its input is refused; return the exit code."""
    import typer

    from lfa.protocol.errors import Refused

    try:
        code = app(standalone_mode=False, prog_name=name)
        if sys.stdout is not None:
            sys.stdout.flush()  # here, where a full disk is a line and no traceback
    except Refused as refused:
        return print_refusal(name, refused)
    except typer.TyperException as error:  # from the parser: unknown option, text for a number
        return print_refusal(name, Refused(error.format_message()))
    return code if isinstance(code, int) else 0


def command_app(function: Callable[..., Any], help_text: str, example: str) -> typer.Typer:
    """Return the parser of a script with a single command."""
    import typer

    app = typer.Typer(**PLAIN)
    app.command(help=help_text, epilog=f"Example: {example}")(function)
    return app


def print_errors(name: str, *texts: str) -> int:
    """Print each text as one line on stderr and return exit code 2."""
    for text in texts:
        write_line(f"{name}: {' '.join(text.split())}", sys.stderr)
    return 2


def print_refusal(name: str, refused: Refused) -> int:
    """Print each mistake as one line on stderr, with `--json` all of them on stdout too, and return exit code 2."""
    if "--json" in sys.argv[1:]:
        import msgspec

        from lfa.protocol.config_file.mistake import RefusedFile

        errors = refused.errors if isinstance(refused, RefusedFile) else [{"text": line} for line in refused.lines]
        print_visible(msgspec.json.encode({"errors": errors}).decode())
    return print_errors(name, *refused.lines)


PLAIN: dict[str, Any] = {
    "add_completion": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}
"""Typer options of every `lfa` script: plain help text, `-h`, no decorated tracebacks."""
