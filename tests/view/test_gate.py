"""Who may talk to the page, and what it is made of."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import dicedesign as dd
from dicedesign.view.application import View
from dicedesign.view.serving import Gate, open_socket


@pytest.fixture(scope="module")
def alone() -> Iterator[View]:
    """A page for this machine."""
    view = View(None)
    yield view
    view.close()


@pytest.fixture(scope="module")
def wide() -> Iterator[View]:
    """A page for every machine."""
    view = View(None, "0.0.0.0")
    yield view
    view.close()


@dataclass(frozen=True)
class Reply:
    """What came back."""

    status: int
    policy: str
    body: bytes


def asked(view: View, path: str, **headers: str) -> Reply:
    connection = http.client.HTTPConnection("127.0.0.1", view.page.gate.port, timeout=30)
    with closing(connection):
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        policy = answer.getheader("Content-Security-Policy") or ""
        return Reply(answer.status, policy, answer.read())


def socket_opens(view: View, path: str, origin: str | None = None) -> bool:
    url = f"ws://127.0.0.1:{view.page.gate.port}{path}"
    speaks: Any = {"origin": origin, "subprotocols": [f"viser-v{viser.__version__}"]}
    try:
        with connect(url, **speaks):
            return True
    except InvalidStatus:
        return False


def test_a_page_for_this_machine_is_at_its_address_alone(alone: View) -> None:
    gate = alone.page.gate
    assert gate.address == f"http://127.0.0.1:{gate.port}/"
    assert gate.token == ""
    answer = asked(alone, "/")
    assert answer.status == 200
    assert "default-src 'self'" in answer.policy
    assert b"<title>dicedesign</title>" in answer.body
    assert asked(alone, "/../secret").status in (403, 404)


def test_other_sites_may_not_talk_to_the_page(alone: View) -> None:
    port = alone.page.gate.port
    assert socket_opens(alone, "/")
    assert socket_opens(alone, "/", f"http://127.0.0.1:{port}")
    assert not socket_opens(alone, "/", "http://evil.example")
    assert not socket_opens(alone, "/", f"http://127.0.0.1:{port + 1}")
    # A name that somebody else's server leads to this machine.
    assert asked(alone, "/", Host=f"evil.example:{port}").status == 403
    assert asked(alone, "/", Host=f"localhost:{port}").status == 200
    told = {"Sec-Fetch-Site": "cross-site"}
    assert asked(alone, "/action/stand:0", **told).status == 403


def test_a_page_for_every_machine_wants_its_token(wide: View) -> None:
    gate = wide.page.gate
    assert len(gate.token) >= 20
    assert urlsplit(gate.address).path == f"/{gate.token}/"
    assert asked(wide, f"/{gate.token}/").status == 200
    for path in ("/", "/wrong/", f"/{gate.token[:-1]}/", "/index.html", "/action/stand:0"):
        assert asked(wide, path).status == 403
    assert socket_opens(wide, f"/{gate.token}")
    assert not socket_opens(wide, "/")
    assert not socket_opens(wide, "/wrong")


def test_tokens_differ() -> None:
    with closing(open_socket("0.0.0.0", 0)) as one, closing(open_socket("0.0.0.0", 0)) as other:
        assert Gate.of(one).token != Gate.of(other).token


def test_a_taken_port_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(dd.InputError, match=rf"--port: .*{port}.*take another"):
            View(None, "127.0.0.1", port)


@pytest.mark.parametrize(
    ("host", "port", "said"),
    [
        ("127.0.0.1", -1, "--port"),
        ("127.0.0.1", 65536, "--port"),
        ("no.such.host.invalid", 0, "--host"),
        ("203.0.113.7", 0, "--host|--port"),
    ],
)
def test_hosts_and_ports_that_cannot_be(host: str, port: int, said: str) -> None:
    with pytest.raises(dd.InputError, match=said):
        open_socket(host, port)


def test_a_closed_page_leaves_its_port() -> None:
    view = View(None)
    port = view.page.gate.port
    view.close()
    again = View(None, "127.0.0.1", port)
    again.close()
