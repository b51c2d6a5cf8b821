"""The default socket is taken from a folder of one's own only: a rogue router elsewhere captures nobody."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.transport.zenoh_config import answers, check_default, default_endpoint
from lfa.protocol.transport.zenoh_router import check_listen

NOBODY = 65534


def _of_another(folder: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("giving a folder to another user needs root")
    os.chown(folder, NOBODY, NOBODY)


def _open(folder: Path) -> None:
    folder.chmod(0o777)


def _link(folder: Path) -> None:
    folder.rename(folder.with_name("real"))
    folder.symlink_to(folder.with_name("real"))


@pytest.mark.parametrize("spoil", [_of_another, _open, _link])
def test_a_folder_that_others_control_is_refused_by_router_and_client(
    spoil: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "runtime"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    check_default(default_endpoint())
    spoil(folder)
    for use in (answers, lambda endpoint: check_listen(endpoint, None, False)):
        with pytest.raises(Refused, match="must be your own folder with mode 0700"):
            use(default_endpoint())


def test_the_folder_of_a_router_is_made_for_its_user_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "new"))
    check_default(default_endpoint())
    before = os.umask(0)
    try:
        check_listen(default_endpoint(), None, False)
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o700


def test_whoever_waits_for_a_router_makes_its_folder_before_another_user_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "new"))
    assert not answers(default_endpoint())
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o700


def test_an_endpoint_that_is_named_is_the_users_business(tmp_path: Path) -> None:
    tmp_path.chmod(0o777)
    check_default(f"unixsock-stream/{tmp_path}/router.sock")
