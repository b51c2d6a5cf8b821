"""`lfa completion`: print a script for bash, zsh or fish that completes commands, options and scenarios.

The words are stored in the script when it is printed: completing starts no process. Print it again after an update.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer
from msgspec import Struct
from typer.models import OptionInfo

from lfa.deploy.cli import COMMANDS, Command
from lfa.deploy.terminal_text import print_visible
from lfa.world.description.load import titled


class Words(Struct, frozen=True):
    """Completions of one command: its options, and the choices of its argument."""

    command: str
    help: str
    options: tuple[str, ...]
    choices: tuple[str, ...]


def command(
    shell: Annotated[Literal["bash", "zsh", "fish"], typer.Argument(help="Shell that the script is for.")],
) -> int:
    print_visible({"bash": _bash, "zsh": _zsh, "fish": _fish}[shell](words()))
    return 0


def words() -> list[Words]:
    """Return the completions of every command, derived from the parameters of its function."""
    return [_words_of(entry, import_module(entry.module).command) for entry in COMMANDS]


def _words_of(entry: Command, function: Callable[..., Any]) -> Words:
    options, choices = ["--help"], []
    for name, hint in get_type_hints(function, include_extras=True).items():
        kind, *about = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        if not about:
            continue
        if isinstance(about[0], OptionInfo):
            plain = f"--{name.replace('_', '-')}"
            named = (about[0].default, *(about[0].param_decls or ()))  # Annotated: first name in `default`
            said = [word for word in named if isinstance(word, str)] or (
                (plain, f"--no-{plain[2:]}") if kind is bool else (plain,)
            )
            options += [word for word in said if word.startswith("--")]
        elif name == "scenario":
            choices += list(titled())
        elif get_origin(kind) is Literal:
            choices += list(get_args(kind))
    return Words(entry.name, entry.help, tuple(options), tuple(choices))


def _bash(table: list[Words]) -> str:
    cases = [f'    {row.command}) words="{" ".join((*row.options, *row.choices))}" ;;' for row in table]
    names = " ".join(row.command for row in table)
    return "\n".join([
        "_lfa() {",
        "  local words",
        '  case "${COMP_WORDS[1]}" in',
        *cases,
        "  esac",
        f'  [ "$COMP_CWORD" -eq 1 ] && words="{names} --help"',
        '  COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))',
        "}",
        "complete -o default -F _lfa lfa",
    ])  # fmt: skip


def _zsh(table: list[Words]) -> str:
    return "#compdef lfa\nautoload -U +X bashcompinit && bashcompinit\n" + _bash(table)


def _fish(table: list[Words]) -> str:
    lines = []
    for row in table:
        lines.append(f"complete -c lfa -n __fish_use_subcommand -f -a {row.command} -d {_quoted(row.help)}")
        inside = f"complete -c lfa -n '__fish_seen_subcommand_from {row.command}'"
        lines += [f"{inside} -l {option.removeprefix('--')}" for option in row.options]
        if row.choices:
            lines.append(f"{inside} -a {_quoted(' '.join(row.choices))}")
    return "\n".join(lines)


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
