"""Credentials of a process: its certificate, key and password, as files that `lfa keys` writes into one folder.

This module checks the files only and uses no cryptography library, to keep an agent small. Zenoh reads keys and
certificates itself; a secret is never stored in a value that could be printed.
"""

from __future__ import annotations

import binascii
import os
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_bytes, read_text

CA_FILE = "ca.pem"
ACCESS_FILE = "access.json"
USERS_FILE = "users"
FOREIGN_BITS, OTHERS_WRITE = 0o077, 0o022
CERTIFICATE_BYTES_MAX = 64 * 1024
PASSWORD_BYTES_MAX = 4096
_BEGIN, _END = b"-----BEGIN CERTIFICATE-----", b"-----END CERTIFICATE-----"
_UTC_TIME, _CONTEXT_0 = 0x17, 0xA0
_COMMON_NAME = bytes.fromhex("0603550403")
"""Object identifier 2.5.4.3, before the common name in a subject (X.520, 6.2.2)."""


Part = TypeVar("Part")


class Credentials(Struct, frozen=True):
    """Paths of the files that prove the identity `name`; secure routers also require `password_file`
    (`user:password`), None if there is none.
    """

    name: str
    ca: Path
    certificate: Path
    key: Path
    password_file: Path | None

    def user_and_password(self) -> tuple[str, str] | None:
        """Read and return user and password; they are read at each use, so that no value stores them."""
        if self.password_file is None:
            return None
        user, _, password = read_text(self.password_file, PASSWORD_BYTES_MAX).strip().partition(":")
        return user, password


def credentials(folder: Path, name: str, wall_ms: int) -> Credentials:
    """Return the credentials of `name` in `folder` (`ca.pem`, `<name>.pem`, `<name>.key`, optional `<name>.password`).

    Raises Refused if a file is missing, readable by others, of somebody else, or invalid at wall-clock time `wall_ms`
    [ms]. A machine's own `operator` and `recorder` are `operator-<machine>` and `recorder-<machine>`.
    """
    certificate, key, password = (folder / f"{name}.{kind}" for kind in ("pem", "key", "password"))
    for path in (folder / CA_FILE, certificate):
        check_valid(path, wall_ms)
    check_own(folder / CA_FILE)
    for path in (key, password) if password.exists() else (key,):
        check_private(path)
    found = Credentials(name, folder / CA_FILE, certificate, key, password if password.exists() else None)
    try:
        user = found.user_and_password()
    except (OSError, DamagedFile) as error:
        raise Refused(f"{password}: {error}, must be a file that `lfa keys` made") from None
    for path, owner in ((certificate, holder(certificate)), (password, name if user is None else user[0])):
        if owner != name and not owner.startswith(f"{name}-"):
            raise Refused(f"{path}: is that of {owner or 'nobody'}, must be that of {name}")
    return found


def check_private(path: Path) -> None:
    """Raise Refused if the file at `path` is missing, of another user, or if others may access it."""
    mode = _mode_of_own(path)
    if mode & FOREIGN_BITS:
        raise Refused(f"{path}: others may read it (mode {mode & 0o777:04o}), must be 0600")


def check_own(path: Path) -> None:
    """Raise Refused if the file at `path` is missing, of another user, or if others may write to it.

    An authority or rules put in place of a fleet's own decide whom its processes trust.
    """
    mode = _mode_of_own(path)
    if mode & OTHERS_WRITE:
        raise Refused(f"{path}: others may write to it (mode {mode & 0o777:04o}), must be 0600")


def _mode_of_own(path: Path) -> int:
    """Return the mode of a file. Raises Refused if it is missing, or neither this user's nor the administrator's."""
    try:
        found = path.stat()
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}, must be a file that `lfa keys` made") from None
    if found.st_uid not in (os.geteuid(), 0):
        raise Refused(f"{path}: of user {found.st_uid}, must be your own file")
    return found.st_mode


def check_valid(path: Path, wall_ms: int) -> None:
    """Raise Refused if `path` is no certificate, or not valid at wall-clock time `wall_ms` [ms]."""
    begins, ends = validity(path)
    now = datetime.fromtimestamp(wall_ms / 1000.0, UTC)
    if now > ends:
        raise Refused(f"{path}: expired on {ends:%Y-%m-%d %H:%M} UTC, renew it (lfa keys rotate)")
    if now < begins:
        raise Refused(f"{path}: valid only from {begins:%Y-%m-%d %H:%M} UTC, is this machine's clock right?")


def validity(path: Path) -> tuple[datetime, datetime]:
    """Return start and end of the validity of the certificate at `path`. Raises Refused if it is no certificate."""
    return _read(path, _validity)


def holder(path: Path) -> str:
    """Return the common name in the certificate at `path`; empty if it has none. Raises Refused for no certificate."""
    return _read(path, _common_name)


def _read(path: Path, part: Callable[[bytes], Part]) -> Part:
    """Return what `part` finds in the certificate at `path`. Raises Refused if it is no certificate."""
    try:
        text = read_bytes(path, CERTIFICATE_BYTES_MAX)
        return part(binascii.a2b_base64(text.partition(_BEGIN)[2].partition(_END)[0]))
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}, must be a certificate in PEM") from None
    except (ValueError, IndexError):
        raise Refused(f"{path}: must be a certificate in PEM") from None


def _validity(der: bytes) -> tuple[datetime, datetime]:
    begins = _element(der, _validity_at(der))[1]
    return _time(der, begins), _time(der, _element(der, begins)[2])


def _common_name(der: bytes) -> str:
    """Return the common name of the subject, which follows the validity."""
    _, start, end = _element(der, _element(der, _validity_at(der))[2])
    at = der.find(_COMMON_NAME, start, end)
    if at < 0:
        return ""
    _, start, end = _element(der, at + len(_COMMON_NAME))
    return der[start:end].decode()


def _validity_at(der: bytes) -> int:
    """Return the place of the validity.

    RFC 5280, 4.1: Certificate { TBSCertificate { [0] version, serial, signature, issuer, validity, subject, .. } .. }.
    """
    at = _element(der, _element(der, 0)[1])[1]
    if der[at] == _CONTEXT_0:
        at = _element(der, at)[2]
    for _ in ("serial", "signature", "issuer"):
        at = _element(der, at)[2]
    return at


def _element(der: bytes, at: int) -> tuple[int, int, int]:
    """Return tag, start and end of the content of the element at `at` (X.690, 8.1)."""
    length, start = der[at + 1], at + 2
    if length >= 0x80:
        start += length & 0x7F
        length = int.from_bytes(der[at + 2 : start], "big")
    if start + length > len(der):
        raise ValueError("truncated")
    return der[at], start, start + length


def _time(der: bytes, at: int) -> datetime:
    """Return the time of an element: UTCTime has years 1950 to 2049 in two digits, GeneralizedTime in four.

    RFC 5280, 4.1.2.5.
    """
    tag, start, end = _element(der, at)
    text = der[start:end].decode("ascii")
    if tag == _UTC_TIME:
        text = ("19" if text[:2] >= "50" else "20") + text
    year, *rest = int(text[:4]), *(int(text[n : n + 2]) for n in range(4, 14, 2))
    month, day, hour, minute, second = rest
    return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
