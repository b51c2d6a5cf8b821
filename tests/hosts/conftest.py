"""Figures: measured by the tests, printed at the end beside their bars; with `--bars` a missed bar fails its test.

Without it what is asserted is what happens, not how fast: the machine may be busy with something else.
"""

from __future__ import annotations

from typing import Protocol

import pytest

_figures: list[str] = []


class Figure(Protocol):
    """`figure(name, value, bar)` in seconds. `alone` is the same quantity just before, with nothing done to anybody."""

    def __call__(self, name: str, value: float, bar: float, alone: float | None = None) -> None: ...


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--bars", action="store_true", help="fail where a figure misses its bar")


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Figure:
    strict = request.config.getoption("--bars", default=False)

    def judge(name: str, value: float, bar: float, alone: float | None = None) -> None:
        before = "" if alone is None else f", {alone:.2f} s before"
        _figures.append(f"{name:<68} {value:6.2f} s  (at most {bar:g} s{before}){'' if value <= bar else '  MISSED'}")
        assert value <= bar or not strict, f"{name}: {value:.2f} s, more than {bar:g} s"

    return judge


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if _figures:
        terminalreporter.section("figures")
        for line in _figures:
            terminalreporter.line(line)
