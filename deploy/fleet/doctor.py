"""`lfa doctor`: check the machines of a fleet, or this one; print one line per check, with the required value."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec import Struct

from lfa.deploy.fleet import fleet_view
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.fleet.remote.ssh import PYTHON_MIN
from lfa.deploy.process.coroutines import run_to_end
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.topics import HOST_PREFIX
from lfa.protocol.transport.zenoh_config import answers, default_endpoint

EXTRAS = {
    "world": ("numpy", "PIL", "pymunk", "yaml"), "view": ("mcap", "matplotlib", "rerun"),
    "deploy": ("asyncssh", "cryptography", "rich"), "ros": ("rosbags", "xxhash"), "foxglove": ("foxglove",),
    "web": ("websockets",), "campaign": ("pyarrow",), "slurm": ("submitit",), "dask": ("distributed",),
    "learn": ("gymnasium", "pettingzoo"),
    "onnx": ("onnxruntime",),
}  # fmt: skip
PURPOSES = {
    "world": "simulated worlds", "view": "recordings, figures and views", "deploy": "lfa up over ssh, watch and top",
    "ros": "ROS 2", "foxglove": "Foxglove", "web": "the page of lfa web", "campaign": "Parquet files of campaigns",
    "slurm": "campaigns on Slurm", "dask": "campaigns on Dask", "learn": "environments for learners",
    "onnx": "learned controllers",
}  # fmt: skip
"""What each extra is installed for."""


class Diagnosis(Struct, frozen=True):
    """Result of one check on one host."""

    host: str
    check: str
    ok: bool
    says: str


def command(
    file: Annotated[
        Path | None, typer.Argument(help="Fleet file, to check all its machines. Default: this machine.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> int:
    """Run `lfa doctor`; return 1 when a check fails."""
    found = this_machine() if file is None else _machines(file)
    if as_json:
        print_visible(msgspec.json.encode({"ok": all(one.ok for one in found), "findings": found}).decode())
    else:
        for one in found:
            print_visible(f"{'ok   ' if one.ok else 'WRONG'}  {one.host:<12} {one.check:<12} {one.says}")
    return 0 if all(one.ok for one in found) else 1


def _machines(file: Path) -> list[Diagnosis]:
    from lfa.deploy.fleet.host_checks import examine  # needs cryptography, which is not in the base install

    return run_to_end(examine(load(file)))


# --- this machine -----------------------------------------------------------------------------------------------------


def this_machine() -> list[Diagnosis]:
    """Check Python, `lfa`, its extras, and the routers of the fleets that run on this machine."""
    is_ = ".".join(map(str, sys.version_info[:3]))
    found = [judged("here", "python", sys.version_info >= PYTHON_MIN, is_, "3.11 or newer")]
    try:
        found.append(Diagnosis("here", "lfa", True, version("lfa")))
    except PackageNotFoundError:
        found.append(Diagnosis("here", "lfa", False, "is not installed: in its checkout, python -m pip install -e ."))
    for extra, modules in EXTRAS.items():
        absent = [module for module in modules if find_spec(module) is None]
        says = "there" if not absent else f"not here, for {PURPOSES[extra]}: pip install 'lfa[{extra}]'"
        found.append(Diagnosis("here", f"[{extra}]", True, says))
    running = fleet_view.here()
    for part in running:
        found += _own_part(part)
    if not running:
        there = answers(default_endpoint())
        says = f"{default_endpoint()} answers" if there else "no router: none is needed for run, sim, up"
        found.append(Diagnosis("here", "router", True, says))
    return found


def _own_part(part: HostPlan) -> list[Diagnosis]:
    """Check the router of this machine, and those of the other machines as reachable from here."""
    try:
        known = part.known_as(f"{HOST_PREFIX}{part.host}")
    except Refused as refused:
        return [Diagnosis(part.host, "certificate", False, str(refused))]
    found = [router_diagnosis(part.host, answers(part.socket, known))]
    far = [end for end in part.others if not answers(end, known)]
    says = "all answer" if not far else f"{', '.join(far)} do not answer: must be up, and their ports open"
    return [*found, Diagnosis(part.host, "other hosts", not far, says)] if part.others else found


def router_diagnosis(host: str, there: bool) -> Diagnosis:
    """Return the result of the check that a host's router answers."""
    return Diagnosis(host, "router", there, "answers" if there else f"does not answer: see lfa logs {host}/router")


def judged(host: str, check: str, ok: bool, says: str, right: str) -> Diagnosis:
    """Return the result of a check: what was found, and if that is not ok, what it must be."""
    return Diagnosis(host, check, ok, says if ok else f"{says}: must be {right}")
