"""Readers for the images of ROS maps: pgm (P5, P2) and png, as shades from 0 to 255 with row 0 at the top."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import open_binary

CELLS_MAX = 64_000_000
BYTES_MAX = 5 * CELLS_MAX
"""Largest number of bytes read: a P2 cell is up to three digits and a blank; an endless device file is cut here."""
PATH_SHOWN_MAX = 200

Shades = npt.NDArray[np.uint8]


def shades_of(yaml: Path, image: str) -> tuple[Shades, npt.NDArray[np.bool_] | None]:
    """Return the shades from 0 to 255, row 0 the top, and the mask of opaque cells (None without transparency).

    `image` is the path written in `yaml`, relative to that file's folder. Raises Refused with one line.
    """
    path = yaml.parent / image
    try:
        with open_binary(path) as file:
            data = file.read(BYTES_MAX)
    except (OSError, ValueError) as error:  # a path with a null byte is a ValueError
        why = getattr(error, "strerror", None) or error
        given = image if len(image) <= PATH_SHOWN_MAX else f"{image[:PATH_SHOWN_MAX]}..."
        raise Refused(f"{yaml}: image = {given}: cannot be read ({why}): must be a pgm or png file") from None
    if data[:2] in (b"P2", b"P5"):
        return _pgm(path, data), None
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return _png(path)
    raise Refused(f"{path}: neither pgm (P2, P5) nor png: must be one of them")


def _pgm(path: Path, data: bytes) -> Shades:
    """Decode P5 (bytes) or P2 (numbers), with comments; at most 255 shades. Raises Refused."""
    match = re.match(rb"(P[25])" + 3 * rb"(?:\s|#[^\n]*\n)+(\d{1,9})" + rb"(?:[ \t]*#[^\n]*)?\s", data)
    if match is None:
        raise Refused(f"{path}: no pgm header: must be P5 or P2, width, height and 255")
    columns, rows, top = int(match[2]), int(match[3]), int(match[4])
    _check_size(path, columns, rows)
    if not 1 <= top <= 255:
        bits = " (16-bit)" if 255 < top <= 65535 else ""
        raise Refused(f"{path}: largest shade {top}{bits}: must be an 8-bit pgm, at most 255")
    body = data[match.end() :]
    if match[1] == b"P5":
        body = body[: rows * columns] + body[rows * columns :].rstrip()  # some writers append a newline
        shades = np.frombuffer(body, dtype=np.uint8)
    else:
        words = re.sub(rb"#[^\n]*", b"", body).split()
        if not all(word.isdigit() and len(word) < 4 and int(word) <= top for word in words):
            raise Refused(f"{path}: a shade that is no number from 0 to {top}: the file is corrupt")
        shades = np.array([int(word) for word in words], dtype=np.uint8)
    if shades.size != rows * columns:
        right = f"{columns} x {rows} = {columns * rows} by its header"
        raise Refused(f"{path}: {shades.size} cells: must be {right}; the file is cut off or of another size")
    if shades.size and int(shades.max()) > top:
        raise Refused(f"{path}: a shade of {int(shades.max())} above its largest {top}: the file is corrupt")
    scaled = shades if top == 255 else np.rint(shades * (255.0 / top)).astype(np.uint8)
    return scaled.reshape(rows, columns)


def _png(path: Path) -> tuple[Shades, npt.NDArray[np.bool_] | None]:
    """Decode a png: the shade is the mean of the colours, transparent cells are unknown. Raises Refused."""
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image = Image.open(path)
        with image:
            _check_size(path, *image.size)
            image.verify()  # checks every chunk's CRC, which decoding the pixels does not
        with Image.open(path) as image:
            if image.mode.startswith(("I", "F")):
                raise Refused(f"{path}: png of mode {image.mode} (16-bit): must be 8-bit")
            pixels = np.asarray(image.convert("RGBA"))
    except Refused:
        raise
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise Refused(f"{path}: far too many cells: must be from 1 to {CELLS_MAX} in all") from None
    except (OSError, UnidentifiedImageError, SyntaxError, ValueError) as error:
        raise Refused(f"{path}: no png that can be read ({error})") from None
    opaque = pixels[:, :, 3] == 255
    shades = np.rint(pixels[:, :, :3].mean(axis=2)).astype(np.uint8)
    return shades, None if opaque.all() else opaque


def _check_size(path: Path, columns: int, rows: int) -> None:
    if columns < 1 or rows < 1 or columns * rows > CELLS_MAX:
        raise Refused(f"{path}: {columns} x {rows} cells: must be from 1 to {CELLS_MAX} in all")
