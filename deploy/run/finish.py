"""End of a run in either mode: on a signal or a verdict, with summary, figures and exit code."""

from __future__ import annotations

import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.analysis import assertions
from lfa.deploy.analysis.summarize import summarize
from lfa.deploy.analysis.summary import Summary, read, write
from lfa.deploy.analysis.summary_table import text
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.recorder import Recording, parts
from lfa.deploy.recording.run_folder import JOURNALS, About
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.output import write_line
from lfa.protocol.runtime.state_hashes import HASHES


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
    if interrupts.signal is None:
        return None
    held = "" if interrupts.held_in is None else f" in {interrupts.held_in}, which did not return"
    return Verdict("interrupted", f"{interrupts.signal.name}{held}")


def reread(folder: Path, ended_by: signal.Signals | None) -> Ended:
    """Return a finished run whose summary the recorder process has written."""
    return Ended(folder, read(folder), ended_by)


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
    write(folder, summary)
    return Ended(folder, summary, ended_by)


@contextmanager
def kept_as(record: str, out: Path | None) -> Iterator[Path | None]:
    """Yield the run folder to write: `out`, or with `record` none a temporary one, which is removed at the end."""
    if record != "none":
        yield out
        return
    with tempfile.TemporaryDirectory(prefix="lfa-run-") as folder:
        yield Path(folder)


def report(
    ended: Ended,
    *,
    figures: bool,
    as_json: bool,
    junit: Path | None = None,
    verbose: bool = False,
    record: str = "full",
) -> int:
    """Draw figures, print the summary, write assertions as JUnit XML if requested; return the exit code.

    With `record` summary, remove what is larger than a summary. Raises Refused.
    """
    kept = None if record == "none" else ended.folder
    if record == "summary":
        _remove_recording(ended.folder)
    if figures:
        from lfa.deploy.view.figures.command import draw

        write_line("drawing the figures ...", sys.stderr)
        draw(ended.folder)
    if as_json:
        facts = {"folder": None if kept is None else str(kept), **msgspec.to_builtins(ended.summary)}
        print_visible(msgspec.json.format(msgspec.json.encode(facts), indent=1).decode())
    else:
        print_visible(text(ended.summary, kept, verbose=verbose))
    if junit is not None:
        assertions.junit(junit, ended.summary)
    return ended.exit_code


def _remove_recording(folder: Path) -> None:
    """Remove the messages, journals and state hashes of a run: its summary, events and scenario stay."""
    for part in parts(folder):
        part.unlink()
    (folder / HASHES).unlink(missing_ok=True)
    shutil.rmtree(folder / JOURNALS, ignore_errors=True)
