"""Every format that lfa reads, under 500 seeded mutations: a value or one line, never another exception, in bounds."""

from __future__ import annotations

import os
import signal
import struct
import traceback
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random

import msgspec
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from lfa.agents.cli import read_mission
from lfa.agents.following.controller import CONTROLLERS
from lfa.deploy.analysis import summary as summaries
from lfa.deploy.bench import barn
from lfa.deploy.fleet.engine.engine import KnownProcess
from lfa.deploy.fleet.host.ledger import LEDGER, Ledger, end_orphans, ledger
from lfa.deploy.fleet.plan import fleet_file, host_plan
from lfa.deploy.fleet.security import authority, keys, registry
from lfa.deploy.lockstep import diff_command
from lfa.deploy.operate import go
from lfa.deploy.process.identity import Identity
from lfa.deploy.recording import event_log, mcap_reader
from lfa.deploy.recording.recorder import EVENTS, RECORDING, Recorder
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_given_json, read_json
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event
from lfa.protocol.runtime import journal
from lfa.protocol.runtime.state_hashes import HASHES
from lfa.protocol.transport.credentials import credentials
from lfa.world import checkpoint
from lfa.world.description import load, maps
from lfa.world.description.scenario import STATE

MUTATIONS = 500
BLOCKED_S = 20
FORMATS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object]]] = {}
"""By name: makes a good file in a folder and returns its path; reads the file at that path."""
Format = Callable[[Path], Path]

KINDS = ("leader_command", "fault", "chain", "role", "decision", "lease", "over", "died")
EVENTS_SAID = [
    Event(Header("world", 1, n, 1.0 * n), kind, Term(n + 1, 1, 1), {"robot": 1, "deed": "kill", "chain": [1, 2]})
    for n, kind in enumerate(KINDS)
]


def _mutated(data: bytes, chance: Random) -> bytes:
    """One to three changes: a byte, a cut, a piece twice, a number made huge, text that is not UTF-8."""
    changed = bytearray(data)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(max(1, len(changed)))
        kind = chance.randrange(6)
        if kind == 0 and changed:
            changed[at] = chance.randrange(256)
        elif kind == 1:
            del changed[at:]
        elif kind == 2:
            changed[at:at] = changed[at : at + chance.randint(1, 200)]
        elif kind == 3:
            changed[at : at + 1] = chance.choice((b"9" * 30, b"9" * 5000, b"-1", b"1e999", b"null", b"\0"))
        elif kind == 4:
            changed[at : at + 8] = b"\xff" * 8
        else:
            changed[at:at] = chance.choice((b"\xff", b"\xed\xa0\x80", b"[" * 3000, b'"', b"{", b"\n"))
    return bytes(changed)


def _format(name: str, read: Callable[[Path], object]) -> Callable[[Format], Format]:
    def register(make: Format) -> Format:
        FORMATS[name] = (make, read)
        return make

    return register


@_format("fleet file (TOML)", fleet_file.load)
def _fleet_file(folder: Path) -> Path:
    (folder / "fleet.toml").write_text('fleet = "f"\nscenario = "straight"\nteam = 2\nhosts.a.address = "localhost"\n')
    return folder / "fleet.toml"


@_format("scenario (TOML)", lambda path: load.load(str(path)))
def _scenario(folder: Path) -> Path:
    source = Path(load.__file__).parent.parent / "scenarios" / "straight.toml"
    (folder / "scenario.toml").write_bytes(source.read_bytes())
    return folder / "scenario.toml"


@_format("mission (JSON)", read_mission)
def _mission(folder: Path) -> Path:
    (folder / "mission.json").write_bytes(msgspec.json.encode(load.shipped()["straight"].mission))
    return folder / "mission.json"


@_format("ledger (JSON)", lambda path: (ledger(path.parent), end_orphans(path.parent)))
def _ledger(folder: Path) -> Path:
    dead = Identity(2**22 - 1, 1, 1, ("gone",))
    known = KnownProcess("robot1", dead, 1, 0)
    (folder / LEDGER).write_bytes(msgspec.json.encode(Ledger("run", "digest", dead, (known,))))
    return folder / LEDGER


@_format("plan of a machine (JSON)", host_plan.read)
def _plan(folder: Path) -> Path:
    plan = fleet_file.load(_fleet_file(folder))
    (folder / host_plan.PART).write_bytes(msgspec.json.encode(host_plan.parts(plan, "run", "digest")["a"]))
    return folder / host_plan.PART


@_format("state of a world (JSON)", checkpoint.read)
def _state(folder: Path) -> Path:
    (folder / STATE).write_bytes(b'{"step":7,"robots":[],"things":{"0":[1.0,2.0,0.5]}}')
    return folder / STATE


@_format("summary (JSON)", lambda path: summaries.read(path.parent))
def _summary(folder: Path) -> Path:
    (folder / summaries.SUMMARY).write_bytes(b'{"scenario":"straight","robots":[],"outcome":"goal_reached"}')
    return folder / summaries.SUMMARY


def _read_events(path: Path) -> object:
    lines = event_log.lines(path.parent)
    leader_terms = event_log.leader_terms(lines)
    event_log.places(lines, (1, 2), 5.0)
    return event_log.failovers(lines, leader_terms), event_log.last_chain(lines), event_log.terms_that_went_back(lines)


def _recorded(folder: Path) -> Recorder:
    recorder = Recorder(folder, {"seed": "1"})
    for n, event in enumerate(EVENTS_SAID * 3):
        recorder.record(0.5 * n, "lfa/f/world/event", event)
        truth = Truth(Header("world", 1, n, 0.5 * n), 0.5 * n, (TrueRobot(1, 1.0, 0.0, 0.0, 1.0, 0.0),))
        recorder.record(0.5 * n, "lfa/f/sim/truth", truth)
    recorder.close()
    return recorder


@_format("event log (JSONL)", _read_events)
def _events(folder: Path) -> Path:
    _recorded(folder)
    return folder / EVENTS


@_format("recording (MCAP)", lambda path: (mcap_reader.read(path.parent), mcap_reader.look_into(path.parent)))
def _recording(folder: Path) -> Path:
    _recorded(folder)
    return folder / RECORDING


def _read_journal(path: Path) -> object:
    try:
        heading, entries = journal.read(path)
    except ValueError:  # "not a journal", which the callers catch
        return None
    return heading, list(entries)


@_format("journal (msgpack)", _read_journal)
def _journal(folder: Path) -> Path:
    heading = journal.Heading(journal.JOURNAL_VERSION, "robot2", 17, 3, {"fleet": "f", "mission": {"robots": [1, 2]}})
    written = journal.Journal(folder, heading)
    for n in range(20):
        written.add("message", float(n), "lfa/f/robot1/pose", bytes([n]) * n, [])
    written.close()
    return folder / "robot2-17.bin"


@_format("map (YAML)", maps.read)
def _map(folder: Path) -> Path:
    (folder / "map.pgm").write_bytes(b"P5\n# a comment\n8 4\n255\n" + bytes(range(0, 256, 8)))
    (folder / "map.yaml").write_text(
        "image: map.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.1]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    return folder / "map.yaml"


@_format("image of a map (PGM)", lambda path: maps.read(path.with_suffix(".yaml")))
def _image(folder: Path) -> Path:
    return _map(folder).with_suffix(".pgm")


@_format("image of a map (PGM, plain)", lambda path: maps.read(path.with_suffix(".yaml")))
def _plain_image(folder: Path) -> Path:
    image = _map(folder).with_suffix(".pgm")
    image.write_text("P2\n8 4\n255\n" + " ".join(map(str, range(0, 256, 8))))
    return image


def _keys(folder: Path) -> Path:
    keys.make(folder / "keys", keys.spread("f", {"a": ("localhost",)}, (1,)))
    return folder / "keys"


def _read_certificate(path: Path) -> object:
    at = path.parent
    ca = authority.load(at.parent / "ca.pem", at.parent / "ca.key")
    return credentials(at, "robot1", 10**12), authority.fits(at / "robot1", ca.certificate, "robot1", ())


@_format("certificate (PEM)", _read_certificate)
def _certificate(folder: Path) -> Path:
    return _keys(folder) / "issued/robot1.pem"


@_format("key (PEM)", _read_certificate)
def _key(folder: Path) -> Path:
    return _keys(folder) / "issued/robot1.key"


@_format("password", _read_certificate)
def _password(folder: Path) -> Path:
    return _keys(folder) / "issued/robot1.password"


@_format("authority (PEM)", lambda path: authority.load(path, path.with_suffix(".key")))
def _authority(folder: Path) -> Path:
    return _keys(folder) / "ca.pem"


@_format("registry of keys (JSON)", lambda path: keys.show(path.parent, 0))
def _registry(folder: Path) -> Path:
    return _keys(folder) / registry.REGISTRY


@_format("route of lfa go (text)", go.points_in)
def _route(folder: Path) -> Path:
    path = folder / "route.txt"
    path.write_text("0 1.5  # the door\n-2, 3\n", encoding="utf-8")
    return path


@_format("BARN worlds (JSON)", barn.read)
def _barn(folder: Path) -> Path:
    path = folder / "worlds.json"
    path.write_text(
        '{"start": [0, 0, 0], "goal": [1, 1], "goal_tolerance_m": 1, "time_limit_s": 9, "obstacle_radius_m": 1, '
        '"worlds": []}',
        encoding="utf-8",
    )
    return path


@_format("state hashes (text)", lambda path: diff_command.compare(path.parent, path.parent))
def _hashes(folder: Path) -> Path:
    path = folder / HASHES
    path.write_text("tick time_s robot1 world\n0 0.0 ab/cd ef/01\n1 0.02 ab/ce ef/02\n", encoding="ascii")
    return path


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_is_a_value_or_one_line(name: str, tmp_path: Path) -> None:
    make, read = FORMATS[name]
    path = make(tmp_path)
    good = path.read_bytes()
    mode = path.stat().st_mode
    for seed in range(MUTATIONS):
        path.unlink()
        path.write_bytes(_mutated(good, Random(seed)))
        path.chmod(mode)
        said = _outcome(read, path)
        assert "\n" not in said, f"{name}, seed {seed}: {said}"


def _pipe(path: Path) -> None:
    os.mkfifo(path, 0o600)


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


@pytest.mark.parametrize("put", [_pipe, Path.mkdir, _loop, lambda path: path.symlink_to("missing")])
@pytest.mark.parametrize("name", FORMATS)
def test_what_is_no_file_in_a_files_place_is_a_value_or_one_line(
    name: str, put: Callable[[Path], None], tmp_path: Path
) -> None:
    """A named pipe, a folder, links in a circle or to nothing: none blocks, which the alarm would end."""
    make, read = FORMATS[name]
    path = make(tmp_path)
    path.unlink()
    put(path)
    said = _outcome_in_time(read, path)
    assert "\n" not in said, said


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_of_5_gb_is_a_value_or_one_line(name: str, tmp_path: Path) -> None:
    make, read = FORMATS[name]
    path = make(tmp_path)
    os.truncate(path, 5 << 30)
    said = _outcome_in_time(read, path)
    assert "\n" not in said, said


def test_own_code_of_5_gb_is_refused(tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.touch()
    os.truncate(own, 5 << 30)
    with pytest.raises(Refused, match="longer than"):
        CONTROLLERS.add_file(f"{own}:Controller")


def _outcome_in_time(read: Callable[[Path], object], path: Path) -> str:
    """Return `_outcome`; raise KeyboardInterrupt where a file holds its reader up."""
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.alarm(BLOCKED_S)
    try:
        return _outcome(read, path)
    finally:
        signal.alarm(0)


def _outcome(read: Callable[[Path], object], path: Path) -> str:
    """The line of a refusal, nothing for a value, and several lines for any other exception."""
    try:
        read(path)
    except (Refused, FileNotFoundError) as refused:
        return str(refused)
    except Exception:  # noqa: BLE001 (each is a failure of the test, which names its seed)
        return traceback.format_exc()
    return ""


def _bomb(folder: Path, chunks: int, size: int) -> Path:
    """A recording of `chunks` chunks that expand to `size` bytes each, from almost nothing."""
    message = struct.pack("<BQ", Opcode.MESSAGE, size - 9) + bytes(size - 9)
    data = zstandard.compress(message)
    body = struct.pack("<QQQII", 0, 0, size, zlib.crc32(message), 4) + b"zstd" + struct.pack("<Q", len(data)) + data
    chunk = struct.pack("<BQ", Opcode.CHUNK, len(body)) + body
    (folder / RECORDING).write_bytes(MCAP0_MAGIC + chunks * chunk)
    return folder


@pytest.mark.parametrize(("chunks", "size"), [(1, 256 << 20), (64, 24 << 20)])
def test_a_small_recording_does_not_fill_the_memory(
    chunks: int, size: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert mcap_reader.read(_bomb(tmp_path, chunks, size)).truth == {}
    assert "damaged" in capsys.readouterr().err


def test_a_pipe_or_a_device_in_a_files_place_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for path in (tmp_path / "fifo", Path("/dev/zero")):
        with pytest.raises(DamagedFile, match="no regular file"):
            read_json(path, dict)


def test_a_file_that_a_person_has_named_is_refused_with_its_option_the_reason_and_what_would_be_right(
    tmp_path: Path,
) -> None:
    path = tmp_path / "given.json"
    with pytest.raises(Refused) as missing:
        read_given_json(path, list, "must be a list", option="--list")
    assert str(missing.value) == f"--list {path}: No such file or directory: must be a list"
    path.write_text("{}")
    with pytest.raises(Refused) as wrong:
        read_given_json(path, list, "must be a list")
    assert str(wrong.value) == f"{path}: Expected `array`, got `object`: must be a list"


@pytest.mark.parametrize(
    ("fleet", "hosts"),
    [("f", {"ü": ("10.0.0.1",)}), ("f" * 60, {"a": ()}), ("f", {"a": ("ü.lan",)}), ("f", {"a" * 60: ()})],
)
def test_a_name_that_no_certificate_can_have_leaves_no_folder(
    fleet: str, hosts: dict[str, tuple[str, ...]], tmp_path: Path
) -> None:
    with pytest.raises(Refused, match=r"certificate|address"):
        keys.make(tmp_path / "keys", keys.spread(fleet, hosts, (1, 2)))
    assert list(tmp_path.iterdir()) == []
