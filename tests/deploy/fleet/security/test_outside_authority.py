"""An outside authority signs a fleet's certificates: requests out, certificates in, and nobody gets keys before."""

from __future__ import annotations

import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding
from msgspec import structs

from lfa.deploy.fleet.keys_command import command
from lfa.deploy.fleet.security import authority, keys, registry
from lfa.deploy.fleet.security.private_files import ISSUED
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.transport.credentials import credentials

PLAN = keys.spread("f", {"a": ("10.0.0.1",)}, (1, 2))


class Company:
    """An authority outside of the fleet, with its key in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.certificate = folder / "company.pem"
        authority.found(self.certificate, folder / "company.key", "company")
        self.ca = authority.load(self.certificate, folder / "company.key")

    def sign(self, request: Path, to: Path) -> None:
        """Sign as asked: subject and extensions of the request."""
        asked = x509.load_pem_x509_csr(request.read_bytes())
        assert asked.is_signature_valid
        now = datetime.now(UTC)
        builder = (
            x509.CertificateBuilder()
            .subject_name(asked.subject)
            .issuer_name(self.ca.certificate.subject)
            .public_key(asked.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(hours=1))
            .not_valid_after(now + timedelta(days=90))
        )
        for extension in asked.extensions:
            builder = builder.add_extension(extension.value, extension.critical)
        to.write_bytes(builder.sign(self.ca.key, SHA256()).public_bytes(Encoding.PEM))


@pytest.fixture
def company(tmp_path: Path) -> Company:
    return Company(tmp_path / "company")


def signed(folder: Path, company: Company) -> None:
    with pytest.raises(Refused, match="not signed yet"):
        keys.make(folder, PLAN, ca_cert=company.certificate)
    for request in (folder / registry.REQUESTS).iterdir():
        company.sign(request, folder / ISSUED / f"{request.stem}.pem")


def test_signed_requests_become_the_keys_of_the_machines(tmp_path: Path, company: Company) -> None:
    folder = tmp_path / "keys"
    signed(folder, company)
    keys.make(folder, PLAN, ca_cert=company.certificate)
    for name in ("robot1", "robot2", "world", "host-a"):
        credentials(registry.folder_of(folder, "a"), name, clock.wall_ms())
    assert not (folder / registry.CA_KEY).exists()
    assert keys.requested(folder) == []
    openssl = ["openssl", "verify", "-CAfile", str(folder / "ca.pem"), str(folder / ISSUED / "robot1.pem")]
    assert subprocess.run(openssl, capture_output=True, check=False).returncode == 0


def test_nobody_gets_keys_before_all_are_signed(tmp_path: Path, company: Company) -> None:
    folder = tmp_path / "keys"
    with pytest.raises(Refused, match=r"8 certificates are not signed yet .*requests/\*\.csr signed"):
        keys.make(folder, PLAN, ca_cert=company.certificate)
    assert list((folder / registry.HOSTS).iterdir()) == []
    assert len(keys.requested(folder)) == 8


def test_a_request_asks_for_the_routers_addresses_and_for_no_others(tmp_path: Path, company: Company) -> None:
    folder = tmp_path / "keys"
    with pytest.raises(Refused):
        keys.make(folder, PLAN, ca_cert=company.certificate)
    asked = {path.stem: x509.load_pem_x509_csr(path.read_bytes()) for path in (folder / registry.REQUESTS).iterdir()}
    text = {
        name: str(one.extensions.get_extension_for_class(x509.SubjectAlternativeName)) for name, one in asked.items()
    }
    assert "10.0.0.1" in text["host-a"] and "10.0.0.1" not in text["robot1"]


def test_a_certificate_of_another_authority_is_asked_for_again(tmp_path: Path, company: Company) -> None:
    folder = tmp_path / "keys"
    signed(folder, company)
    request = folder / registry.REQUESTS / "robot1.csr"
    Company(tmp_path / "other").sign(request, folder / ISSUED / "robot1.pem")
    with pytest.raises(Refused, match=r"1 certificates are not signed yet \(robot1"):
        keys.make(folder, PLAN, ca_cert=company.certificate)


def test_a_revoked_member_is_off_the_lists_as_ever(tmp_path: Path, company: Company) -> None:
    folder = tmp_path / "keys"
    signed(folder, company)
    keys.make(folder, PLAN)
    keys.revoke(folder, ["robot2"])
    assert "robot2" not in (registry.folder_of(folder, "a") / "users").read_text()


def test_what_only_an_own_authority_can_do_is_refused(tmp_path: Path, company: Company) -> None:
    own, outside = tmp_path / "own", tmp_path / "outside"
    keys.make(own, PLAN)
    with pytest.raises(Refused, match="signs by itself"):
        command("csr", own)
    with pytest.raises(Refused, match="has an authority of its own"):
        keys.make(own, PLAN, ca_cert=company.certificate)
    signed(outside, company)
    keys.make(outside, PLAN)
    with pytest.raises(Refused, match="lfa keys csr"):
        keys.rotate(outside, ["robot1"])


@pytest.mark.parametrize("content", [b"", b"no certificate", None])
def test_a_file_that_is_no_authority_is_refused_and_nothing_is_made(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "ca.pem"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(Refused, match="must be an authority's certificate"):
        keys.make(tmp_path / "keys", PLAN, ca_cert=file)
    assert not (tmp_path / "keys").exists()


def test_a_robots_certificate_is_no_authority(tmp_path: Path) -> None:
    keys.make(tmp_path / "own", PLAN)
    with pytest.raises(Refused, match="no authority's certificate"):
        keys.make(tmp_path / "keys", PLAN, ca_cert=tmp_path / "own" / ISSUED / "robot1.pem")


def test_a_robot_that_left_the_plan_needs_no_signature_and_holds_no_revocation_up(
    tmp_path: Path, company: Company
) -> None:
    folder = tmp_path / "keys"
    signed(folder, company)
    keys.make(folder, PLAN)
    smaller = structs.replace(PLAN, places={name: at for name, at in PLAN.places.items() if name != "robot2"})
    keys.make(folder, smaller)
    keys.make(folder, smaller)
    keys.revoke(folder, ["robot1"])
    assert "robot1" not in registry.load(folder).common_names
    assert list((folder / "requests").iterdir()) == []


def test_a_revocation_waits_for_no_signature_of_others(tmp_path: Path, company: Company) -> None:
    folder = tmp_path / "keys"
    signed(folder, company)
    keys.make(folder, PLAN)
    here = registry.folder_of(folder, "a")
    with pytest.raises(Refused, match="not signed yet"):
        keys.make(folder, keys.spread("f", {"a": ("10.0.0.1",)}, (1, 2, 3)))
    assert keys.revoke(folder, ["robot2"]) == ["a"]
    users, rules = (here / "users").read_text(), (here / "access.json").read_text()
    assert ("robot1:" in users, "robot2:" in users) == (True, False)
    assert ('"robot1"' in rules, '"robot2"' in rules) == (True, False)
    assert not (here / "robot2.key").exists()
    assert not (folder / ISSUED / "robot2.key").exists()
    assert (here / "robot1.key").exists()
    assert (folder / ISSUED / "robot3.key").exists()


def test_an_authoritys_file_that_is_not_there_is_named_once_and_in_words(tmp_path: Path) -> None:
    path = tmp_path / "none.pem"
    with pytest.raises(Refused) as refused:
        authority.certificate_of(path)
    assert str(refused.value) == f"{path}: No such file or directory, must be an authority's certificate in PEM"
