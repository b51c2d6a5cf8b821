"""What `lfa --version` prints: the version that the package and the log of changes name, and a checkout's commit."""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from lfa.deploy.version import commit, version_line
from tests.test_imports import PACKAGES, ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
AUTHOR = {"GIT_AUTHOR_NAME": "a", "GIT_AUTHOR_EMAIL": "a@b", "GIT_COMMITTER_NAME": "a", "GIT_COMMITTER_EMAIL": "a@b"}


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(
        ["git", *words], cwd=folder, env=os.environ | AUTHOR, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    _git(tmp_path, "init", "-q")
    (tmp_path / "a").write_text("one\n")
    _git(tmp_path, "add", "a")
    _git(tmp_path, "commit", "-q", "-m", "one")
    return tmp_path


def test_a_checkouts_commit_is_named(checkout: Path) -> None:
    assert commit(checkout) == _git(checkout, "rev-parse", "--short", "HEAD")
    assert version_line(checkout).endswith(f" (commit {commit(checkout)})")


def test_a_commit_whose_files_were_changed_is_dirty(checkout: Path) -> None:
    (checkout / "a").write_text("two\n")
    assert (commit(checkout) or "").endswith("-dirty")


def test_a_tag_does_not_stand_for_the_commit(checkout: Path) -> None:
    _git(checkout, "tag", "-a", "v9", "-m", "v9")
    assert commit(checkout) == _git(checkout, "rev-parse", "--short", "HEAD")


def test_an_installation_inside_of_another_checkout_has_no_commit(checkout: Path) -> None:
    installed = checkout / "site-packages" / "lfa"
    installed.mkdir(parents=True)
    assert commit(installed) is None
    assert re.fullmatch(r"lfa \d+\.\d+\.\d+", version_line(installed))


def test_without_git_the_version_is_left(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert commit(checkout) is None


def test_the_log_of_changes_begins_with_the_packages_version() -> None:
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert newest is not None
    assert newest[1] == PROJECT["version"]


def test_every_package_says_that_it_has_types() -> None:
    assert [package for package in PACKAGES if not (ROOT / package / "py.typed").is_file()] == []
