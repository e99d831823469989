"""Fonts by name or file, lines of text set in them, and curves as polylines.

HarfBuzz reads TrueType and OpenType files and sets the text, with kerning, ligatures and whatever
else a script needs. Lengths are in digit heights: the height of the font's digit 1.
"""

from __future__ import annotations

import difflib
import importlib.util
import math
import os
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dicedesign.errors import EngravingError, InputError, named
from dicedesign.fabricate.finish_options import BUNDLED_FONT, is_font_file
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import read_file

CHORD_TOLERANCE = 1e-3
"""Largest distance between a curve and its polyline, in digit heights."""

MOST_PIECES = 10_000
"""Largest number of segments of the polyline of a curve."""

_Point: TypeAlias = tuple[float, float]


class PolylinePen:
    """Pen for fontTools and HarfBuzz that collects contours, with curves as polylines.

    tolerance: largest distance between a curve and its polyline, above 0, in the unit of the
    points. `corners`: number of points so far.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.corners = 0
        self._contours: list[list[_Point]] = []

    def moveTo(self, point: _Point) -> None:
        """Begin a contour."""
        self._contours.append([point])
        self.corners += 1

    def lineTo(self, point: _Point) -> None:
        """Draw a line to a point."""
        self._contours[-1].append(point)
        self.corners += 1

    def curveTo(self, *points: _Point) -> None:
        """Draw a Bezier curve: control points, then its end."""
        corners = np.array([self._contours[-1][-1], *points], dtype=np.float64)
        degree = len(points)
        bends = corners[:-2] - 2.0 * corners[1:-1] + corners[2:]
        # Chords between n equal parameters leave the curve by |second derivative| / 8n^2 at most.
        turn = degree * (degree - 1) * float(np.linalg.norm(bends, axis=1).max(initial=0.0))
        pieces = min(max(1, math.ceil(math.sqrt(turn / (8.0 * self.tolerance)))), MOST_PIECES)
        t = (np.arange(1, pieces) / pieces)[:, None]
        curve = np.repeat(corners[:, None], len(t), axis=1)
        while len(curve) > 1:  # de Casteljau
            curve = (1.0 - t) * curve[:-1] + t * curve[1:]
        self._contours[-1] += map(tuple, [*curve[0].tolist(), corners[-1].tolist()])
        self.corners += pieces

    qCurveTo = curveTo

    def closePath(self) -> None:
        """Do nothing, as all contours are closed."""

    def contours(self) -> list[Floats]:
        """Contours (n, 2), n at least 3, without a repeated last point."""
        outlines = (points[: -1 if points[0] == points[-1] else None] for points in self._contours)
        # Points and lines bound nothing.
        return [np.array(points, dtype=np.float64) for points in outlines if len(points) > 2]


BUNDLED_FILE = Path("mpl-data", "fonts", "ttf", "DejaVuSans-Bold.ttf")
"""Path of the bundled font in the folder of matplotlib."""

MOST_BYTES = 1 << 26
"""Largest size of a font file: 64 MiB."""

OUTLINE_TABLES = ("glyf", "CFF ", "CFF2")

UNIT_LETTERS = "1H"
"""Letters that may define the digit height; the first one in the font does."""

LEAST_UNIT = 0.1
"""Least height of that letter, over the em."""

USUAL_UNIT = 0.7
"""Digit height of a font without such a letter, over the em."""


@dataclass(frozen=True, eq=False)
class Font:
    """Font of labels.

    Attributes
    ----------
    name: in options.
    unit: digit height in units of the font.
    """

    name: str
    unit: float
    _shaped: Any

    def line(self, text: str, spacing: float = 0.0) -> tuple[list[Floats], float]:
        """Outlines of one line of text that starts at x = 0, with a spacing after each character,
        and its advance width.

        Contours (n, 2) have no repeated last point, and any orientation.

        Raises EngravingError: the font lacks a character.
        """
        import uharfbuzz

        buffer = uharfbuzz.Buffer()
        buffer.add_str(text)
        buffer.guess_segment_properties()
        uharfbuzz.shape(self._shaped, buffer)
        contours, x, y = [], 0.0, 0.0
        for glyph, place in zip(
            buffer.glyph_infos or (), buffer.glyph_positions or (), strict=True
        ):
            if glyph.codepoint == 0:
                character = text[min(glyph.cluster, len(text) - 1)]
                raise EngravingError(
                    f"label {text!r}: expected characters of the font {self.name}, got "
                    f"{character!r} (U+{ord(character):04X}); use characters that it has, or "
                    "another font"
                )
            pen = PolylinePen(CHORD_TOLERANCE * self.unit)
            self._shaped.draw_glyph_with_pen(glyph.codepoint, pen)
            start = np.array([x + place.x_offset, y + place.y_offset])
            contours += [(contour + start) / self.unit for contour in pen.contours()]
            x, y = x + place.x_advance + spacing * self.unit, y + place.y_advance
        return contours, x / self.unit


def open_font(name: str) -> Font:
    """Open a font by the name of its family or the path of its file.

    name: "DejaVu Sans Bold", the bundled one; a family of the system or matplotlib, for its bold
        face if it has one; or a file that ends with .ttf, .otf or .ttc, for its first face.

    Raises InputError if there is no such font, or the file is no font.
    """
    with named("engrave.font"):
        if is_font_file(name):
            path = Path(name)
        else:
            path = _bundled_font() if name == BUNDLED_FONT else _find_installed(name)
        try:
            status = os.stat(path)
            stamp = (status.st_mtime_ns, status.st_size)
        except (OSError, ValueError):
            stamp = (0, 0)  # reading it tells the reason
        return _read(name, path, stamp)


@cache
def _bundled_font() -> Path:
    spec = importlib.util.find_spec("matplotlib")
    folders = spec.submodule_search_locations if spec else None
    return Path(folders[0], BUNDLED_FILE) if folders else BUNDLED_FILE


@cache
def _find_installed(family: str) -> Path:
    """File of the bold face of an installed family."""
    # This import lists all fonts of the system.
    from matplotlib import font_manager

    # Generic names such as "serif" would depend on settings of matplotlib.
    known = {entry.name.lower(): entry.name for entry in font_manager.fontManager.ttflist}
    if family.lower() not in known:
        close = difflib.get_close_matches(family.lower(), list(known), n=3, cutoff=0.5)
        like = f", such as {', '.join(known[name] for name in close)}" if close else ""
        raise InputError(
            f"expected the family of an installed font{like}, or the path of a .ttf "
            f"or .otf file, got {family!r}; install it or name another, such as {BUNDLED_FONT!r}"
        )
    wanted = font_manager.FontProperties(family=[known[family.lower()]], weight="bold")
    return Path(font_manager.findfont(wanted, fallback_to_default=False))


@lru_cache(maxsize=8)
def _read(name: str, path: Path, stamp: tuple[int, int]) -> Font:
    """Read a font file; stamp: of the file, changed by each write."""
    import uharfbuzz

    data = read_file(path, "a TTF or OTF font", most=MOST_BYTES)
    face = uharfbuzz.Face(uharfbuzz.Blob(data), 0)
    outlines = any(len(face.reference_table(tag)) > 0 for tag in OUTLINE_TABLES)
    if face.glyph_count == 0 or face.upem == 0 or not outlines:
        raise InputError(
            f"{path}: expected a TTF or OTF font with outlines, got a file of {len(data)} bytes "
            "with none that can be read; convert it, or name another font"
        )
    font, height = uharfbuzz.Font(face), USUAL_UNIT * face.upem
    for letter in UNIT_LETTERS:
        glyph = font.get_nominal_glyph(ord(letter))
        extents = font.get_glyph_extents(glyph) if glyph else None
        if extents is not None and extents.y_bearing >= LEAST_UNIT * face.upem:
            height = float(extents.y_bearing)
            break
    return Font(name, height, font)
