"""The frame of all `lfa` scripts: parse, run, turn refusals into one line and an exit code."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import typer

DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.EISDIR, errno.ENOTDIR)
"""What a disk refuses in the midst of work: no fault of the program."""


NAMES = (errno.ENAMETOOLONG, errno.ELOOP)
"""What nothing can be called, whoever asks for it."""


def run_cli(name: str, app: typer.Typer) -> int:
    """Run `app` on the command line; the exit code. Used by all scripts of `deploy`."""
    import typer

    from lfa.protocol.errors import Refused

    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no degree sign is no reason to stop
    try:
        code = app(standalone_mode=False, prog_name=name)
    except Refused as refused:
        return print_errors(name, *getattr(refused, "lines", (str(refused),)))
    except typer.TyperException as error:  # what the parser refuses: an unknown option, a word for a number
        return print_errors(name, error.format_message())
    except typer.Abort:
        return 130
    except BrokenPipeError:  # the reader of a pipe has gone: nobody is left to tell
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        if error.errno in NAMES:
            return print_errors(name, f"{error.filename}: {error.strerror}: must be the path of a file or a folder")
        if error.errno not in DISK:
            raise
        where = f"{error.filename}: " if error.filename else ""
        print_errors(name, f"{where}{error.strerror}: must be a place that has room, and that this user may use")
        return 1
    return code if isinstance(code, int) else 0


def command_app(function: Callable[..., Any], help_text: str, example: str) -> typer.Typer:
    """A script of one command."""
    import typer

    app = typer.Typer(**PLAIN)
    app.command(help=help_text, epilog=f"Example: {example}")(function)
    return app


def print_errors(name: str, *texts: str) -> int:
    for text in texts:
        print(f"{name}: {' '.join(text.split())}", file=sys.stderr)
    return 2


PLAIN: dict[str, Any] = {
    "add_completion": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}
