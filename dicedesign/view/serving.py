"""The server of the page: its socket, who may open it, and what it adds to viser's own client."""

from __future__ import annotations

import gzip
import hmac
import ipaddress
import logging
import secrets
import socket
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote

from dicedesign.errors import InputError, check_whole, missing_extra
from dicedesign.report.palette import ACCENT, DARK, FAINT, GRID, PALE

if TYPE_CHECKING:
    import viser


LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})
"""Hosts by which a page on this machine is called by itself."""


@dataclass(frozen=True)
class Gate:
    """What a request has to show.

    Attributes
    ----------
    host, port: that the page is served at.
    token: the first part of every path, or "" on this machine alone.
    """

    host: str
    port: int
    token: str

    @classmethod
    def of(cls, listening: socket.socket) -> Gate:
        """The gate of a socket: with a token, made anew, where other machines can reach it."""
        host, port = listening.getsockname()[:2]
        alone = ipaddress.ip_address(host).is_loopback
        return cls(host, port, "" if alone else secrets.token_urlsafe(16))

    @property
    def address(self) -> str:
        """What to open in a browser of another machine, if others may; else of this one."""
        anywhere = ipaddress.ip_address(self.host).is_unspecified
        return self._address(socket.gethostname() if anywhere else self.host)

    @property
    def address_here(self) -> str:
        """What to open in a browser of this machine."""
        anywhere = ipaddress.ip_address(self.host).is_unspecified
        return self._address("localhost" if anywhere else self.host)

    def _address(self, host: str) -> str:
        name = f"[{host}]" if ":" in host else host
        return f"http://{name}:{self.port}/" + (f"{self.token}/" if self.token else "")

    def path_within(self, path: str) -> str | None:
        """The path of a request without its token; None where it has not this one."""
        if not self.token:
            return path
        given, _, rest = path.partition("?")[0].lstrip("/").partition("/")
        # As long for a wrong token as for a right one.
        return f"/{rest}" if hmac.compare_digest(given.encode(), self.token.encode()) else None

    def admits(self, host: str | None, origin: str | None) -> bool:
        """Whether a request is of this page: its `Host` is a name of this machine where there is no
        token, and its `Origin`, where a browser sends one, is that host. A page of another site can
        open sockets to this machine; it cannot choose these."""
        if host is None:
            return False
        if not self.token and _name_of(host) not in LOOPBACK_NAMES and _name_of(host) != self.host:
            return False
        return origin is None or origin.partition("://")[2] == host


def _name_of(host: str) -> str:
    """A host without its port."""
    name, colon, port = host.rpartition(":")
    return name if colon and port.isdigit() else host


def open_socket(host: str, port: int) -> socket.socket:
    """A socket that listens for a page. port: 0 for any that is free.

    Raises InputError: the port is taken or may not be had, or this machine has no such host.
    """
    check_whole("--port", port, least=0, most=65535)
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            host or "127.0.0.1", port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"--host: expected a name or an address of this machine, got {host!r}; leave it out "
            "for this machine alone, or take 0.0.0.0 for all that can reach it"
        ) from error
    listening = socket.socket(family, kind, protocol)
    try:
        # A port that was left a moment ago is free.
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(place)
        listening.listen()
    except OSError as error:
        listening.close()
        raise InputError(
            f"--port: expected one that is free on {host}, got {port} ({error.strerror}); take "
            "another, or --port 0 for any"
        ) from error
    return listening


TITLE: Final = "dicedesign"

ACTION: Final = "data-action"
"""Attribute of HTML elements: a word without spaces that the server is told when they are
clicked."""

POLICY: Final = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob: ws: wss:; "
    "connect-src 'self' data: blob: ws: wss:; frame-ancestors 'none'"
)
"""Content-Security-Policy: nothing comes from elsewhere."""

_SCRIPT: Final = """
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

_STYLE: Final = f"""
.dd {{ color: {DARK}; font-size: 13px; line-height: 1.35; padding: 2px 12px 6px; }}
.dd h3 {{ font-size: 13px; margin: 6px 0 2px; }}
.dd p {{ margin: 2px 0; }}
.dd .note {{ color: {FAINT}; }}
.dd .wrong {{ color: #9b2226; font-weight: 600; }}
.dd table {{ border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }}
.dd th {{ color: {FAINT}; font-weight: 400; text-align: right; padding: 1px 3px; }}
.dd td {{ padding: 1px 3px; text-align: right; white-space: nowrap; }}
.dd td:first-child, .dd th:first-child {{ text-align: left; }}
.dd td.bar {{ width: 45%; }}
.dd .track {{ background: {GRID}; height: 11px; position: relative; border-radius: 2px; }}
.dd .fill {{ height: 100%; border-radius: 2px; }}
.dd .thrown {{ height: 5px; border-radius: 2px; background: {ACCENT}; margin-top: 1px; }}
.dd .wanted {{ position: absolute; top: -2px; height: 15px; width: 2px; background: {DARK}; }}
.dd [{ACTION}] {{ cursor: pointer; }}
.dd tr[{ACTION}]:hover, .dd tr[{ACTION}]:focus {{ background: {PALE}44; outline: none; }}
.dd tr.chosen {{ background: {PALE}66; }}
"""

HEAD: Final = (
    f'<meta name="referrer" content="no-referrer"><title>{TITLE}</title>'
    f"<script>{_SCRIPT}</script><style>{_STYLE}</style>"
)
"""Goes to the front of the page's head."""


_ACTION: Final = "/action/"

OnAction = Callable[[str], None]
"""Is told the word of what was clicked, in the thread that serves; it may not wait."""


def require_viser() -> None:
    """Raise InputError where the extra "view" is not installed."""
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise missing_extra("view", "view", error) from error


def start_server(listening: socket.socket, gate: Gate, on_action: OnAction) -> viser.ViserServer:
    """Serve at a socket what the gate lets in. Raises InputError: viser is not installed."""
    require_viser()
    import rich
    import viser
    from viser import _messages
    from websockets.asyncio import server as websockets

    # What viser prints is nothing for stdout, which is for data; nor are requests that are refused,
    # or a browser that goes away, anything to write of.
    rich.get_console().quiet = True
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL + 1)
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
    serve = websockets.serve

    def guarded(handler: Any, host: Any, port: Any, *, process_request: Any, **options: Any) -> Any:
        answer = _Answer(gate, process_request, on_action)
        return serve(handler, sock=listening, process_request=answer, **options)

    websockets.serve = guarded  # type: ignore[assignment, misc]
    try:
        served = viser.ViserServer(gate.host, gate.port, verbose=False)
    finally:
        websockets.serve = serve  # type: ignore[misc]
    # A link through a machine of somebody else's is nobody's to ask for.
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        served._websock_server.unregister_handler(message)
    return served


def stop_server(served: viser.ViserServer) -> None:
    """Close every connection and the socket."""
    served.stop()


class _Answer:
    """Answers requests as viser does, to those who may ask."""

    def __init__(self, gate: Gate, answer: Any, on_action: OnAction) -> None:
        self._gate = gate
        self._answer = answer
        self._on_action = on_action
        self._page: dict[bool, bytes] = {}

    def __call__(self, connection: Any, request: Any) -> Any:
        """A response of `websockets`, or None for a socket that may be opened."""
        headers = request.headers
        path = self._gate.path_within(request.path)
        if path is None or not self._gate.admits(headers.get("Host"), headers.get("Origin")):
            return connection.respond(
                403, "This page opens at the whole address that dicedesign printed.\n"
            )
        if headers.get("Upgrade", "").lower() == "websocket":
            return None
        path = path.partition("?")[0]
        if path.startswith(_ACTION):
            return self._told(connection, headers, unquote(path.removeprefix(_ACTION)))
        request.path = path
        return self._with_head(self._answer(connection, request), path, headers)

    def _told(self, connection: Any, headers: Any, word: str) -> Any:
        # Only scripts of this very page may act; older browsers do not say where they are.
        if headers.get("Sec-Fetch-Site", "same-origin") != "same-origin":
            return connection.respond(403, "Only the page itself may do this.\n")
        self._on_action(word)
        return connection.respond(200, "")

    def _with_head(self, response: Any, path: str, headers: Any) -> Any:
        if path.strip("/") not in ("", "index.html") or response.status_code != 200:
            return response
        zipped = "gzip" in headers.get("Accept-Encoding", "")
        if zipped not in self._page:
            body = gzip.decompress(response.body) if zipped else response.body
            whole = body.replace(b"<head>", b"<head>" + HEAD.encode(), 1)
            self._page[zipped] = gzip.compress(whole) if zipped else whole
        response.body = self._page[zipped]
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))
        response.headers["Content-Security-Policy"] = POLICY
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Cache-Control"] = "no-store"
        return response
