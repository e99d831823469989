"""Who may talk to the page: the socket, the token, and requests that other pages must not send."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass

from dicedesign.errors import InputError
from dicedesign.runtime.checks import check_whole

__all__ = ["Gate", "open_socket"]

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
