"""Who hears a key follows every change of a subscription, and costs no comparison with those of each robot."""

from __future__ import annotations

from random import Random
from unittest.mock import patch

from lfa.protocol.topics import alive_key, key, matches
from lfa.world import routes
from lfa.world.routes import Routes

NAMES = [f"robot{n}" for n in range(1, 6)]
KEYS = [key("f", name, topic) for name in NAMES for topic in ("pose", "table")] + [alive_key("f", "robot1", 1)]
KEYS += [key("f", name, "lease", to) for name in NAMES for to in ("all", "robot1")]
WILD = (
    key("f", "*", "pose"), key("f", "*", "table"), alive_key("f", "*", "*"), alive_key("f", "robot1", "*"),
    key("f", "*", "lease", "robot1"), key("f", "robot2", "lease", "*"), "lfa/f/*/lease/**", "lfa/f/robot1/*",
    "lfa/f/**", "**",
)  # fmt: skip
EXPRESSIONS = [*KEYS, *WILD]


def test_after_any_changes_exactly_those_hear_a_key_whose_subscriptions_match_it_in_the_order_of_their_starts() -> None:
    random, found = Random(1), Routes[str]()
    present: dict[str, frozenset[str]] = {}
    for _ in range(300):
        name = random.choice(NAMES)
        if name not in present:
            found.add(name, name)
            present[name] = frozenset()
        elif random.random() < 0.2:
            found.remove(name, present.pop(name))
            continue
        new = frozenset(random.sample(EXPRESSIONS, random.randrange(4)))
        found.change(name, present[name] - new, new - present[name])
        present[name] = new
        for where in KEYS:
            hear = [name for name, interests in present.items() if any(matches(e, where) for e in interests)]
            assert [name for name, _ in found.of(where).receivers] == hear


def test_a_subscription_to_one_key_leaves_what_is_known_of_other_keys() -> None:
    """A team of N robots makes N such changes while it forms, and has some 20 N keys."""
    found = Routes[str]()
    found.add("robot1", "robot1")
    found.change("robot1", (), [key("f", "*", "table")])
    for where in KEYS:
        found.of(where)
    found.change("robot1", (), [key("f", "robot2", "pose")])
    with patch.object(routes, "matches", wraps=matches) as compared:
        assert [name for where in KEYS for name, _ in found.of(where).receivers] == ["robot1"] * 6
    assert compared.call_count == 0, "the one wildcard is of another topic than the key of the new subscription"


def test_keys_that_the_same_subscriptions_match_share_their_receivers_until_one_of_these_changes() -> None:
    """A message of each of N robots to all others costs N lists of N receivers otherwise, and at each change anew."""
    found = Routes[str]()
    for name in NAMES:
        found.add(name, name)
        found.change(name, (), [key("f", "*", "table"), key("f", "*", "pose")])
    tables = [found.of(key("f", name, "table")).receivers for name in NAMES]
    assert all(receivers is tables[0] for receivers in tables)
    found.change("robot5", [key("f", "*", "pose")], [])
    assert found.of(key("f", "robot1", "table")).receivers is tables[0]
    found.change("robot5", [key("f", "*", "table")], [])
    assert [name for name, _ in found.of(key("f", "robot1", "table")).receivers] == NAMES[:4]
