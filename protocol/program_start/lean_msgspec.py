"""Import of msgspec without `typing_extensions`; a program of an agent imports this before anything of `lfa`."""

import sys

if "typing_extensions" not in sys.modules:
    # msgspec imports typing_extensions if that is installed, else typing, which has all it needs from Python 3.11 on.
    # Hiding it saves 2 MB of the 15 MB that an agent may have of its own. A later import finds it as usual.
    sys.modules["typing_extensions"] = None  # type: ignore[assignment]
    import msgspec  # noqa: F401

    del sys.modules["typing_extensions"]
