"""The own sensors of all simulated robots: each measures at its rate, and its faults become one line of text."""

from __future__ import annotations

from collections.abc import Mapping

from lfa.protocol.geometry import NUMBER_MAX
from lfa.protocol.messages.robot import SENSOR_NAME_MAX, SENSOR_VALUES_MAX
from lfa.protocol.plug_in import FAULTS, error_text, place_of
from lfa.world.description.own_sensor import OwnSensor, TrueState, make_sensor
from lfa.world.description.scenario import Scenario
from lfa.world.sensors.noise import chance_of


class OwnSensors:
    """Sensors that the drawn `scenario` chooses, one of each for each of `robots`. Raise RefusedValue as they do."""

    def __init__(self, scenario: Scenario, seed: int, robots: tuple[int, ...]) -> None:
        self.rates_hz = {name: chosen.rate_hz for name, chosen in scenario.world.sensors.items()}
        """Rate [Hz] of each sensor by its name."""
        self._sensors: dict[tuple[str, int], OwnSensor] = {
            (name, robot): make_sensor(name, scenario, chance_of(seed, robot, f"own/{name}"))
            for name in self.rates_hz
            for robot in robots
        }
        self._failed: set[str] = set()

    def measure(self, name: str, state: TrueState) -> dict[str, float] | str | None:
        """Return what the sensor `name` of the robot of `state` measures; None for nothing.

        Return a text, once, when it raises or answers anything but finite numbers by name: it is not called again.
        """
        if name in self._failed:
            return None
        measure = self._sensors[name, state.robot].measure
        try:
            answer = measure(state)
        except FAULTS as error:
            return self._fail(name, state, error_text(error, measure))
        if answer is None:
            return None
        if not isinstance(answer, Mapping):
            return self._fail(
                name,
                state,
                f"{place_of(measure)}measure returned a value of type {type(answer).__name__}, must be a dict",
            )
        if len(answer) > SENSOR_VALUES_MAX:
            return self._fail(
                name,
                state,
                f"{place_of(measure)}measure returned {len(answer)} values, at most {SENSOR_VALUES_MAX} fit",
            )
        for value_name, value in answer.items():
            if not isinstance(value_name, str) or len(value_name) > SENSOR_NAME_MAX:
                right = f"a text of at most {SENSOR_NAME_MAX} characters"
                return self._fail(
                    name, state, f"{place_of(measure)}measure returned the name {value_name!r}, must be {right}"
                )
            if not (isinstance(value, int | float) and abs(value) <= NUMBER_MAX):
                return self._fail(
                    name, state, f"{place_of(measure)}measure returned {value_name} = {value}, must be a finite number"
                )
        return {value_name: float(value) for value_name, value in answer.items()}

    def _fail(self, name: str, state: TrueState, says: str) -> str:
        self._failed.add(name)
        return f"sensor {name} of robot {state.robot}: {says}"
