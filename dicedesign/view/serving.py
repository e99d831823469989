"""Server of the page: socket, access control, and additions to viser's client."""

from __future__ import annotations

import gzip
import http.client
import logging
import socket
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from dicedesign.errors import InputError, check_whole, missing_extra
from dicedesign.palette import ACCENT, DARK, FAINT, GRID, PALE

if TYPE_CHECKING:
    import viser


LOOPBACK = "127.0.0.1"

LOOPBACK_NAMES = frozenset({"localhost", LOOPBACK})
"""Host names of this machine in its own requests."""


@dataclass(frozen=True)
class Gate:
    """Access control of the page, which only this machine can open.

    Attributes
    ----------
    port: of the socket.
    """

    port: int

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{LOOPBACK}:{self.port}/"

    def admits(self, host: str | None, origin: str | None) -> bool:
        """Whether the headers `Host` and `Origin` of a request are those of this page.

        The host is a name of this machine. The origin, which is optional, is the host. Pages of
        other sites can connect to this machine, but cannot choose these headers.
        """
        if host is None:
            return False
        name, colon, port = host.rpartition(":")
        name = name if colon and port.isdigit() else host
        return name in LOOPBACK_NAMES and (origin is None or origin.partition("://")[2] == host)


def open_socket(port: int) -> socket.socket:
    """Open a listening socket for this machine. port: 0 for any free port.

    Raises InputError: the port is in use or not permitted.
    """
    check_whole("--port", port, least=0, most=65535)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        # A port is free as soon as its last page is closed.
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((LOOPBACK, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise InputError(
            f"--port: expected one that is free, got {port} ({error.strerror}); take another, or "
            "--port 0 for any"
        ) from error
    return listening


TITLE = "dicedesign"

ACTION = "data-action"
"""Attribute of HTML elements whose value is sent to the server on a click."""

POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob: ws: wss:; "
    "connect-src 'self' data: blob: ws: wss:; frame-ancestors 'none'"
)
"""Content-Security-Policy: the page loads nothing from other sites."""

_SCRIPT = """
{
  const later = window.setTimeout.bind(window);
  window.setTimeout = (act, wait, ...rest) => later(act, wait === 50 ? 16 : wait, ...rest);
  const tell = (event) => {
    const clicked = event.target.closest && event.target.closest('[ATTRIBUTE]');
    if (!clicked || (event.type === 'keydown' && event.key !== 'Enter')) return;
    const base = location.pathname.replace(/\\/?$/, '/');
    fetch(base + 'action/' + encodeURIComponent(clicked.getAttribute('ATTRIBUTE')));
  };
  document.addEventListener('click', tell);
  document.addEventListener('keydown', tell);
}
""".replace("ATTRIBUTE", ACTION)

_STYLE = f"""
.dd {{ color: {DARK}; font-size: 13px; line-height: 1.35; padding: 2px 12px 6px; }}
.dd h3 {{ font-size: 13px; margin: 6px 0 2px; }}
.dd p {{ margin: 2px 0; }}
.dd .note {{ color: {FAINT}; }}
.dd .wrong {{ color: #9b2226; font-weight: 600; }}
.dd .warned {{ color: #946200; font-weight: 600; }}
.dd .right {{ color: #2b6a3f; }}
.dd #candidates td:first-child {{ white-space: normal; }}
.dd table {{ border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }}
.dd th {{ color: {FAINT}; font-weight: 400; text-align: right; padding: 1px 3px; }}
.dd td {{ padding: 1px 3px; text-align: right; white-space: nowrap; }}
.dd td:first-child, .dd th:first-child {{ text-align: left; }}
.dd td.bar {{ width: 45%; }}
.dd .track {{ background: {GRID}; height: 11px; position: relative; border-radius: 2px; }}
.dd .fill {{ height: 100%; border-radius: 2px; }}
.dd .thrown {{ height: 5px; border-radius: 2px; background: {ACCENT}; margin-top: 1px; }}
.dd .target {{ position: absolute; top: -2px; height: 15px; width: 2px; background: {DARK}; }}
.dd [{ACTION}] {{ cursor: pointer; }}
.dd tr[{ACTION}]:hover, .dd tr[{ACTION}]:focus {{ background: {PALE}44; outline: none; }}
"""

HEAD = (
    f'<meta name="referrer" content="no-referrer"><title>{TITLE}</title>'
    f"<script>{_SCRIPT}</script><style>{_STYLE}</style>"
)
"""HTML at the start of the head of the page."""

_ACTION_PATH = "/action/"

OnAction = Callable[[str], None]
"""Called with the action of a click, in the thread of the server; must not block."""


def require_viser() -> None:
    """Raise InputError if the extra "view" is not installed."""
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise missing_extra("view", "view", error) from error


def start_server(listening: socket.socket, gate: Gate, on_action: OnAction) -> viser.ViserServer:
    """Serve requests at a socket if the gate admits them.

    Raises InputError if this viser does not ask the gate: then nothing is served.
    """
    import rich
    import viser
    from viser import _messages
    from websockets.asyncio import server as websockets

    # Stdout is for data, and neither refused requests nor closed browsers are worth a message.
    rich.get_console().quiet = True
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL + 1)
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
    serve = websockets.serve

    def serve_guarded(
        handler: Any, host: Any, port: Any, *, process_request: Any, **options: Any
    ) -> Any:
        respond = partial(_respond, gate, on_action, process_request)
        return serve(handler, sock=listening, process_request=respond, **options)

    websockets.serve = serve_guarded  # type: ignore[assignment, misc]
    try:
        server = viser.ViserServer(LOOPBACK, gate.port, verbose=False)
    finally:
        websockets.serve = serve  # type: ignore[misc]
    # A viser with a reference of its own to `serve` would listen without the gate.
    if server.get_port() != gate.port or not _refuses_strangers(gate.port):
        server.stop()
        listening.close()
        raise InputError(
            f"viser {viser.__version__}: expected one that lets dicedesign check requests, got one "
            "that answers other sites; pip install 'dicedesign[view]' brings a suitable version"
        )
    # Browsers must not publish the page through viser's relay.
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)
    return server


STRANGER = "stranger.invalid"
"""Host that the gate must not admit."""


def _refuses_strangers(port: int) -> bool:
    """Whether the server of a port refuses a request to the name of another machine."""
    connection = http.client.HTTPConnection(LOOPBACK, port, timeout=10.0)
    try:
        connection.request("GET", "/", headers={"Host": STRANGER})
        return connection.getresponse().status == http.client.FORBIDDEN
    except (OSError, http.client.HTTPException):
        return False
    finally:
        connection.close()


def _respond(
    gate: Gate, on_action: OnAction, viser_respond: Any, connection: Any, request: Any
) -> Any:
    """Respond to admitted requests as viser does, and to actions.

    Returns a response of `websockets`, or None to accept a WebSocket.
    """
    headers = request.headers
    path, hosts = request.path.partition("?")[0], headers.get_all("Host")
    host = hosts[0] if len(hosts) == 1 else None
    if not gate.admits(host, headers.get("Origin")):
        return connection.respond(403, "Open the address that dicedesign printed.\n")
    if headers.get("Upgrade", "").lower() == "websocket":
        return None
    if path.startswith(_ACTION_PATH):
        # Only scripts of the page may act; older browsers send no such header.
        if headers.get("Sec-Fetch-Site", "same-origin") != "same-origin":
            return connection.respond(403, "Only the page itself may do this.\n")
        on_action(unquote(path.removeprefix(_ACTION_PATH)))
        return connection.respond(200, "")
    request.path = path
    response = viser_respond(connection, request)
    if path.strip("/") not in ("", "index.html") or response.status_code != 200:
        return response
    is_zipped = "gzip" in headers.get("Accept-Encoding", "")
    body = gzip.decompress(response.body) if is_zipped else response.body
    body = body.replace(b"<head>", b"<head>" + HEAD.encode(), 1)
    response.body = gzip.compress(body) if is_zipped else body
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    response.headers["Content-Security-Policy"] = POLICY
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Cache-Control"] = "no-store"
    return response
