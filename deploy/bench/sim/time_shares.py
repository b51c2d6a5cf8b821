"""Where the processor time of a simulated run goes: the share of each folder of the code."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from cProfile import Profile
from pathlib import Path
from time import process_time
from types import CodeType

ROOT = f"{Path(__file__).parents[3]}/"
"""Folder of the package, with the rooms in it."""


def profiled(act: Callable[[], object]) -> dict[str, float]:
    """Do `act`; return the share of its processor time [%] that each folder of the package spent, the largest first.

    What the package calls outside of itself, such as the codec, counts for the folder that calls it.
    """
    profile = Profile(process_time)  # not the wall's: beside other work that is time of others
    profile.runcall(act)
    spent: defaultdict[str, float] = defaultdict(float)
    for entry in profile.getstats():
        folder = _folder(entry.code)
        if folder is None:
            continue
        spent[folder] += entry.inlinetime
        spent[folder] += sum(call.totaltime for call in entry.calls or () if _folder(call.code) is None)
    total = sum(spent.values())
    return {folder: 100.0 * spent[folder] / total for folder in sorted(spent, key=spent.__getitem__, reverse=True)}


def _folder(code: CodeType | str) -> str | None:
    """Return the folder of a function, as `agents/perception`, two levels deep; None outside of the package."""
    if isinstance(code, str) or not code.co_filename.startswith(ROOT):
        return None
    return "/".join(code.co_filename.removeprefix(ROOT).split("/")[:-1][:2])
