"""Page on which throws of a real die are tapped as they come up, with their verdict."""

from __future__ import annotations

import base64
import io
import secrets
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import check_whole
from dicedesign.palette import outcome_colors, text_color
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.goodness_of_fit import ADVICE, RollVerdict
from dicedesign.throws.roll_log import RollLog
from dicedesign.view.server import (
    ANYWHERE,
    LOOPBACK,
    Gate,
    make_app,
    network_address,
    open_socket,
    require_server,
    serve,
)

if TYPE_CHECKING:
    from starlette.applications import Starlette

__all__ = ["RollsPage", "serve_rolls"]

FACE_PIXELS = 192
"""Side of a picture, twice its side on the page."""

FACE_COLORS = 32
"""Number of colors of a picture; more would add kilobytes."""

KEY_BYTES = 9
"""Random bytes of the secret in the address; 12 characters, as they are typed on a phone."""


class RollsPage:
    """Functions of the page. The file of throws is read before each, as several programs may write
    it."""

    def __init__(
        self,
        log: RollLog,
        probabilities: Sequence[float],
        judge: Callable[[Integers], RollVerdict],
        name: str,
        die: Result | None = None,
    ) -> None:
        """Prepare the page.

        log: throws of the die; probabilities: expected ones (k,) of its labels; judge: returns the
        verdict on counts (k,); name: heading; die: its result, whose folder has the mesh for the
        pictures, or None for a page without.
        """
        self._log, self._judge, self._die = log, judge, die
        self._lock = threading.Lock()
        colors = outcome_colors(len(log.labels))
        self._fixed = {
            "name": name,
            "file": log.path.name,
            "labels": log.labels,
            "colors": colors,
            "texts": [text_color(color) for color in colors],
            "expected": list(probabilities),
        }

    def app(self, gate: Gate) -> Starlette:
        """Application of the page."""
        routes: dict[str, Callable[[Any], Any]] = {
            "/start": lambda _: self._fixed | self._change(lambda log: None),
            "/roll": self._roll,
            "/undo": lambda _: self._change(RollLog.undo),
            "/verdict": self._verdict,
            "/pictures": lambda _: self._pictures,
        }
        return make_app(gate, "rolls.html", routes)

    def _change(self, act: Callable[[RollLog], object]) -> dict[str, Any]:
        """Counts and last throw of the file, after a change."""
        with self._lock:
            self._log.reload()
            act(self._log)
            last = self._log.throws[-1] if self._log.throws else None
            return {
                "counts": self._log.counts.tolist(),
                "last": None if last is None else self._log.labels.index(last),
            }

    def _roll(self, outcome: Any) -> dict[str, Any]:
        """Log a throw by the number of its outcome, from 0."""
        labels = self._log.labels
        check_whole("outcome", outcome, least=0, most=len(labels) - 1)
        return self._change(lambda log: log.add(labels[outcome]))

    def _verdict(self, _: Any) -> dict[str, str]:
        """Verdict on all throws: a style of the page, and a sentence."""
        counts = np.array(self._change(lambda log: None)["counts"])
        if not counts.any():
            return {"style": "info", "text": ADVICE}
        verdict = self._judge(counts)
        style = "bad" if verdict.rejected else "info" if verdict.more_to_confirm else "ok"
        return {"style": style, "text": f"{verdict.summary}."}

    @cached_property
    def _pictures(self) -> list[str | None]:
        """URLs with the pictures of the outcomes; None for an outcome that is not on the die."""
        urls = dict(_face_pictures(self._die)) if self._die is not None else {}
        return [urls.get(label) for label in self._log.labels]


def _face_pictures(die: Result) -> Iterator[tuple[str, str]]:
    """Yield outcomes with PNG pictures, as URLs, of the die from the side where each is read."""
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.report.colored_die import reading_sides
    from dicedesign.report.raster import Camera, frame_cameras
    from dicedesign.report.renderer import RenderMesh

    assert die.folder is not None
    body = read_body(die.folder / die.files.get("die", die.files["die_plain"]))
    assert body.triangles is not None
    cameras: dict[str, Camera] = {}
    for facet, side in zip(die.facets, reading_sides(die), strict=True):
        if facet.outcome is not None:
            up = np.array(facet.upright or np.eye(3)[np.argmin(np.abs(side))])
            cameras.setdefault(facet.outcome, Camera(side, up))
    surface = RenderMesh(body.points, body.triangles, smooth=die.concave is not None)
    framed = frame_cameras(list(cameras.values()), [body.points] * len(cameras))
    for outcome, camera in zip(cameras, framed, strict=True):
        url = base64.b64encode(_transparent_png(surface, camera)).decode()
        yield outcome, f"data:image/png;base64,{url}"


def _transparent_png(surface: Any, camera: Any) -> bytes:
    """PNG picture of a surface on no background."""
    from PIL import Image

    from dicedesign.report.renderer import render

    black: Floats = np.zeros((FACE_PIXELS, FACE_PIXELS))
    on_white, on_black = (
        render(surface, camera, FACE_PIXELS, backdrop=paper).astype(np.float64)
        for paper in (None, black)
    )
    opacity = 255.0 - (on_white - on_black).mean(axis=2)
    color = 255.0 * on_black / np.maximum(opacity, 1.0)[..., None]
    pixels = np.dstack([color, opacity]).clip(0.0, 255.0).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).quantize(FACE_COLORS).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def serve_rolls(page: RollsPage, port: int, *, phone: bool, browser: bool) -> None:
    """Serve the page, and print its address, until an interrupt.

    port: 0 is any free port. phone: for all devices in the local network that have the address,
    which has a secret; else for this machine alone. browser: opens a browser on this machine, if it
    has a screen.

    Raises InputError: the port cannot be used, there is no network for a phone, or the extra "view"
    is not installed.
    """
    require_server()
    host, key = LOOPBACK, ""
    if phone:
        host, key = network_address(), secrets.token_urlsafe(KEY_BYTES)
    listening = open_socket(port, ANYWHERE if phone else LOOPBACK)
    gate = Gate(listening.getsockname()[1], host, key)
    serve(page.app(gate), listening, gate.address, browser=browser)
