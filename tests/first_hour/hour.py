"""The first hour as a table: what a new user types, the exit code, and what must be said, in order, in one folder."""

from __future__ import annotations

from typing import NamedTuple

SHORT = "straight --robots 3 --set 'goal=[1.5,0]'"
CARROT = "straight --robots 2 --set 'goal=[1.0,0]' --controller carrot.py:Carrot"
RAISES = """from lfa.protocol.geometry import Twist

class Raises:
    def __init__(self, gains, limits): pass
    def reset(self, own_pose, own_twist): pass
    def step(self, reference, own_pose, own_twist, dt):
        return Twist(1.0 / 0.0, 0.0)

class Nan(Raises):
    def step(self, reference, own_pose, own_twist, dt):
        return Twist(float("nan"), 0.0)

class Arity(Raises):
    def step(self, reference): pass

class Ends(Raises):
    def __init__(self, gains, limits): raise SystemExit(0)
"""
BAD = """title = "Three mistakes"
time_limit_s = 10.0
[mission]
robots = [1, 2]
[mission.leading]
cruise_mp = 0.5
route_m = [[1.0, 0.0]]
[world.lidar]
beams = "many"
[radio]
loss = 2.0
"""


class Step(NamedTuple):
    """One command; `says` are texts of its output, stdout and stderr together."""

    command: str
    code: int
    says: tuple[str, ...]


ALONE = (
    Step("lfa", 0, ("Usage: lfa COMMAND",)),
    Step("lfa --help", 0, ("First run: lfa run",)),
    Step("lfa --version", 0, ("lfa 0.",)),
    Step("lfa doctor", 0, ("ok     here", "router")),
    Step("lfa list", 0, ("straight", "paper_path1")),
    Step("lfa list --json", 0, ('"name":"straight"',)),
    Step("lfa schema --markdown", 0, ("`mission.following.parameters.headway_s`",)),
    Step("lfa sim --help", 0, ("--controller", "--record", "--verbose")),
    Step("lfa validate straight", 0, ("straight: ok",)),
    Step("lfa validate bad.toml", 2, ("bad.toml:6:", "bad.toml:9:", "bad.toml:11:", "did you mean 'cruise_mps'?")),
    Step("lfa validate bad.toml --json", 2, ('{"errors":[',)),
    Step("lfa validate nowhere.toml", 2, ("nowhere.toml",)),
    Step(f"lfa sim {SHORT} --out 'my run'", 0, ("goal_reached", "(term 1, start)", "report 'my run'", "mm")),
    Step(f"lfa sim {SHORT} --record none -v", 0, ("goal_reached", "(term 2, start)")),
    Step(f"lfa sim {SHORT} --record summary --out small", 0, ("run folder: small, without a recording",)),
    Step(f"lfa sim {SHORT} --record none --out small", 2, ("must be one of the two",)),
    Step(f"lfa sim {SHORT} --record none --json", 0, ('"outcome": "goal_reached"', '"command": "lfa sim ')),
    Step("lfa sim nowhere", 2, ("nowhere",)),
    Step("lfa sim straight --set mission.leading.cruise_mp=1", 2, ("did you mean 'cruise_mps'?",)),
    Step("lfa sim straight --fault 'kil leader at 1 s'", 2, ("lfa: ",)),
    Step(f"lfa sim {SHORT} --fault 'kill leader at 1 s' --out killed", 0, ("robot 2 led from", "kill of leader 1")),
    Step("lfa report 'my run'", 0, ("reading the recording", "my run/report.html")),
    Step("lfa report 'my run' killed --json", 0, ("report-vs-killed.html",)),
    Step("lfa report nothing", 2, ("nothing: no finished run",)),
    Step("lfa plot 'my run' --format svg --column", 0, ("my run/figures/fig07_distance_error.svg",)),
    Step("lfa plot nothing --json", 2, ('{"errors":[', "no run folder")),
    Step("lfa view nothing", 2, ("nothing: no run folder",)),
    Step("lfa verify 'my run' killed", 0, ("0 violations",)),
    Step("lfa why killed", 0, ()),
    Step("lfa replay 'my run' --robot 2", 0, ("calls return what they returned",)),
    Step("lfa replay 'my run' --robot 9", 2, ("must be all or one of",)),
    Step("lfa sim 'my run/scenario.toml' --record none", 0, ("goal_reached",)),
    Step(f"lfa sim {CARROT} --out carrot", 0, ("goal_reached",)),
    Step(f"lfa sim {CARROT} --set mission.following.parameters.ahead_m=0.8 --record none", 0, ("goal_reached",)),
    Step(f"lfa sim {CARROT} --set mission.following.parameters.ahead=1", 2, ("known are ahead_m",)),
    Step(f"lfa sim {CARROT} --set mission.following.parameters.ahead_m=far", 2, ("ahead_m = far: Expected `float`",)),
    Step("lfa replay carrot --robot 2", 2, ("add --controller carrot/carrot.py:Carrot",)),
    Step("lfa replay carrot --robot 2 --controller carrot/carrot.py:Carrot", 0, ("calls return what they returned",)),
    Step("lfa sim straight --controller bad.py:Raises --out bad", 1, ("bad.py:7: ZeroDivisionError", "failed (")),
    Step("lfa sim straight --controller bad.py:Nan --record none", 1, ("bad.py:10: step returned Twist(nan, 0.0)",)),
    Step("lfa sim straight --controller bad.py:Arity --out arity", 1, ("bad.py:14: TypeError", "run folder: arity")),
    Step("lfa sim straight --controller bad.py:Ends", 2, ("cannot be made: bad.py:17: SystemExit",)),
    Step("lfa verify bad --controller bad.py:Raises", 0, ("0 violations",)),
    Step("lfa sim straight --controller none.py:X", 2, ("no such file, must be FILE.py:Class",)),
    Step("lfa sim straight --controller swing", 2, ("must be one of headway, kanayama, law",)),
    Step("lfa watch --once --fleet none --connect unixsock-stream//tmp/none.sock", 2, ("no router answers at",)),
    Step("lfa fault kill leader --fleet none", 2, ("lfa: ",)),
    Step("lfa fuzz --seeds 10", 0, ("10 schedules", "0 failed")),
    Step("lfa bench nonsense", 2, ("must be one of",)),
    Step("lfa frobnicate", 2, ("lfa: ",)),
)  # fmt: skip
"""Commands that start no process of a fleet."""

TEAM = "--fleet {fleet} --connect {endpoint}"
BY_HAND = (
    Step("lfa watch --once --fleet {fleet}", 0, ("leader", "follower")),
    Step("lfa topic list --fleet {fleet}", 0, ("robot2",)),
    Step("lfa topic echo robot2/pose --count 1 --fleet {fleet}", 0, ("pose",)),
    Step("lfa fault cut 1-2 --fleet {fleet}", 0, ("cut 1-2 in fleet", "no radio between 1 and 2")),
    Step("lfa fault heal --fleet {fleet}", 0, ("all cuts and all loss are ended",)),
    Step("lfa formation column --fleet {fleet}", 0, ("column",)),
    Step("lfa fault restart 2 --fleet {fleet}", 2, ("runs already, or was started by hand",)),
    Step("lfa record --seconds 3 --out 'by hand' --fleet {fleet}", 0, ("straight, recorded, seed 5", "0 lost")),
    Step("lfa verify 'by hand'", 0, ("I2: 0 violations",)),
    Step("lfa report 'by hand'", 0, ("by hand/report.html",)),
    Step("lfa fault kill 3 --fleet {fleet} --json", 0, ('"deed":"kill"',)),
)
"""Commands on a fleet that was started by hand."""
