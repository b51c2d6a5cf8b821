"""The README's own controller is one: its code runs as it stands there, and brings a follower into its slot."""

import re
from math import cos, hypot, pi, sin
from pathlib import Path

from lfa.agents.config import DEFAULT
from lfa.agents.following.follower import Follower
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

README = Path(__file__).parents[3] / "README.md"
DT = 0.02


def test_the_readmes_controller_brings_a_follower_into_its_slot() -> None:
    code = re.search(r"```python\n# carrot\.py\n(.*?)```", README.read_text(), re.DOTALL)
    assert code is not None, "README.md has lost its controller"
    names: dict[str, object] = {}
    exec(code[1], names)
    controller = names["Carrot"](DEFAULT, Limits())  # type: ignore[operator]
    follower = Follower(DEFAULT, Limits(), controller)
    slot, ahead, twist = Slot(2, 1.2, 2.0 * pi / 3), Pose2D(), Twist(0.5, 0.1)
    own, own_twist, trace = Pose2D(-0.7, 0.9, 0.1), STILL, PoseHistory(4.0)
    for _ in range(1500):
        own_twist = follower.step(Sighting(1, 0, ahead, twist, 0.0, 0.0, 0.0, trace), slot, own, own_twist, DT)
        own, ahead = along_arc(own, own_twist, DT), along_arc(ahead, twist, DT)
    x = ahead.x + 1.2 * cos(ahead.theta + slot.phi)
    y = ahead.y + 1.2 * sin(ahead.theta + slot.phi)
    assert hypot(own.x - x, own.y - y) < 0.1
