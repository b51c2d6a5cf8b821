"""Certificate authority of a fleet: EC P-256 keys and X.509 certificates (RFC 5280), by `cryptography`.

Only routers have server certificates: a robot's certificate cannot impersonate a router at any address.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, EllipticCurvePrivateKey, generate_private_key
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from msgspec import Struct

from lfa.deploy.fleet.security.private_files import write_private
from lfa.deploy.whole_output import whole_file
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import read_bytes

CA_DAYS = 3650.0
COMMON_NAME_MAX = 58
"""Maximum length of a common name: 64 (RFC 5280), without the number that a name gets after a revocation."""
BACKDATED = timedelta(hours=1)
"""Start of validity before the time of issue, so that a machine whose clock lags accepts a new certificate."""
DAMAGED = (ValueError, TypeError, UnsupportedAlgorithm, x509.InvalidVersion)
"""Exceptions of `cryptography` at bytes that are no key or certificate."""
PEM_BYTES_MAX = 64 * 1024
RENEW_BEFORE = timedelta(days=30)


class Authority(Struct, frozen=True):
    """Certificate and private key of the authority."""

    certificate: x509.Certificate
    key: EllipticCurvePrivateKey


def found(certificate: Path, key: Path, fleet: str) -> None:
    """Create an authority and write its certificate and key."""
    private = generate_private_key(SECP256R1())
    name = _name(authority_name(fleet))
    usage = x509.KeyUsage(False, False, False, False, False, True, True, False, False)
    signed = (
        _begun(name, name, private, CA_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(private, SHA256())
    )
    write_key(key, private)
    _write_certificate(certificate, signed)


def check_names(fleet: str, members: Mapping[str, tuple[str, ...]]) -> None:
    """Raise Refused unless certificates can hold these names: the fleet's, and members' with their addresses."""
    for name in (authority_name(fleet), *members):
        if len(name) > COMMON_NAME_MAX or not name.isascii():
            raise Refused(f"{name[:80]}: must be at most {COMMON_NAME_MAX} letters of ASCII, for a certificate")
    for name, addresses in members.items():
        try:
            _names(addresses)
        except ValueError as error:
            raise Refused(f"{name}: an address among {', '.join(addresses)} is none ({error})") from None


def authority_name(fleet: str) -> str:
    """Return the common name of a fleet's authority."""
    return f"lfa fleet {fleet}"


def load(certificate: Path, key: Path) -> Authority:
    """Return the authority in these files. Raises Refused when they hold none, or do not belong together."""
    try:
        private, public, signed = _pair(key, certificate)
    except (OSError, *DAMAGED) as error:
        raise Refused(f"{certificate}, {key}: {error}, must be a fleet's authority (lfa keys init)") from None
    if not isinstance(private, EllipticCurvePrivateKey) or private.public_key() != public:
        raise Refused(f"{key}: does not belong to {certificate}")
    return Authority(signed, private)


def issue(stem: Path, ca: Authority, common_name: str, addresses: tuple[str, ...], days: float) -> None:
    """Write a new key and certificate to `stem`.key and .pem; `addresses` (names or IPs) make it a server's."""
    private = generate_private_key(SECP256R1())
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH] + ([ExtendedKeyUsageOID.SERVER_AUTH] if addresses else [])
    signed = (
        _begun(_name(common_name), ca.certificate.subject, private, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(x509.SubjectAlternativeName(_names(addresses or (common_name,))), critical=False)
        .sign(ca.key, SHA256())
    )
    write_key(stem.with_name(f"{stem.name}.key"), private)
    _write_certificate(stem.with_name(f"{stem.name}.pem"), signed)


def certificate_of(path: Path) -> x509.Certificate:
    """Return the certificate of an authority. Raises Refused when the file holds none."""
    try:
        found = x509.load_pem_x509_certificate(read_bytes(path, PEM_BYTES_MAX))
        signs = found.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except OSError as error:
        raise Refused(f"{path}: {error.strerror or error}, must be an authority's certificate in PEM") from None
    except (*DAMAGED, x509.ExtensionNotFound, x509.DuplicateExtension):
        raise Refused(f"{path}: holds none, must be an authority's certificate in PEM") from None
    if not signs:
        raise Refused(f"{path}: is no authority's certificate (basic constraints), must be the one that signs")
    return found


def request(stem: Path, request_path: Path, common_name: str, addresses: tuple[str, ...]) -> None:
    """Write a signing request for an outside authority, and the key at `stem`.key if there is none yet.

    It asks for what `issue` writes. Raises Refused for a key that cannot be read.
    """
    key = stem.with_name(f"{stem.name}.key")
    if not key.exists():
        write_key(key, generate_private_key(SECP256R1()))
    try:
        private = load_pem_private_key(read_bytes(key, PEM_BYTES_MAX), None)
    except (OSError, *DAMAGED) as error:
        raise Refused(f"{key}: {error}, must be a private key that `lfa keys` made") from None
    if not isinstance(private, EllipticCurvePrivateKey):
        raise Refused(f"{key}: must be a private key that `lfa keys` made")
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH] + ([ExtendedKeyUsageOID.SERVER_AUTH] if addresses else [])
    asked = (
        x509.CertificateSigningRequestBuilder()
        .subject_name(_name(common_name))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(x509.SubjectAlternativeName(_names(addresses or (common_name,))), critical=False)
        .sign(private, SHA256())
    )
    request_path.write_bytes(asked.public_bytes(Encoding.PEM))


def fits(stem: Path, ca: x509.Certificate, common_name: str, addresses: tuple[str, ...]) -> bool:
    """Return True if the certificate at `stem` is valid for reuse.

    It is issued by this authority for this name and these addresses, matches its key, and remains valid for more than
    RENEW_BEFORE or half its validity, whichever is less.
    """
    try:
        private, public, found = _pair(stem.with_name(f"{stem.name}.key"), stem.with_name(f"{stem.name}.pem"))
        found.verify_directly_issued_by(ca)
        said = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, *DAMAGED, InvalidSignature, x509.ExtensionNotFound, x509.DuplicateExtension):
        return False
    validity = found.not_valid_after_utc - found.not_valid_before_utc
    left = found.not_valid_after_utc - datetime.now(UTC)
    same = list(said) == _names(addresses or (common_name,)) and found.subject == _name(common_name)
    return same and private.public_key() == public and left > min(RENEW_BEFORE, validity / 2)


def _pair(key: Path, certificate: Path) -> tuple[Any, Any, x509.Certificate]:
    """Return a private key, and a certificate after its public key. Raises OSError and one of DAMAGED."""
    private = load_pem_private_key(read_bytes(key, PEM_BYTES_MAX), None)
    signed = x509.load_pem_x509_certificate(read_bytes(certificate, PEM_BYTES_MAX))
    return private, signed.public_key(), signed


def write_key(path: Path, key: EllipticCurvePrivateKey) -> None:
    """Write `key` in PKCS8, for its owner only."""
    text = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    write_private(path, text)


def _write_certificate(path: Path, certificate: x509.Certificate) -> None:
    with whole_file(path) as fresh:
        fresh.write_bytes(certificate.public_bytes(Encoding.PEM))


def _begun(subject: x509.Name, issuer: x509.Name, key: EllipticCurvePrivateKey, days: float) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(now + timedelta(days=days))
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _names(addresses: tuple[str, ...]) -> list[x509.GeneralName]:
    """Return IP addresses as such, everything else as DNS names."""
    names: list[x509.GeneralName] = []
    for address in addresses:
        try:
            names.append(x509.IPAddress(ip_address(address)))
        except ValueError:
            names.append(x509.DNSName(address))
    return names
