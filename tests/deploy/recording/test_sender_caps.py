"""One member's key fills neither the recorder's disk nor its memory, and the others are recorded as before."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.recording import mcap_reader
from lfa.deploy.recording.recorder import EVENTS, RECORDING, Recorder
from lfa.deploy.recording.sender_caps import BURST_S, BYTES_PER_S_MAX, CHANNELS_MAX, OTHERS, OWNERS_MAX, SenderCaps
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event

HEADER = Header("robot3", 7, 3, 12.5)


def test_events_at_130_megabytes_a_second_leave_a_recording_of_bounded_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As one key of robot 3 said them: 2000 a second, each of 64 KiB."""
    recorder = Recorder(tmp_path, {})
    flood = Event(HEADER, "role", None, {"role": "x" * 60_000})
    calm = Event(Header("robot1", 7, 3, 12.5), "role", None, {"role": "leader"})
    lasts_s = 3
    for n in range(2000 * lasts_s):
        recorder.record(n / 2000.0, "lfa/f/robot3/event", flood)
        if n % 100 == 0:
            recorder.record(n / 2000.0, "lfa/f/robot1/event", calm)
    recording = recorder.close()
    allowed = BYTES_PER_S_MAX * (BURST_S + lasts_s) + 2 * 65_536
    assert (tmp_path / EVENTS).stat().st_size + (tmp_path / RECORDING).stat().st_size < allowed
    owners = [owner for owner, *_ in mcap_reader.messages(tmp_path, frozenset({"event"}))]
    assert owners.count("robot1") == 20 * lasts_s
    assert recording.left_out == {"robot3": 2000 * lasts_s - owners.count("robot3")}
    assert capsys.readouterr().err.count("robot3 sends more than 1.0 MB/s") == 1
    assert recording.losses() == [
        f"not recorded: {recording.left_out['robot3']} messages of robot3, above the cap on one member"
    ]


def test_keys_that_a_member_invents_are_bounded(tmp_path: Path) -> None:
    """MCAP numbers its channels with 16 bits: one more would end the recorder."""
    recorder = Recorder(tmp_path, {})
    for n in range(70_000):
        recorder.record(0.001 * n, f"lfa/f/robot3/lease/x{n}", Event(HEADER, "role", None, {}))
    assert recorder.close().left_out == {"robot3": 70_000 - CHANNELS_MAX}


def test_members_that_nobody_knows_share_one_cap() -> None:
    caps = SenderCaps()
    admitted = [caps.admits(0.0, f"lfa/f/invented{n}/event") for n in range(2 * OWNERS_MAX + CHANNELS_MAX)]
    assert sum(one is not None for one in admitted) == OWNERS_MAX + CHANNELS_MAX
    assert set(caps.left_out) == {OTHERS}


def test_what_a_robot_usually_says_is_never_left_out() -> None:
    """A scan of 2000 beams at 10 Hz, and all topics at 50 Hz with some hundred bytes each."""
    caps = SenderCaps()
    for n in range(3000):
        for key, size in (("scan", 13_000 if n % 5 == 0 else 0), *((f"topic{k}", 400) for k in range(12))):
            allowance = caps.admits(0.02 * n, f"lfa/f/robot1/{key}")
            assert allowance is not None
            allowance.left -= size
    assert caps.left_out == {}
