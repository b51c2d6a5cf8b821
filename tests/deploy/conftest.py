"""A planted bug that more than one hunt must find."""

from __future__ import annotations

import pytest

from lfa.protocol.lease.acceptor import Acceptor


@pytest.fixture
def forgetful_voter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every voter forgets whom it is bound to."""
    honest = Acceptor.propose

    def careless(self: Acceptor, *arguments: object) -> object:
        self.bond = None
        return honest(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Acceptor, "propose", careless)
    monkeypatch.setattr(Acceptor, "bound", lambda self, now: None)
