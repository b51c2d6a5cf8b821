"""Commands and snippets on the pages: each exists with its options, and those of the site's own pages run."""

from __future__ import annotations

import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfa.deploy.completion import words
from lfa.world.description.load import shipped
from tests.deploy.campaign.test_docs_page import COMMANDS
from tests.processes.test_readme_commands import ELSEWHERE, ON_A_FLEET
from tests.rigs.lfa_runs import LFA
from tests.test_citations import files
from tests.test_imports import ROOT

PAGES = files(".md")
SITE = ROOT / "deploy" / "docs"
CAMPAIGNS = [" ".join(text.split()) for text in COMMANDS]
TARGETS = set(" ".join(re.findall(r"^([a-z -]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)).split())
OPTIONS = {row.command: {*row.options, "-v", "-f"} for row in words()}
SCENARIOS = {*shipped(), "SCENARIO", "slalom"}  # slalom: the example's generator, installed
RUN_S_MAX = 200.0

#   command, in the order of the pages            what is added, to end sooner
SHORT = ("--set", "mission.leading.route_m=[[1.5, 0.0]]", "--no-figures")
RUN_HERE: dict[str, tuple[str, ...]] = {
    "lfa --version": (),
    "lfa sim leader_killed --seed 7 --out runs/first": ("--no-figures",),
    "lfa report runs/first": (),
    "lfa verify runs/first": (),
    "lfa schema --markdown": (),
    "lfa sim leader_killed --seed 7 --set mission.formation.side=column --robots 3 --out runs/column": (
        "--set", "faults=[]", *SHORT),
    "lfa report runs/first runs/column": (),
    "lfa sim circle --seed 3 --set mission.following.controller=kanayama --out runs/kanayama": SHORT,
    "lfa sim circle --seed 3 --out runs/law": SHORT,
    "lfa report runs/law runs/kanayama": (),
    "lfa sim straight --set assert.contacts_max=0 --set assert.distance_error_rms_m=0.05 --junit runs/junit.xml "
    "--out runs/asserted": SHORT,
    "lfa sim runs/law/scenario.toml --out runs/again": ("--no-figures",),
    "lfa replay runs/law --robot 2": (),
}  # fmt: skip
TESTED: dict[str, str] = {
    **dict.fromkeys(
        (
            "lfa fuzz --seeds 100000 --shard 3/16 --out runs/fuzz",
            "lfa bench motion --shard 1/2 --out runs/motion",
            "lfa verify RUN... --shard 1/2 --out runs/checked",
        ),
        "tests/deploy/campaign/test_searches.py",
    ),
    **dict.fromkeys(CAMPAIGNS, "tests/deploy/campaign/test_docs_page.py"),
    **dict.fromkeys(("lfa run leader_killed --out runs/real", "lfa run leader_killed"), "tests/processes/test_run.py"),
    "lfa sim leader_killed": "tests/deploy/run/test_simulate.py",
    "lfa fuzz --whole": "tests/deploy/fuzz/test_agent_simulation.py",
    "lfa replay RUN --robot 2": "tests/processes/test_readme_commands.py",
    "lfa watch": "tests/processes/test_readme_commands.py",
    "lfa fault kill leader": "tests/processes/test_readme_commands.py",
    **dict.fromkeys(("lfa bench NAME", "lfa bench router"), "tests/deploy/bench/test_router.py"),
    "lfa bench agent": "tests/deploy/bench/test_agent.py",
    "lfa bench agents": "tests/deploy/bench/test_agents.py",
    "lfa bench learn": "tests/deploy/bench/test_learn.py",
}
"""Commands of the site's pages that a test of their own runs."""
EXECUTED: dict[str, str] = {
    "README.md": "tests/agents/controllers/test_readme_controller.py",
    "agents/controllers/README.md": "tests/agents/controllers/test_plug_in.py",
    "protocol/DRIVER.md": "tests/test_pages.py",
    "world/SCENARIO.md": "tests/test_pages.py",
}
"""Pages whose python snippet a test of its own runs, with what belongs around it."""


def _name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, language: str) -> list[str]:
    fenced = re.findall(r"^```(\w*)\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
    return [text for found, text in fenced if found == language]


def commands(page: Path) -> Iterator[str]:
    """Commands of a page: in blocks without a language, where a comment or two blanks end one, and in backticks."""
    lines = (line.partition(" #")[0] for block in blocks(page, "") for line in block.splitlines())
    inside = (part.strip() for line in lines for part in re.split(r"; |\s{2,}|: ", line))
    prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    quoted = (" ".join(text.split()) for text in re.findall(r"`((?:lfa|make) [^`]+)`", prose))
    named = ("lfa run", "lfa sim", "lfa verify")  # named in a sentence, not to be typed
    yield from (
        text for text in (*inside, *quoted) if re.match(r"(lfa(-\w+)?|make|python) [\w-]", text) and text not in named
    )


def wrong(command: str) -> str | None:
    """What a command names that does not exist; None when all does. Only the form is looked at."""
    program, *rest = re.sub(r"[][]|\.\.\.", "", command).split()
    if program == "make":
        target = next(word for word in rest if "=" not in word)
        return None if target in TARGETS else f"target {target}"
    if program == "python":
        return None if rest[0] == "-m" or (ROOT / rest[0]).is_file() else f"file {rest[0]}"
    if program != "lfa" or rest in (["--version"], ["--help"]):
        return None
    name, *arguments = rest
    if name not in OPTIONS:
        return f"command {name}"
    options = {word.partition("=")[0] for word in arguments if re.match(r"--?[a-z]", word)}
    if options - OPTIONS[name]:
        return f"option {options - OPTIONS[name]}"
    scenario = arguments[0] if name in ("sim", "run") and arguments else "SCENARIO"
    return None if scenario in SCENARIOS or re.search(r"\.toml$|^-|\.py:\w+$", scenario) else f"scenario {scenario}"


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_every_command_of_a_page_exists_with_its_options(page: Path) -> None:
    assert [(text, found) for text in commands(page) if (found := wrong(text))] == []


@pytest.mark.parametrize(
    "planted", ["lfa simulate circle", "lfa sim circel", "lfa sim circle --sed 3", "make tset", "python deploy/x.py"]
)
def test_a_planted_wrong_command_is_seen(planted: str) -> None:
    assert wrong(planted)


def test_every_command_of_the_sites_pages_is_run() -> None:
    printed = [text for page in sorted(SITE.rglob("*.md")) for text in commands(page)]
    known = {*RUN_HERE, *TESTED, *ELSEWHERE, *ON_A_FLEET}
    assert [text for text in printed if not text.startswith(("make ", "python ")) and text not in known] == []
    assert [text for text in RUN_HERE if text not in printed and text != "lfa --version"] == []
    assert {path for path in TESTED.values() if not (ROOT / path).is_file()} == set()


def test_the_sites_commands_run_in_the_order_of_its_pages(tmp_path: Path) -> None:
    for command, more in RUN_HERE.items():
        call = [*LFA, *shlex.split(command)[1:], *more]
        done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, timeout=RUN_S_MAX, check=False)
        assert done.returncode == 0, f"{command} {shlex.join(more)}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=_name)
def test_every_python_snippet_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if _name(page) in EXECUTED:
        assert page.name in (ROOT / EXECUTED[_name(page)]).read_text()
        return
    monkeypatch.chdir(tmp_path)
    for snippet in blocks(page, "python"):
        exec(compile(snippet, _name(page), "exec"), {"__name__": "snippet"})


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "toml")], ids=_name)
def test_every_toml_snippet_is_read(page: Path, tmp_path: Path) -> None:
    for n, snippet in enumerate(blocks(page, "toml")):
        table = tomllib.loads(snippet)
        if "title" in table or "hosts" in table:
            path = tmp_path / f"snippet{n}.toml"
            path.write_text(snippet)
            done = subprocess.run(
                [*LFA, "validate", str(path)], capture_output=True, text=True, timeout=60, check=False
            )
            assert done.returncode == 0, done.stderr
