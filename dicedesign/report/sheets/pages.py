"""A page to print, drawn once as a PNG and once as a PDF with letters and lines of its own.

Lengths are in pixels of the PNG, `DPI` of which are an inch; y runs downward.
"""

from __future__ import annotations

from io import BytesIO
from typing import Final, Protocol

import numpy as np

from dicedesign.report.charts.palette import DARK
from dicedesign.report.charts.paper import Paper, Picture, font_file

__all__ = ["DPI", "FINE", "HEIGHT", "WIDTH", "Page", "PdfPage", "PngPage"]

DPI: Final = 150

WIDTH: Final = 1240

HEIGHT: Final = 1754
"""A4, 210 mm by 297 mm."""

FINE: Final = 2
"""Pictures have as many times as many pixels a side."""

_POINT: Final = 72.0 / DPI
"""A pixel in points."""

_FONT: Final = "DejaVuSans"


class Page(Protocol):
    """A page of `WIDTH` by `HEIGHT`."""

    def box(self, left: float, top: float, right: float, bottom: float, color: str) -> None:
        """Fill an upright rectangle with a colour "#rrggbb"."""

    def text(
        self,
        text: str,
        left: float,
        base: float,
        *,
        size: int,
        anchor: str = "l",
        color: str = DARK,
    ) -> None:
        """Write a line of text. `base`: of its letters; anchor: "l", "m" or "r" for what `left`
        is: its left end, middle or right end."""

    def picture(self, picture: Picture, left: float, top: float) -> None:
        """Put a picture down, `FINE` of whose pixels are one of the page."""


class PngPage:
    """The page as a PNG."""

    def __init__(self) -> None:
        self._paper = Paper(WIDTH, HEIGHT)

    def box(self, left: float, top: float, right: float, bottom: float, color: str) -> None:
        self._paper.box(left, top, right, bottom, color)

    def text(
        self,
        text: str,
        left: float,
        base: float,
        *,
        size: int,
        anchor: str = "l",
        color: str = DARK,
    ) -> None:
        self._paper.text(text, (left, base), size=size, anchor=f"{anchor}s", color=color)

    def picture(self, picture: Picture, left: float, top: float) -> None:
        height, width = (length // FINE for length in picture.shape[:2])
        fine = picture[: FINE * height, : FINE * width].astype(np.float64)
        coarse = fine.reshape(height, FINE, width, FINE, 3).mean(axis=(1, 3))
        self._paper.picture(np.rint(coarse).astype(np.uint8), left, top)

    def content(self) -> bytes:
        """Of the file; the same drawing gives the same bytes."""
        return self._paper.png()


class PdfPage:
    """The page as a PDF."""

    def __init__(self, title: str) -> None:
        from reportlab.pdfbase.pdfmetrics import registerFont
        from reportlab.pdfbase.ttfonts import TTFont
        from reportlab.pdfgen.canvas import Canvas

        registerFont(TTFont(_FONT, str(font_file())))
        self._file = BytesIO()
        size = (WIDTH * _POINT, HEIGHT * _POINT)
        self._canvas = Canvas(
            self._file, pagesize=size, invariant=1, pageCompression=1, initialFontName=_FONT
        )
        self._canvas.setTitle(title)
        self._canvas.setCreator("dicedesign")

    def box(self, left: float, top: float, right: float, bottom: float, color: str) -> None:
        self._canvas.setFillColor(color)
        x, y = left * _POINT, (HEIGHT - bottom) * _POINT
        self._canvas.rect(x, y, (right - left) * _POINT, (bottom - top) * _POINT, stroke=0, fill=1)

    def text(
        self,
        text: str,
        left: float,
        base: float,
        *,
        size: int,
        anchor: str = "l",
        color: str = DARK,
    ) -> None:
        self._canvas.setFillColor(color)
        self._canvas.setFont(_FONT, size * _POINT)
        write = {
            "l": self._canvas.drawString,
            "m": self._canvas.drawCentredString,
            "r": self._canvas.drawRightString,
        }[anchor]
        write(left * _POINT, (HEIGHT - base) * _POINT, text)

    def picture(self, picture: Picture, left: float, top: float) -> None:
        from PIL import Image
        from reportlab.lib.utils import ImageReader

        height, width = (length / FINE * _POINT for length in picture.shape[:2])
        reader = ImageReader(Image.fromarray(picture))
        self._canvas.drawImage(
            reader, left * _POINT, (HEIGHT - top) * _POINT - height, width, height
        )

    def content(self) -> bytes:
        """Of the file; the same drawing gives the same bytes."""
        self._canvas.save()
        return self._file.getvalue()
