"""Routes of the page of dice and bodies."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from dicedesign.errors import printable
from dicedesign.fabricate.printers import PRINTERS
from dicedesign.palette import BLANK
from dicedesign.throws.tables import TABLE_NAMES
from dicedesign.view.bodies import Bodies
from dicedesign.view.dice import CANDIDATES, Shop, Stopped
from dicedesign.view.server import Gate, make_app
from dicedesign.view.sources import open_source

if TYPE_CHECKING:
    from starlette.applications import Starlette

__all__ = ["make_page"]

EXAMPLES = ("d7", "2d6", "1/2, 1/3, 1/6", "50%, 30%, 20%", "1:1:1:1:1:2", "binomial: 4")
"""Texts that the page offers."""


def make_page(path: Path | None, gate: Gate) -> Starlette:
    """Application of the page.

    path: mesh, recipe, folder of a finished die, or folder of meshes that it opens with; None for a
    new die. Raises InputError: the path cannot be used.
    """
    shop = Shop()
    source = None if path is None else open_source(path)
    bodies = Bodies(shop, source)
    first = None
    if source is not None:
        # Its errors belong on the terminal, before the page opens.
        first = bodies.open({"name": source.names[0]})
        for note in first["notes"]:
            print(f"note: {printable(note)}", file=sys.stderr)

    def start(_: Any) -> dict[str, Any]:
        return {
            "examples": EXAMPLES,
            "tables": TABLE_NAMES,
            "printers": [printer.name for printer in PRINTERS],
            "blank": BLANK,
            "bodies": bodies.names,
            "body": first,
        }

    routes: dict[str, Callable[[Any], Any]] = {
        "/start": start,
        "/target": shop.target,
        "/dice": partial(_stream_dice, shop),
        "/dress": shop.dress,
        "/printing": shop.printing,
        "/throw": shop.throw,
        "/judge": shop.judge,
        "/file": lambda query: _download(*shop.file(query)),
        "/body/open": bodies.open,
        "/body/change": bodies.change,
        "/body/thrown": bodies.probabilities,
        "/body/throw": bodies.throw,
        "/body/map": bodies.gauss_map,
        "/body/file": lambda query: _download("hull.stl", bodies.hull_file(query)),
    }
    return make_app(gate, "die.html", routes, {"/body/upload": bodies.upload})


def _download(name: str, content: bytes) -> Any:
    from starlette.responses import Response

    header = {"Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}"}
    return Response(content, media_type="application/octet-stream", headers=header)


def _stream_dice(shop: Shop, query: Mapping[str, Any]) -> Any:
    """Response of one JSON value a line, while dice are designed in a thread, which ends when the
    page closes the request."""
    from starlette.responses import StreamingResponse

    # A wrong request is refused before the response begins.
    asked = {"text": str(query["text"]), "count": int(query.get("count", CANDIDATES))}

    async def lines() -> AsyncIterator[bytes]:
        loop, news = asyncio.get_running_loop(), asyncio.Queue[dict[str, Any] | None]()
        is_stopped = threading.Event()

        def emit(value: dict[str, Any] | None) -> None:
            check()
            loop.call_soon_threadsafe(news.put_nowait, value)

        def check() -> None:
            if is_stopped.is_set():
                raise Stopped

        def run() -> None:
            with suppress(Stopped):
                try:
                    shop.find_dice(asked, emit, check)
                except Exception as error:
                    text = f"unexpected error, {type(error).__name__}: {error}"
                    print(f"dicedesign: {printable(text)}", file=sys.stderr, flush=True)
                    emit({"error": text})
                finally:
                    emit(None)

        # Not a daemon: the process must not end while it is in native code.
        threading.Thread(target=run, name="design").start()
        try:
            while (value := await news.get()) is not None:
                yield json.dumps(value).encode() + b"\n"
        finally:
            is_stopped.set()

    return StreamingResponse(lines(), media_type="application/x-ndjson")
