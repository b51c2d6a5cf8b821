"""How a run ends, in either mode: on a signal or a verdict, with a summary, figures and an exit code."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from deploy.look import assertions
from deploy.look import summary as summaries
from deploy.look.summary import Summary
from deploy.look.table import text
from deploy.run.folder import About
from deploy.run.record import Recording
from deploy.run.referee import Verdict


class Ended(Struct, frozen=True):
    """A run that is over; `signal` is what ended it, if anything did."""

    folder: Path
    summary: Summary
    signal: signal.Signals | None = None

    @property
    def exit_code(self) -> int:
        """128 + signal as shells count (130, 143), else what the summary says."""
        return self.summary.exit_code if self.signal is None else 128 + self.signal


def reread(folder: Path, ended_by: signal.Signals | None) -> Ended:
    """A run whose summary somebody else has written."""
    return Ended(folder, summaries.read(folder), ended_by)


def finish(
    folder: Path,
    about: About,
    verdict: Verdict,
    duration_s: float,
    faults_left: Sequence[str],
    ended_by: signal.Signals | None,
    recording: Recording | None = None,
) -> Ended:
    """Read the closed recording back and write `summary.json`."""
    summary = summaries.summarize(folder, about, verdict, duration_s, faults_left)
    summary.recording = recording
    summaries.write(folder, summary)
    return Ended(folder, summary, ended_by)


def report(ended: Ended, *, figures: bool, as_json: bool, junit: Path | None = None) -> int:
    """Draw, write the judgements as JUnit XML where wanted, print, and return the exit code. Raises Refused."""
    if figures:
        from deploy.look.plots import draw

        draw(ended.folder)
    if as_json:
        facts = {"folder": str(ended.folder), **msgspec.to_builtins(ended.summary)}
        print(msgspec.json.format(msgspec.json.encode(facts), indent=1).decode())
    else:
        print(text(ended.summary, ended.folder))
    if junit is not None:
        assertions.junit(junit, ended.summary)
    return ended.exit_code
