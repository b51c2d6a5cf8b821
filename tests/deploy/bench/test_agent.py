"""`lfa bench agent`: shares of a core beside a bare process that does the same on the wire."""

from lfa.deploy.bench import agent


def test_an_agents_share_is_judged_and_a_bare_processs_only_told() -> None:
    rows = {row.name: row for row in agent._costs([4.0, 5.5], 2.5)}
    assert rows["agent/share of a core, mean"].ok
    assert not rows["agent/share of a core, the largest"].ok
    assert rows["bare process/share of a core"].bar is None
    assert rows["agent/times a bare process"].value == 1.9
