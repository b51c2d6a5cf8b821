"""One robot: team, lease, behaviour, limits, and what it says.

Imports `protocol` and the base install (msgspec, typer) only: an agent starts without numpy, pymunk or
rerun, and knows of the world nothing but what its own hardware topics say.
"""

import sys

if "typing_extensions" not in sys.modules:
    # msgspec takes typing_extensions when it finds it and else typing, which has all that it needs from Python 3.11 on.
    # Left out, it is 4 MB less of the 35 MB that an agent may have. Who wants it later finds it as ever.
    sys.modules["typing_extensions"] = None  # type: ignore[assignment]
    import msgspec  # noqa: F401

    del sys.modules["typing_extensions"]
