"""An exception of a user's own code as one line, with its file and line number."""

from __future__ import annotations

from pathlib import Path


def told(error: Exception) -> str:
    """Return an exception in one line, with file and line where it was raised."""
    import traceback

    frames = traceback.extract_tb(error.__traceback__)
    where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}: " if frames else ""
    if isinstance(error, SyntaxError):
        where = f"{Path(error.filename or '').name}:{error.lineno}: "
        return f"{where}{type(error).__name__}: {error.msg}"
    return f"{where}{type(error).__name__}: {' '.join(str(error).split())}"
