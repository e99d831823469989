"""Access control of the page."""

from __future__ import annotations

import asyncio
import http.client
import socket
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any
from urllib.parse import urlsplit

import pytest
import viser
from common.inline_executor import Inline
from viser._messages import ShareUrlDisconnect, ShareUrlRequest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import dicedesign as dd
from dicedesign.view.application import View
from dicedesign.view.serving import Gate, open_socket


@pytest.fixture(scope="module")
def local() -> Iterator[View]:
    """Page that only this machine can open."""
    view = View(None)
    yield view
    view.close()


@pytest.fixture(scope="module")
def public() -> Iterator[View]:
    """Page that other machines can open."""
    view = View(None, "0.0.0.0")
    yield view
    view.close()


@dataclass(frozen=True)
class Reply:
    """HTTP response."""

    status: int
    policy: str
    body: bytes


def get(view: View, path: str, **headers: str) -> Reply:
    connection = http.client.HTTPConnection("127.0.0.1", view.page.gate.port, timeout=30)
    with closing(connection):
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        policy = answer.getheader("Content-Security-Policy") or ""
        return Reply(answer.status, policy, answer.read())


def socket_opens(view: View, path: str, origin: str | None = None) -> bool:
    url = f"ws://127.0.0.1:{view.page.gate.port}{path}"
    options: Any = {"origin": origin, "subprotocols": [f"viser-v{viser.__version__}"]}
    try:
        with connect(url, **options):
            return True
    except InvalidStatus:
        return False


def test_a_local_page_needs_no_token(local: View) -> None:
    gate = local.page.gate
    assert gate.address == f"http://127.0.0.1:{gate.port}/"
    assert gate.token == ""
    answer = get(local, "/")
    assert answer.status == 200
    assert "default-src 'self'" in answer.policy
    assert b"<title>dicedesign</title>" in answer.body
    assert get(local, "/../secret").status in (403, 404)


def test_other_sites_are_refused(local: View) -> None:
    port = local.page.gate.port
    assert socket_opens(local, "/")
    assert socket_opens(local, "/", f"http://127.0.0.1:{port}")
    assert not socket_opens(local, "/", "http://evil.example")
    assert not socket_opens(local, "/", f"http://127.0.0.1:{port + 1}")
    # DNS rebinding: a foreign name that resolves to this machine.
    assert get(local, "/", Host=f"evil.example:{port}").status == 403
    assert get(local, "/", Host=f"localhost:{port}").status == 200
    for site in ("cross-site", "same-site", "none"):
        assert get(local, "/action/stand:0", **{"Sec-Fetch-Site": site}).status == 403
    for origin in (f"http://127.0.0.1:{port}.evil.example", f"http://evil-127.0.0.1:{port}"):
        assert get(local, "/", Origin=origin).status == 403
        assert not socket_opens(local, "/", origin)


def test_names_of_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other machines can resolve its name, and a loopback address is one of its own."""
    monkeypatch.setattr(socket, "gethostname", lambda: "mine.example")
    gate = Gate("127.0.0.2", 80, "")
    hosts = ["127.0.0.2", "127.0.0.2:80", "localhost:9", "[::1]:80", "mine.example", "127.0.0.3"]
    assert [gate.admits(host, None) for host in hosts] == [True] * 4 + [False] * 2


def test_browsers_cannot_publish_the_page(local: View, monkeypatch: pytest.MonkeyPatch) -> None:
    server, calls = local.page.server, list[str]()
    monkeypatch.setattr(server, "_thread_executor", Inline())
    for name in ("request_share_url", "disconnect_share_url"):
        monkeypatch.setattr(server, name, partial(calls.append, name))
    for message in (ShareUrlRequest(), ShareUrlDisconnect()):
        asyncio.run(server._websock_server._handle_incoming_message(0, message))
    assert calls == []


def test_two_hosts_are_refused(local: View) -> None:
    port = local.page.gate.port
    with closing(socket.create_connection(("127.0.0.1", port), timeout=30)) as client:
        hosts = f"Host: localhost:{port}\r\nHost: evil.example\r\n"
        client.sendall(f"GET / HTTP/1.1\r\n{hosts}\r\n".encode())
        assert client.recv(100).startswith(b"HTTP/1.1 403")


def test_a_public_page_needs_its_token(public: View) -> None:
    gate = public.page.gate
    assert len(gate.token) >= 20
    assert urlsplit(gate.address).path == f"/{gate.token}/"
    assert get(public, f"/{gate.token}/").status == 200
    for path in ("/", "/wrong/", f"/{gate.token[:-1]}/", "/index.html", "/action/stand:0"):
        assert get(public, path).status == 403
    assert socket_opens(public, f"/{gate.token}")
    assert not socket_opens(public, "/")
    assert not socket_opens(public, "/wrong")


def test_tokens_differ() -> None:
    with closing(open_socket("0.0.0.0", 0)) as first, closing(open_socket("0.0.0.0", 0)) as second:
        assert Gate.of(first).token != Gate.of(second).token


def test_a_taken_port_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(dd.InputError, match=rf"--port: .*{port}.*take another"):
            View(None, "127.0.0.1", port)


@pytest.mark.parametrize(
    ("host", "port", "option"),
    [
        ("127.0.0.1", -1, "--port"),
        ("127.0.0.1", 65536, "--port"),
        ("no.such.host.invalid", 0, "--host"),
        ("203.0.113.7", 0, "--host|--port"),
    ],
)
def test_invalid_hosts_and_ports_are_refused(host: str, port: int, option: str) -> None:
    with pytest.raises(dd.InputError, match=option):
        open_socket(host, port)


def test_a_closed_page_frees_its_port() -> None:
    view = View(None)
    port = view.page.gate.port
    view.close()
    View(None, "127.0.0.1", port).close()
