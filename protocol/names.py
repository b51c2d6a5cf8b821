"""Names of robots and of the witness in keys and messages, and the parsing of ids from them."""

from __future__ import annotations

from functools import lru_cache

WITNESS_ID = 0
WITNESS_NAME = "witness"
DIGITS_MAX = 18


def robot_name(robot_id: int) -> str:
    """Return the name of an id in keys and messages: `robot2`, or `witness` for the voter without a robot."""
    return WITNESS_NAME if robot_id == WITNESS_ID else f"robot{robot_id}"


@lru_cache(maxsize=1024)  # called for each message; bounded: foreign senders may use any name
def robot_id_of(name: str) -> int | None:
    """Return the id of a name; None when it names neither a robot nor the witness."""
    if name == WITNESS_NAME:
        return WITNESS_ID
    digits = name.removeprefix("robot")
    return whole_number(digits) if name.startswith("robot") and not digits.startswith("0") else None


def whole_number(text: str) -> int | None:
    """Return the number in `text`, of at most DIGITS_MAX digits so that messages and journals hold it; else None."""
    return int(text) if len(text) <= DIGITS_MAX and text.isascii() and text.isdecimal() else None
