"""A session as text: the link that is the run (scenario, seed, overrides, faults), and the scenario that repeats it."""

from __future__ import annotations

from urllib.parse import parse_qsl, urlencode, urlsplit

from msgspec import Struct
from msgspec.structs import replace

from lfa.deploy.recording.run_folder import toml
from lfa.protocol.config_file.conversion import NUMBER_MAX
from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number
from lfa.world.description.load import Scenario

LINK_CHARACTERS_MAX = 20_000
FAULTS_MAX = 500
"""Largest number of faults in a session."""


class Setting(Struct, frozen=True):
    """What determines a run in virtual time: the scenario and its seed, what is set otherwise, and what was done."""

    scenario: str
    seed: int | None = None
    robots: int | None = None
    overrides: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    """Faults besides those of the scenario, as sentences with times."""


def fragment_of(setting: Setting) -> str:
    """Return the part of the page's address after `#` that stands for the run."""
    pairs = [("run", setting.scenario)]
    pairs += [("seed", str(setting.seed))] if setting.seed is not None else []
    pairs += [("robots", str(setting.robots))] if setting.robots is not None else []
    return urlencode([*pairs, *(("set", o) for o in setting.overrides), *(("fault", f) for f in setting.faults)])


def setting_of(link: str) -> Setting:
    """Return the run that a link, or its part after `#`, stands for. Raises Refused."""
    text = urlsplit(link).fragment or link.lstrip("#")
    wrong = "must be like #run=leader_killed&seed=7&fault=kill+2+at+9+s"
    if len(text) > LINK_CHARACTERS_MAX:
        raise Refused(f"link of {len(text)} characters: must have at most {LINK_CHARACTERS_MAX}")
    try:
        pairs = parse_qsl(text, strict_parsing=True, max_num_fields=FAULTS_MAX)
    except ValueError:
        raise Refused(f"link #{text[:60]}: {wrong}") from None
    if any(_names_a_file(value) for key, value in pairs if key == "set"):
        raise Refused("link with a map: a link names no files, give it to lfa web as --set")
    given = {name: [value for key, value in pairs if key == name] for name, _ in pairs}
    unknown = set(given) - {"run", "seed", "robots", "set", "fault"}
    if unknown or len(given.get("run", [])) != 1:
        raise Refused(f"link #{text[:60]}: {wrong}")
    return Setting(
        given["run"][0],
        _number(given, "seed"),
        _number(given, "robots"),
        tuple(given.get("set", ())),
        tuple(given.get("fault", ())),
    )


def saved(drawn: Scenario, seed: int, faults: tuple[str, ...]) -> str:
    """Return the drawn scenario as TOML with the session's faults and seed: `lfa sim` runs it to the same events.

    Raises Refused.
    """
    if abs(seed) > NUMBER_MAX:
        raise Refused(f"seed {seed}: a scenario file holds seeds up to {NUMBER_MAX:g}: share the session as a link")
    return toml(replace(drawn, seed=seed, saved_from=drawn.name, faults=(*drawn.faults, *faults)))


def _names_a_file(override: str) -> bool:
    key = override.partition("=")[0].strip()
    return key in ("map", "keepout", "world", "world.map", "world.keepout")


def _number(given: dict[str, list[str]], name: str) -> int | None:
    if name not in given:
        return None
    text = given[name][-1]
    number = whole_number(text.removeprefix("-"))
    if number is None:
        raise Refused(f"link with {name}={text[:20]}: must be a whole number")
    return -number if text.startswith("-") else number
