"""`lfa keys`: what lies where, and what a rotation and a revocation change."""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.fleet.keys_command import command, planned
from lfa.deploy.fleet.security import authority, keys, registry
from lfa.deploy.fleet.security.private_files import ISSUED
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.transport.credentials import ACCESS_FILE, USERS_FILE, check_valid, credentials, validity
from lfa.protocol.transport.zenoh_router import check_listen, open_router
from tests.deploy.fleet.security.test_access_rules import plan
from tests.rigs.lfa_runs import lfa

DAY_MS = 86_400_000


# --- what lies where -------------------------------------------------------------------------------------------------


def test_a_machine_has_the_keys_of_those_who_run_there_and_no_others(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan())
    names = {path.stem for path in registry.folder_of(tmp_path / "k", "b").glob("*.key")}
    assert names == {"host-b", "robot2", "operator", "recorder"}
    assert not list((tmp_path / "k" / "hosts").rglob("ca.key"))


def test_the_keys_of_persons_are_on_no_machine_and_each_machine_has_its_own(tmp_path: Path) -> None:
    """A copy of a machine's disk must not be a copy of the operator's key."""
    keys.make(tmp_path / "k", plan())
    for person in ("operator", "recorder"):
        held = {
            place: (folder / f"{person}.key").read_bytes()
            for place, folder in {
                "issued": tmp_path / "k" / ISSUED,
                **{host: registry.folder_of(tmp_path / "k", host) for host in "ab"},
            }.items()
        }
        assert len(set(held.values())) == len(held), f"the same key of the {person} in two places"


def test_what_lay_on_a_lost_machine_is_revoked_at_once_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "k"
    keys.make(folder, plan())
    lost = keys.kept_on(folder, "b")
    assert set(lost) == {"host-b", "robot2", "operator-b", "recorder-b"}
    keys.revoke(folder, lost)
    for host in "ab":
        rules, users = ((registry.folder_of(folder, host) / name).read_text() for name in (ACCESS_FILE, USERS_FILE))
        assert not [name for name in lost if f'"{name}"' in rules or f"{name}:" in users]
        assert '"operator"' in rules and '"operator-a"' in rules
    assert {one.name for one in keys.show(folder, 0) if one.state == "revoked"} == set(lost)
    with pytest.raises(Refused, match="--machine c: must be one of a, b"):
        keys.kept_on(folder, "c")


def test_what_lay_on_a_lost_machine_before_it_moved_is_revoked_too(tmp_path: Path) -> None:
    folder = tmp_path / "k"
    keys.make(folder, plan())
    keys.make(folder, plan(places={"robot2": ["a"]}))
    assert "robot2" in keys.kept_on(folder, "b")
    keys.revoke(folder, keys.kept_on(folder, "b"))
    keys.rotate(folder, ["robot2"])
    assert "robot2" not in keys.kept_on(folder, "b"), "its keys under the new common name never lay there"
    assert "robot2" in keys.kept_on(folder, "a")


def test_a_machine_that_left_the_plan_can_be_revoked_and_its_folder_is_gone(tmp_path: Path) -> None:
    folder = tmp_path / "k"
    keys.make(folder, plan())
    keys.make(folder, keys.spread("f", {"a": ("10.0.0.1",)}, range(1, 4)))
    assert not (folder / "hosts" / "b").exists() and not list((folder / ISSUED).glob("*-b.*"))
    assert keys.kept_on(folder, "b") == ["robot2"]


def test_everything_secret_is_for_the_owner_only(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        keys.make(tmp_path / "k", plan())
    finally:
        os.umask(before)
    files = [
        path for path in (tmp_path / "k").rglob("*") if path.suffix in (".key", ".password") or path.name == "users"
    ]
    assert len(files) > 10
    assert {stat.S_IMODE(path.stat().st_mode) for path in files} == {0o600}
    assert {stat.S_IMODE(p.stat().st_mode) for p in (tmp_path / "k").rglob("*") if p.is_dir()} == {0o700}


def test_making_again_keeps_everything(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan())
    before = contents(tmp_path / "k")
    assert keys.make(tmp_path / "k", plan()) == []
    assert contents(tmp_path / "k") == before


def test_a_plan_that_grows_adds_and_a_robot_that_moves_takes_its_keys_along(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan(2))
    assert keys.make(tmp_path / "k", plan(3, places={"robot1": ["b"]})) == ["robot3"]
    assert not (registry.folder_of(tmp_path / "k", "a") / "robot1.key").exists()
    assert (registry.folder_of(tmp_path / "k", "b") / "robot1.key").exists()


def test_what_expires_soon_or_serves_another_address_is_renewed(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan(1))
    ca = authority.load(tmp_path / "k" / "ca.pem", tmp_path / "k" / "ca.key")
    authority.issue(tmp_path / "k" / "issued" / "robot1", ca, "robot1", (), 0.001)
    moved = keys.spread("f", {"a": ("10.0.0.9",), "b": ()}, [1])
    assert sorted(keys.make(tmp_path / "k", moved)) == ["host-a", "robot1"]


def test_a_rotation_renews_keys_and_keeps_names_and_passwords(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan())
    before, at = contents(tmp_path / "k"), "issued/robot2"
    assert keys.rotate(tmp_path / "k", ["robot2"]) == ["robot2"]
    after = contents(tmp_path / "k")
    assert after[f"{at}.key"] != before[f"{at}.key"] and after[f"{at}.pem"] != before[f"{at}.pem"]
    assert after[f"{at}.password"] == before[f"{at}.password"]
    assert after["hosts/b/robot2.key"] == after[f"{at}.key"]
    assert after["issued/robot1.key"] == before["issued/robot1.key"]


def test_a_revoked_robot_leaves_all_lists_and_comes_back_under_another_common_name(tmp_path: Path) -> None:
    folder = tmp_path / "k"
    keys.make(folder, plan())
    keys.revoke(folder, ["robot3"])
    assert not list(folder.rglob("robot3.*"))
    for host in "ab":
        access = json.loads((registry.folder_of(folder, host) / "access.json").read_text())["access_control"]
        assert not [s for s in access["subjects"] if "robot3" in (s.get("cert_common_names"), *s.get("usernames", ()))]
        assert not [r for r in access["rules"] if "/robot3/cmd_vel" in str(r["key_exprs"])]
        assert "robot3" not in (registry.folder_of(folder, host) / "users").read_text()
    assert keys.make(folder, plan()) == [], "making again must not let it in again"
    assert keys.rotate(folder, ["robot3"]) == ["robot3"]
    assert registry.load(folder).common_names["robot3"] == "robot3.2"
    assert (registry.folder_of(folder, "a") / "robot3.password").read_text().startswith("robot3.2:")


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# --- what a process makes of it --------------------------------------------------------------------------------------


def test_the_validity_read_without_a_library_is_the_certificates(tmp_path: Path) -> None:
    from cryptography import x509

    keys.make(tmp_path / "k", plan(1))
    for path in (tmp_path / "k").rglob("*.pem"):
        certificate = x509.load_pem_x509_certificate(path.read_bytes())
        assert validity(path) == (certificate.not_valid_before_utc, certificate.not_valid_after_utc)


@pytest.mark.parametrize(("offset_days", "words"), [(400, "expired on"), (-2, "clock right?")])
def test_a_certificate_out_of_its_time_is_refused(tmp_path: Path, offset_days: int, words: str) -> None:
    keys.make(tmp_path / "k", plan(1))
    path = tmp_path / "k" / "issued" / "robot1.pem"
    now_ms = int(validity(path)[0].timestamp() * 1000.0) + DAY_MS
    check_valid(path, now_ms)
    with pytest.raises(Refused, match=words.replace("?", r"\?")):
        check_valid(path, now_ms + offset_days * DAY_MS)


def test_a_key_that_others_may_read_is_refused(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan(1))
    home = registry.folder_of(tmp_path / "k", "a")
    now_ms = int(validity(home / "robot1.pem")[0].timestamp() * 1000.0) + 1
    assert credentials(home, "robot1", now_ms).name == "robot1"
    (home / "robot1.key").chmod(0o640)
    with pytest.raises(Refused, match=r"0640.*must be 0600"):
        credentials(home, "robot1", now_ms)


def _of_nobody(path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("giving a file to another user needs root")
    os.chown(path, 65534, 65534)


@pytest.mark.parametrize(
    ("name", "spoil", "says"),
    [
        ("ca.pem", _of_nobody, "of user 65534, must be your own file"),
        ("ca.pem", lambda path: path.chmod(0o666), "others may write to it (mode 0666), must be 0600"),
        ("ca.pem", lambda path: path.chmod(0o620), "others may write to it (mode 0620), must be 0600"),
        ("robot1.key", _of_nobody, "of user 65534, must be your own file"),
        ("robot1.password", _of_nobody, "of user 65534, must be your own file"),
    ],
)
def test_files_that_another_user_could_have_put_there_are_refused(
    name: str, spoil: Callable[[Path], None], says: str, tmp_path: Path
) -> None:
    keys.make(tmp_path / "k", plan())
    here = registry.folder_of(tmp_path / "k", "a")
    credentials(here, "robot1", clock.wall_ms())
    spoil(here / name)
    with pytest.raises(Refused, match=re.escape(f"{here / name}: {says}")):
        credentials(here, "robot1", clock.wall_ms())


def test_rules_that_others_may_write_are_refused_by_a_secure_router(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan())
    here = registry.folder_of(tmp_path / "k", "a")
    (here / ACCESS_FILE).chmod(0o666)
    with pytest.raises(Refused, match=r"access.json: others may write to it \(mode 0666\)"):
        open_router(["tls/127.0.0.1:0"], credentials=credentials(here, "host-a", clock.wall_ms()), secure=True)


@pytest.mark.parametrize("inner", ["", "issued", "hosts", "hosts/a"])
def test_keys_are_not_written_into_a_folder_of_another_user(inner: str, tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan())
    _of_nobody(tmp_path / "k" / inner)
    with pytest.raises(Refused, match="of user 65534: must be your own folder, or a new one"):
        keys.rotate(tmp_path / "k")
    with pytest.raises(Refused, match="of user 65534: must be your own folder, or a new one"):
        keys.make(tmp_path / "k", plan())


def test_keys_are_not_written_through_a_link_that_another_user_has_set(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "k").symlink_to("mine")
    keys.make(tmp_path / "k", plan())
    if os.geteuid() != 0:
        pytest.skip("giving a link to another user needs root")
    os.lchown(tmp_path / "k", 65534, 65534)
    with pytest.raises(Refused, match="of user 65534: must be your own folder, or a new one"):
        keys.make(tmp_path / "k", plan())


@pytest.mark.parametrize("kind", ["pem", "password"])
def test_files_of_a_robot_under_the_operators_name_are_refused(tmp_path: Path, kind: str) -> None:
    """Routers drop what it says under a name that is not its own: an order from it would wait for answers in vain."""
    keys.make(tmp_path / "k", plan(1))
    home = registry.folder_of(tmp_path / "k", "a")
    now_ms = int(validity(home / "robot1.pem")[0].timestamp() * 1000.0) + 1
    assert credentials(home, "operator", now_ms).name == "operator"
    shutil.copyfile(home / f"robot1.{kind}", home / f"operator.{kind}")
    with pytest.raises(Refused, match=rf"operator\.{kind}: is that of robot1, must be that of operator"):
        credentials(home, "operator", now_ms)


def test_credentials_that_are_printed_tell_no_secret(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan(1))
    home = registry.folder_of(tmp_path / "k", "a")
    now_ms = int(validity(home / "robot1.pem")[0].timestamp() * 1000.0) + 1
    known = credentials(home, "robot1", now_ms)
    login = known.user_and_password()
    assert login is not None and login[1] not in repr(known)


@pytest.mark.parametrize("junk", [b"", b"junk", b"-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n"])
def test_what_is_no_certificate_is_refused(tmp_path: Path, junk: bytes) -> None:
    path = tmp_path / "x.pem"
    path.write_bytes(junk)
    with pytest.raises(Refused, match="must be a certificate in PEM"):
        validity(path)


def test_a_truncated_certificate_is_refused(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan(1))
    whole = (tmp_path / "k" / "ca.pem").read_bytes().splitlines()
    path = tmp_path / "x.pem"
    for lines in range(1, len(whole) - 2):
        path.write_bytes(b"\n".join((*whole[:lines], whole[-1])))
        with pytest.raises(Refused, match="must be a certificate in PEM"):
            validity(path)


def test_a_secure_router_listens_at_nothing_plain(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="not with --secure"):
        check_listen("tcp/127.0.0.1:7447", None, secure=True)


# --- the command -----------------------------------------------------------------------------------------------------


def test_init_show_revoke_as_one_types_them(tmp_path: Path) -> None:
    folder = str(tmp_path / "k")
    assert lfa("keys", "init", folder, "--robots", "2", "--hosts", "a=10.0.0.1+a.lan,b").returncode == 0
    facts = json.loads(lfa("keys", "revoke", folder, "robot2", "--json").stdout)
    assert facts == {"changed": ["robot2"], "hosts": ["a", "b"], "pushed": False, "wrong": []}
    shown = {line["name"]: line for line in json.loads(lfa("keys", "show", folder, "--json").stdout)}
    assert shown["robot2"]["state"] == "revoked" and shown["robot1"]["state"] == "valid"
    assert shown["robot1"]["joins_at"] == ["a", "b"]
    assert "lfa/fleet/robot1/pose" in shown["robot1"]["says"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("fleet", "a,a", 3, [], []), "each once"),
        (("fleet", "a,b", 0, [], []), "--robots 0"),
        (("fleet", "a,b", 3, ["robot9=a"], []), "robot9=a"),
        (("fleet", "a,b", 3, ["robot1=c"], []), "robot1=c"),
        (("fleet", "a,b", 3, [], [7]), "driver7"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(options: Sequence[Any], words: str) -> None:
    with pytest.raises(Refused, match=words):
        planned(*options)


@pytest.mark.parametrize("names", [["robot9"], ["robot1", "nobody"]])
def test_strangers_are_refused_and_nothing_changes(tmp_path: Path, names: list[str]) -> None:
    keys.make(tmp_path / "k", plan())
    before = contents(tmp_path / "k")
    for action in (keys.revoke, keys.rotate):
        with pytest.raises(Refused, match="no member of fleet f"):
            action(tmp_path / "k", names)
    assert contents(tmp_path / "k") == before


def test_a_folder_of_another_fleet_is_refused(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", plan())
    with pytest.raises(Refused, match="holds the keys of fleet 'f'"):
        keys.make(tmp_path / "k", keys.spread("g", {"a": ()}, [1]))


@pytest.mark.parametrize("days", ["0", "nan", "1e9"])
def test_certificates_for_no_days_or_for_ever_are_refused_before_anything_is_made(tmp_path: Path, days: str) -> None:
    with pytest.raises(Refused, match="--days"):
        command("init", tmp_path / "keys", days=float(days))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fleet", ["", "a/b", "*"])
def test_a_fleet_whose_name_would_widen_the_rules_is_refused(fleet: str) -> None:
    with pytest.raises(Refused, match="--fleet"):
        planned(fleet, "local", 4, [], [])
