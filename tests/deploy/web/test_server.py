"""The page's server: who may look and who may act, and what bad input leaves."""

from __future__ import annotations

import http.client
import json
import socket
import threading
from collections.abc import Iterator
from functools import partial
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from lfa.deploy.bench.harness.browser import Browser, chromium
from lfa.deploy.web.server import PAGE
from tests.rigs.lfa_runs import lfa
from tests.rigs.web_page import Served, served

pytestmark = [pytest.mark.processes, pytest.mark.xdist_group("web")]
PAGE_BYTES_MAX = 1_000_000
MARKUP = "<img src=x onerror=window.hacked=1><script>window.hacked=1</script>"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    path = tmp_path_factory.mktemp("web") / "hostile.toml"
    path.write_text(f"title = {json.dumps(MARKUP)}\ntime_limit_s = 20.0\n[mission.leading]\nroute_m = [[9.0, 0.0]]\n")
    with served(str(path)) as running:
        yield running


def get(server: Served, path: str, host: str = "") -> tuple[int, str, dict[str, str]]:
    connection = http.client.HTTPConnection(server.host, timeout=10)
    connection.request("GET", path, headers={"Host": host or server.host})
    answer = connection.getresponse()
    return answer.status, answer.read().decode(), dict(answer.getheaders())


def attach(server: Served, address: str, origin: str = ""):  # type: ignore[no-untyped-def]
    return connect(server.socket(address), origin=origin or f"http://{server.host}", compression=None)


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/index.html", "/clip.json", "/ws"])
def test_without_its_token_nothing_is_shown(server: Served, path: str) -> None:
    status, text, _ = get(server, path)
    assert status == 403 and text.count("\n") == 1 and "needs its token" in text


@pytest.mark.parametrize("path", ["/../command.py", "/%2e%2e/command.py", "/page", "/x.js"])
def test_no_other_file_is_served(server: Served, path: str) -> None:
    assert get(server, path)[0] == 404


def test_every_answer_forbids_what_is_not_the_pages_own(server: Served) -> None:
    for path in ("/", f"/?{urlsplit(server.operate).query}", "/main.js"):
        headers = get(server, path)[2]
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"


def test_a_name_that_was_made_to_point_here_gets_nothing(server: Served) -> None:
    assert get(server, f"/?{urlsplit(server.operate).query}", "evil.example")[0] == 403


def test_a_page_elsewhere_cannot_connect_even_with_the_token(server: Served) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        attach(server, server.operate, "http://evil.example")


def test_who_may_look_cannot_act(server: Served) -> None:
    with attach(server, server.look) as viewer:
        viewer.send('{"do": "play"}')
        heard = [json.loads(viewer.recv(10)) for _ in range(10)]
    assert {"refused": "this address lets you look only"} in heard
    assert not any(message.get("state", {}).get("playing") for message in heard)
    assert server.operate.split("token=")[1] not in str(heard)


@pytest.mark.parametrize("text", ["", "{", "[]", "7", '{"do": []}', '{"do": "speed", "value": "x"}', "[" * 60_000])
def test_an_order_that_is_none_is_answered_with_one_line(server: Served, text: str) -> None:
    with attach(server, server.operate) as viewer:
        viewer.send(text)
        assert any("refused" in json.loads(viewer.recv(10)) for _ in range(10))


def test_a_viewer_that_takes_nothing_holds_nobody_up(server: Served) -> None:
    with attach(server, server.look) as slow, attach(server, server.operate) as viewer:
        slow.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        viewer.send('{"do": "play"}')
        times = []
        while len(times) < 60:
            message = json.loads(viewer.recv(10))
            times += [message["frames"][0]["t"]] if "frames" in message else []
        viewer.send('{"do": "pause"}')
    assert times[-1] > times[0]


def test_the_page_is_small() -> None:
    assert sum(path.stat().st_size for path in PAGE.iterdir()) < PAGE_BYTES_MAX


def test_a_port_in_use_is_told_in_one_line(server: Served) -> None:
    done = lfa("web", "--port", server.host.partition(":")[2])
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "in use, must be a free one" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("no_such",), "no scenario 'no_such'"),
        (("--listen", "0.0.0.0"), "must come with --keys"),
        (("--port", "70000"), "must be from 0 to 65535"),
        (("#run=leader_killed&fault=hug",), "must be like"),
        (("leader_killed", "--set", "x=1"), "no such key"),
        (("--listen", "192.0.2.1", "--keys", "/nowhere"), "/nowhere"),
    ],
)
def test_bad_input_is_told_in_one_line(arguments: tuple[str, ...], why: str) -> None:
    done = lfa("web", "--port", "0", *arguments)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert why in done.stderr


class _Attacker(BaseHTTPRequestHandler):
    """A page on another origin that knows the operator's address, and tries what a page can try."""

    target = ""

    def do_GET(self) -> None:
        page = f"""<body><script>
        window.got = [];
        const target = {json.dumps(self.target)};
        fetch(target).then((a) => a.text()).then((t) => got.push("read: " + t.length), () => got.push("no fetch"));
        const frame = document.createElement("iframe"); frame.src = target; document.body.append(frame);
        frame.onload = () => {{
          try {{ got.push("frame: " + frame.contentWindow.lfa) }} catch (e) {{ got.push("no frame") }}
        }};
        const socket = new WebSocket(target.replace("http", "ws").replace("/?", "/ws?"));
        socket.onopen = () => {{ got.push("socket"); socket.send('{{"do": "play"}}') }};
        socket.onerror = () => got.push("no socket");
        </script>"""
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(page.encode())

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.mark.skipif(chromium() is None, reason="no Chromium")
def test_an_attack_page_on_another_origin_can_do_nothing(server: Served) -> None:
    attacker = HTTPServer(("127.0.0.1", 0), type("Attacker", (_Attacker,), {"target": server.operate}))
    thread = threading.Thread(target=partial(attacker.serve_forever, 0.05))
    thread.start()
    try:
        with Browser() as browser:
            browser.open(f"http://127.0.0.1:{attacker.server_port}/")
            browser.wait_for("window.got.length === 3")
            assert sorted(browser.value("window.got")) == ["no fetch", "no frame", "no socket"]
            browser.errors.clear()
            browser.open(server.operate)
            browser.wait_for("lfa.models[0].robots.size === 4")
            assert browser.value("lfa.state.playing") is False
            assert browser.value("document.getElementById('title').textContent") == MARKUP
            assert browser.value("window.hacked === undefined && document.images.length === 0")
            assert browser.errors == []
    finally:
        attacker.shutdown()
        thread.join()
        attacker.server_close()


def test_the_fleets_certificates_secure_the_page_elsewhere(tmp_path: Path) -> None:
    import ssl

    assert lfa("keys", "init", str(tmp_path / "keys"), "--robots", "2", "--hosts", "a=127.0.0.1").returncode == 0
    with served("--listen", "0.0.0.0", "--keys", str(tmp_path / "keys" / "hosts" / "a")) as running:
        assert running.operate.startswith("https://")
        port = int(running.operate.split(":")[2].partition("/")[0])
        context = ssl.create_default_context(cafile=str(next((tmp_path / "keys").rglob("ca.pem"))))
        context.check_hostname = False
        connection = http.client.HTTPSConnection("127.0.0.1", port, context=context, timeout=10)
        connection.request("GET", f"/?{urlsplit(running.operate).query}")
        assert connection.getresponse().status == 200
