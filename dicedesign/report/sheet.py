"""Sheets to draw on with matplotlib, in pixels, and the style of all figures.

This module is imported only by modules that draw, as importing matplotlib takes half a second.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache, wraps
from io import BytesIO
from typing import Any, ParamSpec, TypeVar

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from matplotlib.textpath import text_to_path
from numpy.typing import ArrayLike

from dicedesign.palette import DARK, GRID
from dicedesign.report.raster import Picture, decode_png, trim

TITLE = 23
BODY = 21
SMALL = 19
NOTE = 17
TINY = 15
"""Font sizes in pixels."""

DPI = 72
"""Pixels per inch: a pixel is a point, so that font sizes and line widths are in pixels too."""

TICKS = {"color": DARK, "labelsize": SMALL, "major.size": 7.0, "major.width": 2.0}

STYLE: dict[Any, Any] = {
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",
    "font.size": BODY,
    "text.color": DARK,
    "text.parse_math": False,
    "axes.facecolor": "white",
    "axes.axisbelow": True,
    "axes.edgecolor": DARK,
    "axes.labelcolor": DARK,
    "axes.labelpad": 10.0,
    "axes.labelsize": BODY,
    "axes.linewidth": 2.0,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlepad": 14.0,
    "axes.titlesize": TITLE,
    "axes.formatter.limits": (-5, 6),
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 1.0,
    "image.composite_image": False,
    "legend.borderaxespad": 0.0,
    "legend.borderpad": 0.0,
    "legend.columnspacing": 1.6,
    "legend.fontsize": SMALL,
    "legend.frameon": False,
    "lines.linewidth": 3.0,
    "lines.markersize": 10.0,
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in TICKS.items()},
}

P = ParamSpec("P")

R = TypeVar("R")


def with_style(draw: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function so that it draws in the style of all figures.

    Characters that the font lacks are drawn as boxes, without a warning.
    """

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> R:
        with rc_context(STYLE), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing")
            return draw(*args, **kwargs)

    return drawn


class Sheet:
    """White sheet; x runs to the right and y downward, both from the upper left corner.

    Attributes
    ----------
    width, height: size in pixels.
    grows: whether the picture is fitted to its content.
    figure: the figure of matplotlib.
    pictures: pasted pictures, in the order of pasting.
    """

    def __init__(self, width: float, height: float, *, grows: bool = False) -> None:
        self.width, self.height, self.grows = width, height, grows
        self.figure = Figure((width / DPI, height / DPI), dpi=DPI, facecolor="white")
        FigureCanvasAgg(self.figure)
        self.pictures: list[Picture] = []

    def axes(self, left: float, top: float, right: float, bottom: float) -> Axes:
        """Add axes that fill a rectangle."""
        box = np.array([left, self.height - bottom, right - left, bottom - top])
        return self.figure.add_axes(tuple(box / ([self.width, self.height] * 2)))

    @cached_property
    def drawing(self) -> Axes:
        """Axes without lines over the whole sheet, whose coordinates are pixels."""
        axes = self.axes(0.0, 0.0, self.width, self.height)
        axes.set(xlim=(0.0, self.width), ylim=(self.height, 0.0))
        axes.axis("off")
        return axes

    @with_style
    def text(self, text: str, place: ArrayLike, *, size: float = BODY, **style: Any) -> None:
        """Write one or more lines of text above all shapes.

        place: (2,) position of the middle of the text, or of the anchor that `ha` and `va` name;
        style: attributes of a text of matplotlib.
        """
        x, y = np.asarray(place, dtype=np.float64) / [self.width, self.height]
        style = {"ha": "center", "va": "center", **style}
        self.figure.text(x, 1.0 - y, text, size=size, **style)

    def picture(self, picture: Picture, left: float, top: float) -> None:
        """Paste a picture, pixel for pixel."""
        self.pictures.append(picture)
        bottom = round(self.height - top) - len(picture)
        self.figure.figimage(picture, round(left), bottom, origin="upper")

    @property
    def texts(self) -> list[str]:
        """Visible texts on the sheet, without tick labels."""
        texts = [one for one in self.figure.findobj(Text) if isinstance(one, Text)]
        return [text.get_text() for text in texts if text.get_text() and text.get_visible()]

    @with_style
    def png(self) -> bytes:
        """Content of a PNG file, deterministic."""
        buffer = BytesIO()
        options: dict[str, Any] = {"metadata": {"Software": None}}
        # The file is a fifth larger than by default, and written in a fourth of the time.
        options["pil_kwargs"] = {"compress_level": 1}
        if self.grows:
            options |= {"bbox_inches": "tight", "pad_inches": 18.0 / DPI}
        self.figure.savefig(buffer, format="png", dpi=DPI, **options)
        return buffer.getvalue()

    def pixels(self) -> Picture:
        """Picture of the sheet."""
        return decode_png(self.png())


@lru_cache(maxsize=8192)
def text_width(text: str, size: float) -> float:
    """Width of one line of text, in pixels."""
    font = FontProperties(family="DejaVu Sans", size=size)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0])


@with_style
def picture_grid(
    pictures: Sequence[Picture],
    titles: Sequence[str],
    columns: int,
    above: float = 0.0,
    below: float = 0.0,
) -> Sheet:
    """Sheet of pictures in rows, with a title above each.

    Rows of pixels that are white in all pictures of a row are cut off above and below.

    pictures: (h, w, 3), at least one, all of one size; titles: one or more lines for each, or an
    empty text; columns: number of columns, at least 1; above, below: pixels left free for more.
    """
    gap = 24.0
    title_room = 17.0 + 25.0 * max(title.count("\n") + 1 for title in titles)
    width = pictures[0].shape[1]
    rows = [trim(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    tall = sum(len(row[0]) + gap + title_room for row in rows) + gap
    sheet = Sheet(columns * (width + gap) + gap, tall + above + below)
    top = above + gap + title_room
    for number, row in enumerate(rows):
        for column, picture in enumerate(row):
            left = gap + column * (width + gap)
            sheet.picture(picture, left, top)
            title = titles[number * columns + column]
            sheet.text(title, (left + width / 2.0, top - 7.0), va="bottom")
        top += len(row[0]) + title_room + gap
    return sheet
