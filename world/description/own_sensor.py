"""Sensors of a user's own: plug-ins that measure the simulated world from its true state, once for each robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from random import Random
from typing import Any, Protocol

from msgspec import Struct

from lfa.protocol.config_file.mistake import Mistake, RefusedValue, Rule, wrong
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.robot import SENSOR_NAME_MAX
from lfa.protocol.plug_in import PlugIns
from lfa.world.description.scenario import Obstacle, Scenario

SENSORS = PlugIns("sensor", "lfa.sensors", "--sensor ", by_class=True)


class TrueState(Struct, frozen=True):
    """True state of the world around one robot, in `map`: [m], [rad], [m/s], [rad/s]."""

    robot: int
    time_s: float
    """Time [s] since the world began."""
    pose: Pose2D
    twist: Twist
    odometer_m: float
    """Way [m] that its wheels have measured."""
    robots: dict[int, Pose2D]
    """Poses of all robots by their ids, its own too."""
    obstacles: tuple[Obstacle, ...]
    """Obstacles, each with its centre where it is now."""


class OwnSensor(Protocol):
    """Sensor of one robot. Its class is called with the drawn scenario, with its own random generator, and with its
    `Parameters`, where it has some.
    """

    def measure(self, state: TrueState) -> Mapping[str, float] | None:
        """Return the measured values by their names, as finite numbers; None for a measurement that drops out."""


def add_sensor(name: str, make: Any) -> None:
    """Make the class `make` the sensor called `name` in this process: for a script or a notebook that simulates."""
    SENSORS.add(name, make)


def make_sensor(name: str, scenario: Scenario, chance: Random) -> OwnSensor:
    """Return the sensor `name` of one robot. Raises RefusedValue for one that cannot be made."""
    key = f"world.sensors.{name}"
    made: OwnSensor = SENSORS.make(name, scenario.world.sensors[name].parameters, key, scenario, chance)
    if not callable(getattr(made, "measure", None)):
        raise RefusedValue(Mistake(key, ": must be a class with the method measure"))
    return made


def _sensors(scenario: Scenario) -> Iterator[Mistake]:
    for name, chosen in scenario.world.sensors.items():
        if len(name) > SENSOR_NAME_MAX:
            yield Mistake(f"world.sensors.{name}", f": must have a name of at most {SENSOR_NAME_MAX} characters")
        if not 0.0 < chosen.rate_hz <= scenario.world.physics_hz:
            right = f"above 0 and at most world.physics_hz = {scenario.world.physics_hz:g}"
            yield wrong(f"world.sensors.{name}.rate_hz", chosen.rate_hz, right, "world.physics_hz")


def _installed(scenario: Scenario) -> Iterator[Mistake]:
    for name in scenario.world.sensors:
        try:
            make_sensor(name, scenario, Random(0))
        except RefusedValue as refused:
            yield refused.mistake


SENSOR_RULE: Rule[Scenario] = Rule(_sensors, ("world.physics_hz",))
INSTALLED_RULE: Rule[Scenario] = Rule(_installed)
"""Rule for a scenario that is to be simulated here; who only reads a run does not need its sensors."""
