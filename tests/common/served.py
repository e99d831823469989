"""The page of `dicedesign view`, served from a thread of the tests."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.browser import served_app
from dicedesign.view.application import make_page
from dicedesign.view.server import Gate


@dataclass(frozen=True)
class Reply:
    """HTTP response."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        """JSON value of the body."""
        return json.loads(self.body)


@dataclass(frozen=True)
class Served:
    """A page that is served. gate: access control and address."""

    gate: Gate

    def request(self, method: str, path: str, body: bytes | None = None, **headers: str) -> Reply:
        """Response to a request; underscores in header names stand for dashes."""
        connection = http.client.HTTPConnection("127.0.0.1", self.gate.port, timeout=60)
        with closing(connection):
            named = {key.replace("_", "-"): value for key, value in headers.items()}
            connection.request(method, path, body, named)
            answer = connection.getresponse()
            return Reply(answer.status, dict(answer.getheaders()), answer.read())

    def post(self, path: str, value: Any) -> Reply:
        """Response to a JSON value."""
        body = json.dumps(value).encode()
        return self.request("POST", path, body, Content_Type="application/json")


@contextmanager
def served_page(path: Path | None = None) -> Iterator[Served]:
    """Serve the page of `dicedesign view` for a path."""
    with served_app(partial(make_page, path)) as gate:
        yield Served(gate)
