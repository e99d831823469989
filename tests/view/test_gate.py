"""Access control of the page."""

from __future__ import annotations

import asyncio
import http.client
import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

import pytest
import viser
import websockets.asyncio.server
from common.inline_executor import Inline
from viser._messages import ShareUrlDisconnect, ShareUrlRequest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import dicedesign as dd
from dicedesign.view.application import View
from dicedesign.view.serving import open_socket


@pytest.fixture(scope="module")
def local() -> Iterator[View]:
    view = View(None)
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


def test_the_page_is_for_this_machine(local: View) -> None:
    gate = local.page.gate
    assert gate.address == f"http://127.0.0.1:{gate.port}/"
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


def test_a_server_that_does_not_ask_the_gate_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A viser that keeps a reference of its own to `serve` would answer every site."""
    serve, started = websockets.asyncio.server.serve, list[viser.ViserServer]()
    server_type = viser.ViserServer

    def start(*arguments: Any, **options: Any) -> viser.ViserServer:
        websockets.asyncio.server.serve = serve
        started.append(server_type(*arguments, **options))
        return started[-1]

    monkeypatch.setattr(viser, "ViserServer", start)
    with pytest.raises(dd.InputError, match=r"viser .*: expected one that lets dicedesign check"):
        View(None)
    (server,) = started
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", server.get_port()), timeout=5)


def test_browsers_cannot_publish_the_page(local: View, monkeypatch: pytest.MonkeyPatch) -> None:
    server, calls = local.page.server, list[str]()
    monkeypatch.setattr(server, "_thread_executor", Inline())
    for name in ("request_share_url", "disconnect_share_url"):
        monkeypatch.setattr(server, name, partial(calls.append, name))
    # Playwright's event loop runs in this thread.
    with ThreadPoolExecutor() as threads:
        handle = server._websock_server._handle_incoming_message
        for message in (ShareUrlRequest(), ShareUrlDisconnect()):
            threads.submit(lambda m=message: asyncio.run(handle(0, m))).result()
    assert calls == []


def test_two_hosts_are_refused(local: View) -> None:
    port = local.page.gate.port
    with closing(socket.create_connection(("127.0.0.1", port), timeout=30)) as client:
        hosts = f"Host: localhost:{port}\r\nHost: evil.example\r\n"
        client.sendall(f"GET / HTTP/1.1\r\n{hosts}\r\n".encode())
        assert client.recv(100).startswith(b"HTTP/1.1 403")


def test_a_taken_port_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(dd.InputError, match=rf"--port: .*{port}.*take another"):
            View(None, port)


def test_an_invalid_port_is_refused() -> None:
    with pytest.raises(dd.InputError, match="--port"):
        open_socket(65536)


def test_a_closed_page_frees_its_port() -> None:
    view = View(None)
    port = view.page.gate.port
    view.close()
    View(None, port).close()
