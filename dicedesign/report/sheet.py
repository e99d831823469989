"""Figures for papers and pages: sheets of paper to draw on with matplotlib, their style, and their
files.

This module is imported only by modules that draw, as importing matplotlib takes half a second.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache, wraps
from io import BytesIO
from typing import Any, ParamSpec, TypeVar

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.textpath import text_to_path
from numpy.typing import ArrayLike

from dicedesign.palette import DARK, GRID
from dicedesign.report.paper import DPI, GAP, PAGE_WIDTH, POINTS, REPORT_DPI
from dicedesign.report.raster import Picture, trim

BODY = 8.0
"""Font size of titles, axes and labels, in points."""

NOTE = 7.0
"""Font size of ticks, legends, values and remarks, in points."""

LINE = 1.3
"""Height of a line of text, over its font size."""

LEGEND_LINE = 11.5
"""Height of a row of a legend, in points."""

LEGEND_HANDLE = 24.0
"""Width of the mark of an entry of a legend and the space around it, in points."""

MIN_CELL = 70.0
"""Smallest width of a picture in a grid, in points."""

TICKS = {"color": DARK, "labelsize": NOTE, "major.size": 2.5, "major.width": 0.7}

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
    "axes.labelpad": 3.0,
    "axes.labelsize": BODY,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlepad": 5.0,
    "axes.titlesize": BODY,
    "axes.formatter.limits": (-5, 6),
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "hatch.linewidth": 0.5,
    "image.composite_image": False,
    "legend.borderaxespad": 0.0,
    "legend.borderpad": 0.0,
    "legend.columnspacing": 1.2,
    "legend.fontsize": NOTE,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.handletextpad": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "patch.linewidth": 0.5,
    # Text stays text, and equal figures have equal files.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "dicedesign",
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in TICKS.items()},
}

METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
    "png": {"Software": None},
}
"""Entries of files that would differ between equal figures, by format."""

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


@with_style
def figure_bytes(figure: Figure, ending: str, dpi: int = DPI) -> bytes:
    """Content of a file of a figure, deterministic.

    figure: any of matplotlib; ending: ".pdf", ".svg" or ".png" in any case; dpi: pixels per inch of
    a PNG file and of pictures.
    """
    kind = ending.lower().removeprefix(".")
    options: dict[str, Any] = {"metadata": METADATA[kind]}
    if kind == "png":
        # The file is a fifth larger than by default, and written in a fourth of the time.
        options["pil_kwargs"] = {"compress_level": 1}
    buffer = BytesIO()
    figure.savefig(buffer, format=kind, dpi=dpi, **options)
    return buffer.getvalue()


class Sheet(Figure):
    """White sheet, a figure of matplotlib, on which lengths are points of 1/72 inch; x runs to the
    right and y downward, both from the upper left corner.

    Attributes
    ----------
    width, height: size in points.
    """

    def __init__(self, width: float, height: float) -> None:
        # Whole pixels, so that pictures can be drawn pixel for pixel.
        inches = [math.ceil(side * DPI / POINTS - 1e-6) / DPI for side in (width, height)]
        super().__init__((inches[0], inches[1]), dpi=DPI, facecolor="white")
        self.width, self.height = POINTS * inches[0], POINTS * inches[1]
        FigureCanvasAgg(self)

    @with_style
    def savefig(self, *args: Any, **kwargs: Any) -> None:
        """Write a file as matplotlib does, with text as text."""
        super().savefig(*args, **kwargs)

    def _repr_png_(self) -> bytes:
        """PNG for notebooks."""
        return figure_bytes(self, ".png", REPORT_DPI)

    def rectangle(self, left: float, top: float, right: float, bottom: float) -> Axes:
        """Add axes that fill a rectangle."""
        box = np.array([left, self.height - bottom, right - left, bottom - top])
        return self.add_axes(tuple(box / ([self.width, self.height] * 2)))

    def charts(self, rows: int = 1, columns: int = 1, *, bottom: float | None = None) -> list[Axes]:
        """Add axes in rows and columns, with room for their texts, from the top of the sheet to
        `bottom` or its lower end."""
        part = 1.0 if bottom is None else bottom / self.height
        pad, rectangle = 4.0 / POINTS, (0.0, 1.0 - part, 1.0, part)
        self.set_layout_engine(ConstrainedLayoutEngine(w_pad=pad, h_pad=pad, rect=rectangle))
        return list(self.subplots(rows, columns, squeeze=False).ravel())

    @cached_property
    def drawing(self) -> Axes:
        """Axes without lines over the whole sheet, whose coordinates are points."""
        axes = self.rectangle(0.0, 0.0, self.width, self.height)
        axes.set(xlim=(0.0, self.width), ylim=(self.height, 0.0), autoscale_on=False)
        axes.axis("off")
        axes.set_in_layout(False)
        return axes

    @with_style
    def write(self, text: str, place: ArrayLike, *, size: float = BODY, **style: Any) -> None:
        """Write one or more lines of text above all shapes.

        place: (2,) position of the middle of the text, or of the anchor that `ha` and `va` name;
        style: attributes of a text of matplotlib.
        """
        x, y = np.asarray(place, dtype=np.float64) / [self.width, self.height]
        style = {"ha": "center", "va": "center", "in_layout": False, **style}
        self.text(x, 1.0 - y, text, size=size, **style)

    def paste(self, picture: Picture, left: float, top: float, width: float) -> None:
        """Draw a picture (h, w, 3) of a width in points.

        A picture of `DPI` pixels per inch is drawn pixel for pixel.
        """
        # On whole pixels.
        left, top = (round(x * DPI / POINTS) * POINTS / DPI for x in (left, top))
        bottom = top + width * picture.shape[0] / picture.shape[1]
        extent = (left, left + width, bottom, top)
        self.drawing.imshow(picture, extent=extent, aspect="auto", interpolation="antialiased")

    @with_style
    def add_key(self, handles: Sequence[Artist], top: float) -> None:
        """Add a legend below a height, as high as `key_height` says."""
        columns = legend_columns(handles, self.width - 2.0 * GAP)
        place = (0.5, 1.0 - top / self.height)
        legend = self.legend(
            handles=handles, loc="upper center", bbox_to_anchor=place, ncols=columns
        )
        legend.set_in_layout(False)


def legend_columns(handles: Sequence[Artist], width: float) -> int:
    """Largest number of columns of a legend at most `width` points wide; at least 1."""
    widths = [text_width(str(handle.get_label()), NOTE) + LEGEND_HANDLE for handle in handles]
    for columns in range(len(widths), 1, -1):
        # Entries fill one column after the other.
        if sum(max(part) for part in np.array_split(widths, columns)) <= width:
            return columns
    return 1


def key_height(handles: Sequence[Artist], width: float) -> float:
    """Height of a legend on a sheet of `width` points, in points; 0 without entries."""
    return LEGEND_LINE * -(-len(handles) // legend_columns(handles, width - 2.0 * GAP))


@lru_cache(maxsize=8192)
def text_width(text: str, size: float) -> float:
    """Width of the widest line of a text, in points."""
    font = FontProperties(family="DejaVu Sans", size=size)
    return max(
        float(text_to_path.get_text_width_height_descent(line, font, ismath=False)[0])
        for line in text.split("\n")
    )


def fold(text: str, width: float, size: float) -> str:
    """Break the lines of a text between words where they are wider than `width` points."""
    lines = []
    for line in text.split("\n"):
        lines.append("")
        for word in line.split(" "):
            longer = f"{lines[-1]} {word}" if lines[-1] else word
            if lines[-1] and text_width(longer, size) > width:
                lines.append(word)
            else:
                lines[-1] = longer
    return "\n".join(lines)


def grid_columns(width: float, most: int) -> int:
    """Number of columns of a grid of pictures on a sheet of `width` inches, at most `most`."""
    return max(1, min(most, int((POINTS * width - GAP) / (MIN_CELL + GAP))))


def cell_pixels(width: float, columns: int) -> int:
    """Side in pixels of a square picture in a grid of some columns on a sheet of `width` inches.

    A sheet as wide as the report has the resolution of the report, as its pictures take the longest
    time of all figures.
    """
    dpi = REPORT_DPI if width >= PAGE_WIDTH else DPI
    return int(_cell_points(width, columns) * dpi / POINTS)


def _cell_points(width: float, columns: int) -> float:
    return (POINTS * width - GAP * (columns + 1)) / columns


@with_style
def picture_grid(
    pictures: Sequence[Picture],
    titles: Sequence[str],
    columns: int,
    width: float,
    above: float = 0.0,
    below: float = 0.0,
) -> Sheet:
    """Sheet of pictures in rows, with a title above each; a row that is not full is in the middle.

    Rows of pixels that are white in all pictures of a row are cut off above and below.

    pictures: (h, w, 3), at least one, all of one size, `cell_pixels` wide; titles: one or more
    lines for each, or an empty text; columns: number of columns, at least 1; width: in inches;
    above, below: points left free for more.
    """
    cell = _cell_points(width, columns)
    titles = [fold(title, cell, NOTE) for title in titles]
    title_room = LINE * NOTE * max(title.count("\n") + 1 if title else 0 for title in titles) + 3.0
    rows = [trim(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    heights = [cell * len(row[0]) / row[0].shape[1] for row in rows]
    sheet = Sheet(POINTS * width, sum(heights) + len(rows) * (title_room + GAP) + above + below)
    top = above + title_room
    for number, (row, height) in enumerate(zip(rows, heights, strict=True)):
        for column, picture in enumerate(row):
            left = GAP + (column + (columns - len(row)) / 2.0) * (cell + GAP)
            sheet.paste(picture, left, top, cell)
            title = titles[number * columns + column]
            sheet.write(title, (left + cell / 2.0, top - 3.0), size=NOTE, va="bottom")
        top += height + title_room + GAP
    return sheet


def picture_sheet(picture: Picture) -> Sheet:
    """Sheet that one picture (h, w, 3) fills pixel for pixel."""
    height, width = (side * POINTS / DPI for side in picture.shape[:2])
    sheet = Sheet(width, height)
    sheet.paste(picture, 0.0, 0.0, width)
    return sheet
