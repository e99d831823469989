"""Access control of the page, and requests that no page sends."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import closing

import pytest
from common.served import Served, served_page

import dicedesign as dd
from dicedesign.view import server
from dicedesign.view.server import open_socket


@pytest.fixture(scope="module")
def local() -> Iterator[Served]:
    with served_page() as served:
        yield served


def test_the_page_is_for_this_machine(local: Served) -> None:
    gate = local.gate
    assert gate.address == f"http://127.0.0.1:{gate.port}/"
    answer = local.request("GET", "/")
    assert answer.status == 200
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert b"<title>dicedesign</title>" in answer.body
    for path in ("/../secret", "/static/../server.py", "/static/%2e%2e/server.py"):
        assert local.request("GET", path).status in (403, 404)


def test_other_sites_are_refused(local: Served) -> None:
    port = local.gate.port
    # DNS rebinding: a foreign name that resolves to this machine.
    assert local.request("GET", "/", Host=f"evil.example:{port}").status == 403
    assert local.request("GET", "/", Host=f"localhost:{port}").status == 200
    for origin in (
        "http://evil.example",
        f"http://127.0.0.1:{port + 1}",
        f"http://127.0.0.1:{port}.evil.example",
        f"http://evil-127.0.0.1:{port}",
        "null",
    ):
        answer = local.request("POST", "/target", b'{"text": "d6"}', Origin=origin)
        assert answer.status == 403
    own = f"http://127.0.0.1:{port}"
    assert local.request("POST", "/target", b'{"text": "d6"}', Origin=own).status == 200


def test_doubled_headers_are_refused(local: Served) -> None:
    port = local.gate.port
    for doubled in ("Host: evil.example", "Origin: http://evil.example"):
        with closing(socket.create_connection(("127.0.0.1", port), timeout=30)) as client:
            headers = f"Host: localhost:{port}\r\nOrigin: http://localhost:{port}\r\n{doubled}\r\n"
            client.sendall(f"GET / HTTP/1.1\r\n{headers}\r\n".encode())
            assert client.recv(100).startswith((b"HTTP/1.1 403", b"HTTP/1.1 400"))


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/target", b"{"),
        ("/target", b"[]"),
        ("/target", 100_000 * b"["),
        ("/dice", b"[]"),
        ("/dice", b'{"text": "d6", "count": 1e999}'),
        ("/dress", b'{"die": "x", "dress": []}'),
        ("/body/change", b'{"state": 1e999}'),
        (f"/body/upload?name=a.{5000 * 'b'}", b"no mesh"),
        ("/target", b"{}"),
        ("/throw", b'{"die": 3, "dress": {}}'),
        ("/throw", b'{"die": "{}", "dress": {}, "count": 1, "seed": 0, "table": null}'),
        ("/dress", b'{"die": "x", "dress": {}}'),
        ("/body/change", b'{"state": "one"}'),
        ("/body/change", b'{"state": 999999}'),
        ("/body/upload?name=a.stl", b"no mesh"),
        ("/file", b'{"die": "{}", "dress": {}, "kind": "exe"}'),
    ],
)
def test_other_requests_get_an_answer(
    local: Served, path: str, body: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = local.request("POST", path, body)
    assert answer.status in (400, 422)
    assert answer.json["error"]
    assert "Traceback" not in capsys.readouterr().err


def test_long_paths_and_large_files_are_refused(local: Served) -> None:
    assert local.request("GET", f"/{'a' * 8000}").status == 404
    answer = local.request("POST", "/body/upload?name=a.stl", Content_Length=str(2**40))
    assert answer.status == 413


@pytest.mark.parametrize(("path", "size"), [("/target", 2 << 20), ("/body/upload?name=a", 5 << 20)])
def test_uploads_without_a_length_are_counted(
    local: Served, monkeypatch: pytest.MonkeyPatch, path: str, size: int
) -> None:
    monkeypatch.setattr(server, "MAX_UPLOAD_BYTES", 4 << 20)
    with closing(socket.create_connection(("127.0.0.1", local.gate.port), timeout=30)) as client:
        headers = f"Host: localhost:{local.gate.port}\r\nTransfer-Encoding: chunked"
        client.sendall(f"POST {path} HTTP/1.1\r\n{headers}\r\n\r\n{size:x}\r\n".encode())
        # The answer comes before the chunk ends.
        client.sendall(bytes(size))
        assert client.recv(100).startswith(b"HTTP/1.1 413")


def test_a_request_that_pauses_is_refused(local: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "IDLE_SECONDS", 0.1)
    with closing(socket.create_connection(("127.0.0.1", local.gate.port), timeout=30)) as client:
        headers = f"Host: localhost:{local.gate.port}\r\nContent-Length: 9"
        client.sendall(f"POST /target HTTP/1.1\r\n{headers}\r\n\r\n{{".encode())
        assert client.recv(100).startswith(b"HTTP/1.1 408")


def test_a_taken_port_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(dd.InputError, match=rf"--port: .*{port}.*take another"):
            open_socket(port)


def test_an_invalid_port_is_refused() -> None:
    with pytest.raises(dd.InputError, match="--port"):
        open_socket(65536)
