"""What only a real router shows: whose its receiver threads are, and who is given whose word."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def router() -> Iterator[str]:
    """The endpoint of one that runs."""
    with tempfile.TemporaryDirectory(prefix="lfa-", dir="/tmp") as folder:
        endpoint = f"unixsock-stream/{Path(folder) / 'router.sock'}"
        router = subprocess.Popen(
            [sys.executable, "-P", "-m", "lfa.deploy.fleet.host.router", "--listen", endpoint],
            stdout=subprocess.DEVNULL,
        )
        try:
            yield endpoint
        finally:
            router.kill()
            router.wait()


def _printed(script: str) -> str:
    """What `script` prints, given the endpoint of a router that runs, in a process with no wishes for its threads."""
    fresh = {name: value for name, value in os.environ.items() if name != "ZENOH_RUNTIME"}
    with router() as endpoint:
        client = [sys.executable, "-c", script, endpoint]
        return subprocess.run(client, capture_output=True, text=True, timeout=60, check=True, env=fresh).stdout.strip()


SCRIPT = """
import os, sys
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
while not answers(sys.argv[1]):
    pass
ZenohBus(sys.argv[1], Inbox()).close()
print(os.environ.get("ZENOH_RUNTIME"))
"""


def test_what_a_client_asks_of_zenoh_is_not_inherited_by_its_children() -> None:
    """A router's receiver threads are its own: no client that started it hands it fewer."""
    assert _printed(SCRIPT) == "None"


HEARD = """
import sys
from lfa.protocol import clock
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.topics import address
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
while not answers(sys.argv[1]):
    pass
inboxes = Inbox(every=True), Inbox(every=True)
one, other = (ZenohBus(sys.argv[1], inbox) for inbox in inboxes)
for bus in (one, other):
    bus.follow(frozenset({"lfa/f/*/lease/all", "lfa/f/*/table", "lfa/f/*/event"}))
heard = [set(), set()]
until = clock.now() + 30.0
while clock.now() < until and (len(heard[1]) < 3 or not heard[0]):
    for topic in ("lease/all", "table", "event"):
        one.publish("lfa/f/robot1/" + topic, b"")
    clock.sleep(0.02)
    for topics, inbox in zip(heard, inboxes):
        topics.update(address(arrival.key).topic for arrival in inbox.take() if arrival.key)
for bus in (one, other):
    bus.close()
print(sorted(heard[0]), sorted(heard[1]))
"""


def test_who_says_what_all_say_is_not_given_its_own_word() -> None:
    assert _printed(HEARD) == "['event'] ['event', 'lease', 'table']"


THREADS = """
import sys, threading
from pathlib import Path
from lfa.protocol import clock
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
here = threading.local()
class Remembering(Inbox):
    most = 0
    def put(self, arrival):
        here.puts = getattr(here, "puts", 0) + 1
        self.most = max(self.most, here.puts)
while not answers(sys.argv[1]):
    pass
inbox = Remembering()
one, other = ZenohBus(sys.argv[1], Inbox()), ZenohBus(sys.argv[1], inbox)
other.follow(frozenset({"lfa/f/*/event"}))
until = clock.now() + 10.0
while clock.now() < until and inbox.most < 2:
    one.publish("lfa/f/robot1/event", b"")
    clock.sleep(0.01)
names = [task.read_text().strip() for task in Path("/proc/self/task").glob("*/comm")]
one.close()
other.close()
print(inbox.most, {name.split("-")[0] for name in names if "-" in name})
"""


def test_a_client_has_one_pool_of_threads_and_python_knows_each_of_them_for_good() -> None:
    """What a callback leaves with its thread is there at that thread's next one: nothing is made anew a sample."""
    assert _printed(THREADS) == "2 {'rx'}"
