"""Paper to draw on with lengths in pixels, and its PNG bytes.

Shapes are drawn at several times the resolution and then made smaller; pictures and texts lie above
them, pixel for pixel.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import cache, cached_property, partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import DARK
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

__all__ = ["BODY", "NOTE", "SMALL", "TINY", "TITLE", "Paper", "Picture", "font_file", "text_width"]

Picture: TypeAlias = NDArray[np.uint8]
"""(h, w, 3) red, green and blue."""

TITLE: Final = 23
BODY: Final = 21
SMALL: Final = 19
NOTE: Final = 17
TINY: Final = 15
"""Sizes of letters."""

_FINE: Final = 3
"""Shapes are drawn with as many times as many pixels a side."""

_DASH: Final = (5.0, 3.0)
"""Of dashed lines: the line and the gap, in widths of the line."""

_JOINED: Final = 2.5
"""Lines of at least this width have round joints."""

_SPACING: Final = 0.12
"""Room between lines of text, over their size."""

_FONT: Final = Path("mpl-data", "fonts", "ttf", "DejaVuSans.ttf")


def font_file() -> Path:
    """The font of figures, DejaVu Sans. Raises InputError where it is missing."""
    spec = importlib.util.find_spec("matplotlib")
    folders = spec.submodule_search_locations if spec else None
    path = Path(folders[0], _FONT) if folders else _FONT
    if not path.is_file():
        raise InputError(
            f"font of figures: expected {path} in the installed package matplotlib, got no such "
            "file; reinstall matplotlib from its wheel"
        )
    return path


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    from PIL import ImageFont

    return ImageFont.truetype(str(font_file()), size, layout_engine=ImageFont.Layout.BASIC)


def text_width(text: str, size: int) -> float:
    """How wide one line of text is, in pixels."""
    return float(_font(size).getlength(text))


class Paper:
    """A white sheet; x runs to the right and y downward, both from its upper left corner.

    Attributes
    ----------
    width, height: of the sheet in pixels.
    texts: what is written on it, in the order of writing.
    pictures: what is pasted on it, in the order of pasting.
    """

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = round(width), round(height)
        self.texts: list[str] = []
        self.pictures: list[Picture] = []
        self._above: list[Callable[[Image.Image], None]] = []

    @cached_property
    def _shapes(self) -> Image.Image:
        from PIL import Image

        return Image.new("RGB", (_FINE * self.width, _FINE * self.height), "white")

    @cached_property
    def _pen(self) -> ImageDraw.ImageDraw:
        from PIL import ImageDraw

        return ImageDraw.Draw(self._shapes, "RGBA")

    def polygon(self, points: ArrayLike, color: str, alpha: float = 1.0) -> None:
        """Fill a polygon (n, 2)."""
        self._pen.polygon(_flat(points), fill=_paint(color, alpha))

    def box(
        self, left: float, top: float, right: float, bottom: float, color: str, alpha: float = 1.0
    ) -> None:
        """Fill an upright rectangle; one of less than a third of a pixel is not drawn."""
        x, y = round(_FINE * left), round(_FINE * top)
        last_x, last_y = round(_FINE * right) - 1, round(_FINE * bottom) - 1
        if last_x >= x and last_y >= y:
            fill = _paint(color, alpha)
            self._pen.rectangle((x, y, last_x, last_y), fill=fill)

    def line(self, points: ArrayLike, color: str, width: float, dashed: bool = False) -> None:
        """Draw a polyline (n, 2); dashes run along it without regard to its corners."""
        path = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if len(path) < 2:
            return
        thickness = max(round(_FINE * width), 1)
        joint = "curve" if width >= _JOINED else None
        for part in _dashes(path, width) if dashed else [path]:
            self._pen.line(_flat(part), fill=color, width=thickness, joint=joint)

    def disc(
        self, center: ArrayLike, radius: float, fill: str, edge: str = "", width: float = 0.0
    ) -> None:
        """Fill a disc around a point (2,), perhaps with an edge as wide as `width`."""
        x, y = _FINE * np.asarray(center, dtype=np.float64)
        r = _FINE * radius
        outline = edge or fill
        self._pen.ellipse(
            (x - r, y - r, x + r, y + r), fill=fill, outline=outline, width=round(_FINE * width)
        )

    def ring(self, center: ArrayLike, radius: float, color: str, width: float) -> None:
        """Draw a circle around a point (2,)."""
        turns = np.linspace(0.0, 2.0 * np.pi, 361)
        circle = radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        self.line(np.asarray(center) + circle, color, width)

    def backdrop(self, picture: Picture, corner: Floats, side: float) -> None:
        """Fill the disc in a square with a picture, below shapes that follow.

        corner: (2,) upper left one of the square; side: its length.
        """
        from PIL import Image, ImageDraw

        size = round(_FINE * side)
        image = Image.fromarray(picture).resize((size, size), Image.Resampling.NEAREST)
        mask = Image.new("1", (size, size))
        ImageDraw.Draw(mask).ellipse((0, 0, size - 1, size - 1), fill=1)
        left, top = np.rint(_FINE * corner).astype(int).tolist()
        self._shapes.paste(image, (left, top), mask)

    def picture(self, picture: Picture, left: float, top: float) -> None:
        """Paste a picture, pixel for pixel."""
        self.pictures.append(picture)
        self._above.append(partial(_paste, picture, (round(left), round(top))))

    def text(
        self,
        text: str,
        place: ArrayLike,
        *,
        size: int = BODY,
        anchor: str = "mm",
        color: str = DARK,
        turned: bool = False,
        halo: bool = False,
    ) -> None:
        """Write one or more lines of text above all shapes.

        place: (2,) of its anchor; anchor: "l", "m" or "r" for its left end, middle or right end,
        then "a", "m", "s" or "d" for the top, the middle, the base or the lower border of its
        letters; turned: to read upward, about its middle; halo: with a white border.
        """
        self.texts.append(text)
        x, y = (float(value) for value in np.asarray(place, dtype=np.float64))
        write = _write_turned if turned else _write
        self._above.append(partial(write, text, (x, y), size, anchor, color, halo))

    def pixels(self) -> Picture:
        """The sheet as a picture."""
        return np.asarray(self._finished())

    def png(self) -> bytes:
        """The sheet as a PNG; the same drawing gives the same bytes."""
        buffer = BytesIO()
        # A fifth larger than by default, in a fourth of the time.
        self._finished().save(buffer, format="PNG", compress_level=1)
        return buffer.getvalue()

    def _finished(self) -> Image.Image:
        from PIL import Image

        if "_shapes" in self.__dict__:
            sheet = self._shapes.reduce(_FINE)
        else:
            sheet = Image.new("RGB", (self.width, self.height), "white")
        for draw in self._above:
            draw(sheet)
        return sheet


def _paint(color: str, alpha: float) -> tuple[int, ...]:
    from PIL import ImageColor

    return (*ImageColor.getrgb(color), round(255 * alpha))


def _flat(points: ArrayLike) -> list[float]:
    """Points as Pillow takes them; its pixels have their middles at whole numbers."""
    flat: list[float] = (_FINE * np.asarray(points, dtype=np.float64) - 0.5).ravel().tolist()
    return flat


def _dashes(path: Floats, width: float) -> list[Floats]:
    """The dashes of a polyline (n, 2)."""
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
    dash, gap = (width * part for part in _DASH)
    parts = []
    for start in np.arange(0.0, along[-1], dash + gap):
        inner = (along > start) & (along < start + dash)
        places = np.concatenate([[start], along[inner], [min(start + dash, along[-1])]])
        parts.append(np.stack([np.interp(places, along, path[:, k]) for k in (0, 1)], axis=1))
    return parts


def _paste(picture: Picture, corner: tuple[int, int], sheet: Image.Image) -> None:
    from PIL import Image

    sheet.paste(Image.fromarray(picture), corner)


_Place: TypeAlias = tuple[float, float]


def _write(
    text: str, place: _Place, size: int, anchor: str, color: str, halo: bool, sheet: Image.Image
) -> None:
    from PIL import ImageDraw

    ImageDraw.Draw(sheet).text(
        place,
        text,
        fill=color,
        font=_font(size),
        anchor=anchor,
        align="center",
        spacing=_SPACING * size,
        stroke_width=2 if halo else 0,
        stroke_fill="white" if halo else None,
    )


def _write_turned(
    text: str, place: _Place, size: int, anchor: str, color: str, halo: bool, sheet: Image.Image
) -> None:
    from PIL import Image

    flat = Image.new("L", (round(text_width(text, size)) + 4, round(1.5 * size)))
    _write(text, (flat.width / 2.0, flat.height / 2.0), size, "mm", "white", halo, flat)
    upright = flat.transpose(Image.Transpose.ROTATE_90)
    shift = {"l": 0.0, "m": 0.5, "r": 1.0}[anchor[0]] * upright.height
    left, top = round(place[0] - upright.width / 2.0), round(place[1] - upright.height + shift)
    sheet.paste(color, (left, top, left + upright.width, top + upright.height), upright)
