"""Page on which throws of a real die are tapped as they come up, with their verdict."""

from __future__ import annotations

import base64
import io
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import check_whole
from dicedesign.palette import outcome_colors, text_color
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.goodness_of_fit import ADVICE, RollVerdict
from dicedesign.throws.roll_log import RollLog
from dicedesign.view.server import Gate, make_app

if TYPE_CHECKING:
    from starlette.applications import Starlette

__all__ = ["RollsPage"]

FACE_PIXELS = 192
"""Side of a picture, twice its side on the page."""

FACE_COLORS = 32
"""Number of colors of a picture; more would add kilobytes."""


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
    from PIL import Image

    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.report.colored_die import reading_sides
    from dicedesign.report.raster import Camera, frame_cameras
    from dicedesign.report.renderer import RenderMesh, render_clear

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
        picture = render_clear(surface, camera, FACE_PIXELS, np.zeros((FACE_PIXELS, FACE_PIXELS)))
        buffer = io.BytesIO()
        Image.fromarray(picture).quantize(FACE_COLORS).save(buffer, "PNG", optimize=True)
        url = base64.b64encode(buffer.getvalue()).decode()
        yield outcome, f"data:image/png;base64,{url}"
