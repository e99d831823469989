"""Viser's server behind a gate, silent on stdout, with a page of our own around its client."""

from __future__ import annotations

import gzip
import logging
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote

from dicedesign.errors import missing_extra
from dicedesign.view.serving.gate import Gate
from dicedesign.view.serving.head import HEAD, POLICY

if TYPE_CHECKING:
    import viser

__all__ = ["require_viser", "start_server", "stop_server"]

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
