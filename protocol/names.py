"""Names of robots on the wire: `robot3`, the witness, and how an id is read back."""

from __future__ import annotations

from functools import lru_cache

WITNESS_ID = 0


WITNESS_NAME = "witness"


DIGITS_MAX = 18


def robot_name(robot_id: int) -> str:
    """The name of an id in keys and messages: `robot2`, or `witness` for the voter without a robot."""
    return WITNESS_NAME if robot_id == WITNESS_ID else f"robot{robot_id}"


@lru_cache(maxsize=1024)  # asked for each message; bounded: strangers may call themselves anything
def robot_id_of(name: str) -> int | None:
    """The id behind a name, None when it names no robot and no witness."""
    if name == WITNESS_NAME:
        return WITNESS_ID
    digits = name.removeprefix("robot")
    return whole_number(digits) if name.startswith("robot") and not digits.startswith("0") else None


def whole_number(text: str) -> int | None:
    """What `text` says in digits, so few of them that messages and journals can hold it; None when it is no such."""
    return int(text) if len(text) <= DIGITS_MAX and text.isascii() and text.isdecimal() else None
