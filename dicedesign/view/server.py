"""Pages for this machine or its local network: socket, access control, headers and serving."""

from __future__ import annotations

import os
import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from dicedesign.errors import DiceError, InputError, check_whole, missing_extra, printable

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.types import ASGIApp, Receive, Scope, Send

__all__ = ["Gate", "make_app", "open_socket", "serve"]

LOOPBACK = "127.0.0.1"

ANYWHERE = "0.0.0.0"
"""Address of a socket for all networks of this machine."""

ELSEWHERE = "192.0.2.1"
"""Address outside any local network. Source: RFC 5737, which reserves it for documentation."""

LOOPBACK_NAMES = frozenset({"localhost", LOOPBACK})
"""Host names of this machine in its own requests."""

STATIC = Path(__file__).parent / "static"
"""Folder of the pages, their styles and their scripts."""

KEY_BYTES = 9
"""Random bytes of the secret in the address; 12 characters, as they are typed on a phone."""

MAX_BODY_BYTES = 256 * 2**20
"""Largest body of a request; meshes are sent whole."""

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
"""Headers of every response: a page loads nothing from other sites and is not shown in theirs."""


@dataclass(frozen=True)
class Gate:
    """Access control of a page.

    Attributes
    ----------
    port: of the socket.
    host: this machine's address in the URL of the page; its own names are admitted too.
    key: secret first part of all paths, or "" without one.
    """

    port: int
    host: str = LOOPBACK
    key: str = ""

    @property
    def root(self) -> str:
        """Beginning of all paths, without a slash at the end."""
        return f"/{self.key}" if self.key else ""

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{self.host}:{self.port}{self.root}/"

    def admits(self, headers: Mapping[bytes, list[bytes]]) -> bool:
        """Whether the headers `host` and `origin` of a request are those of this page.

        The host is `host` or this machine. The origin, which is optional, is the host. Pages of
        other sites can connect to this machine, but cannot choose these headers.
        """
        hosts, origins = headers.get(b"host", []), headers.get(b"origin", [])
        if len(hosts) != 1 or len(origins) > 1:
            return False
        host = hosts[0].decode("latin-1")
        name, colon, port = host.rpartition(":")
        name = name if colon and port.isdigit() else host
        origin = origins[0].decode("latin-1").partition("://")[2] if origins else host
        return name in LOOPBACK_NAMES | {self.host} and origin == host


class _Guard:
    """Middleware: requests that the gate refuses get 403; all responses get `HEADERS`."""

    def __init__(self, app: ASGIApp, gate: Gate) -> None:
        self._app, self._gate = app, gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        from starlette.responses import PlainTextResponse

        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                added = [(key.lower().encode(), text.encode()) for key, text in HEADERS.items()]
                message["headers"] = [*message["headers"], *added]
            await send(message)

        app = self._app
        if scope["type"] == "http":
            headers = dict[bytes, list[bytes]]()
            for key, value in scope["headers"]:
                headers.setdefault(key, []).append(value)
            length = headers.get(b"content-length", [b"0"])[0]
            if not self._gate.admits(headers):
                app = PlainTextResponse("Open the address that dicedesign printed.\n", 403)
            elif int(length) > MAX_BODY_BYTES:
                app = PlainTextResponse("The file is too large.\n", 413)
        await app(scope, receive, send_with_headers)


def make_app(
    gate: Gate,
    page: str,
    routes: Mapping[str, Callable[[Any], Any]],
    uploads: Mapping[str, Callable[[Any, bytes], Any]] = MappingProxyType({}),
) -> Starlette:
    """Application of a page.

    Parameters
    ----------
    gate: access control.
    page: file name of the page in `STATIC`, which is "/" after the gate's key.
    routes: functions by the path to which the page posts; each receives the JSON value of the
        request, runs in a thread of its own, and returns a JSON value or a response of Starlette.
        A `DiceError` becomes {"error": its text} with status 422.
    uploads: the same for files; each receives the parameters of the address, and the file.
    """
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.middleware import Middleware
    from starlette.responses import FileResponse, JSONResponse, Response
    from starlette.routing import Mount, Route
    from starlette.staticfiles import StaticFiles

    def answer(act: Callable[..., Any], is_file: bool) -> Callable[[Request], Any]:
        async def respond(request: Request) -> Response:
            try:
                values = [dict(request.query_params), await request.body()]
                if not is_file:
                    values = [await request.json()]
                result = await run_in_threadpool(act, *values)
            except DiceError as error:
                return JSONResponse({"error": str(error)}, 422)
            except (KeyError, TypeError, ValueError, IndexError) as error:
                # Only a program sends such requests; the page never does.
                text = f"unexpected error, {type(error).__name__}: {error}"
                print(f"dicedesign: {printable(text)}", file=sys.stderr, flush=True)
                return JSONResponse({"error": text}, 400)
            return result if isinstance(result, Response) else JSONResponse(result)

        return respond

    root = gate.root
    posted = [(path, answer(act, False)) for path, act in routes.items()]
    posted += [(path, answer(act, True)) for path, act in uploads.items()]
    return Starlette(
        routes=[
            Route(f"{root}/", lambda _: FileResponse(STATIC / page)),
            *(Route(root + path, respond, methods=["POST"]) for path, respond in posted),
            Mount(f"{root}/static", StaticFiles(directory=STATIC)),
        ],
        middleware=[Middleware(_Guard, gate=gate)],
    )


def require_server() -> None:
    """Raise InputError if the extra "view" is not installed."""
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise missing_extra("view", "view", error) from error


def open_socket(port: int, host: str = LOOPBACK) -> socket.socket:
    """Open a listening socket, for this machine alone by default.

    port: 0 for any free port. host: address of the network interface.

    Raises InputError: the port is in use or not permitted, or the host is not this machine's.
    """
    check_whole("--port", port, least=0, most=65535)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        # A port is free as soon as its last page is closed.
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise InputError(
            f"--port: expected one that is free, got {port} ({error.strerror}); take another, or "
            "--port 0 for any"
        ) from error
    return listening


def network_address() -> str:
    """Address of this machine in its local network. Raises InputError: it is in none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # Chooses the network interface; nothing is sent.
            probe.connect((ELSEWHERE, 9))
        except OSError as error:
            raise InputError(
                f"--phone: expected a network for both devices, got none ({error.strerror}); "
                "connect this machine to the phone's network"
            ) from error
        return str(probe.getsockname()[0])


def serve(
    make: Callable[[Gate], Starlette], port: int, *, browser: bool, phone: bool = False
) -> None:
    """Serve a page, and print its address, until an interrupt.

    Parameters
    ----------
    make: returns the application for a gate. Its errors come before the page opens.
    port: 0 is any free port.
    browser: opens a browser on this machine, if it has a screen.
    phone: for all devices in the local network that have the address, which has a secret; else for
        this machine alone.

    Raises KeyboardInterrupt at the end. Raises InputError: the port cannot be used, there is no
    network for a phone, or the extra "view" is not installed.
    """
    require_server()
    host, key = LOOPBACK, ""
    if phone:
        host, key = network_address(), secrets.token_urlsafe(KEY_BYTES)
    with closing(open_socket(port, ANYWHERE if phone else LOOPBACK)) as listening:
        gate = Gate(listening.getsockname()[1], host, key)
        app = make(gate)
        print(gate.address, flush=True)
        # Without a screen, a text browser would take over the terminal.
        has_screen = sys.platform in ("darwin", "win32") or any(
            os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
        )
        if browser and has_screen:
            webbrowser.open(gate.address)
        run(app, listening)
    raise KeyboardInterrupt("the page is closed")


def run(app: Starlette, listening: socket.socket) -> None:
    """Answer requests to an application until an interrupt."""
    import uvicorn

    config = uvicorn.Config(
        app, log_level="critical", ws="none", timeout_graceful_shutdown=1, timeout_keep_alive=60
    )
    # It raises the signal again that ended it.
    with suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listening])
