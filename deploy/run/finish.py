"""End of a run in either mode: on a signal or a verdict, with summary, figures and exit code."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.analysis import assertions
from lfa.deploy.analysis import summary as summaries
from lfa.deploy.analysis.summarize import summarize
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.analysis.summary_table import text
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.recorder import Recording
from lfa.deploy.recording.run_folder import About


class Ended(Struct, frozen=True):
    """Finished run; `signal` is the signal that ended it, if any."""

    folder: Path
    summary: Summary
    signal: signal.Signals | None = None

    @property
    def exit_code(self) -> int:
        """Exit code: 128 + signal as in shells (130, 143), else that of the summary."""
        return self.summary.exit_code if self.signal is None else 128 + self.signal


def verdict_of(interrupts: Interrupts) -> Verdict | None:
    """Return the verdict `interrupted` once a signal has come, else None."""
    return None if interrupts.signal is None else Verdict("interrupted", interrupts.signal.name)


def reread(folder: Path, ended_by: signal.Signals | None) -> Ended:
    """Return a finished run whose summary the recorder process has written."""
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
    """Read the closed recording, write `summary.json`, and return the finished run."""
    summary = summarize(folder, about, verdict, duration_s, faults_left)
    summary.recording = recording
    summary.warnings = [] if recording is None else recording.losses()
    summaries.write(folder, summary)
    return Ended(folder, summary, ended_by)


def report(ended: Ended, *, figures: bool, as_json: bool, junit: Path | None = None) -> int:
    """Draw figures, print the summary, write assertions as JUnit XML if requested; return the exit code.

    Raises Refused.
    """
    if figures:
        from lfa.deploy.view.figures.command import draw

        draw(ended.folder)
    if as_json:
        facts = {"folder": str(ended.folder), **msgspec.to_builtins(ended.summary)}
        print(msgspec.json.format(msgspec.json.encode(facts), indent=1).decode())
    else:
        print(text(ended.summary, ended.folder))
    if junit is not None:
        assertions.junit(junit, ended.summary)
    return ended.exit_code
