"""Data sheet of a die: one page to print and keep with the die, as PNG and PDF.

Lengths are in points; y runs downward.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.patches import Rectangle

from dicedesign.fabricate.printers import MATERIALS, PRINTERS
from dicedesign.report.pages import throwing_advice
from dicedesign.report.palette import ACCENT, FAINT, GRID
from dicedesign.report.raster import Camera, Picture, frame_cameras, three_cameras
from dicedesign.report.renderer import RenderMesh, render
from dicedesign.report.sheet import Sheet, text_width, with_style
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.results.result import Result

WIDTH: Final = 595.3

HEIGHT: Final = 842.0
"""Height of A4, 210 mm by 297 mm."""

LEFT: Final = 38.0

RIGHT: Final = WIDTH - LEFT

BOTTOM: Final = HEIGHT - 58.0
"""Lower end of text and table."""

TEXT_WIDTH: Final = 226.0

TABLE_LEFT: Final = LEFT + TEXT_WIDTH + 24.0

SIZES: Final = (9.0, 8.0, 7.0)
"""Font sizes of text and table; the first one that fits is taken."""

LINE: Final = 1.45
"""Height of a line of text, over its font size."""

GAP: Final = 11.5

VIEW: Final = (RIGHT - LEFT - 3.0 * GAP) / 4.0
"""Side of a view."""

VIEW_PIXELS: Final = 496
"""Pixels along each side of a view."""

CORNERS: Final = ((1, -1, 1), (1, 1, -1), (-1, 1, 1), (-1, -1, -1))
"""Directions to the cameras, the corners of a tetrahedron: one of them sees each facet of a convex
die at a slant of at most 71 degrees."""

MIN_SCALES: Final = (0.08, 0.2)
"""Smallest size of a pixel of the first figure, in points, and of others; smaller ones are left
out."""

MAX_SCALE: Final = 0.48
"""Largest size of a pixel of a figure, in points."""

BASE: Final[dict[str, Any]] = {"ha": "left", "va": "baseline"}

LEAST_ROWS: Final = 31
"""Rows of the table that figures leave room for; one may count the rest."""

Sections = Sequence[tuple[str, Sequence[str]]]
"""Headings with their paragraphs."""


@dataclass(frozen=True)
class SheetFacts:
    """Texts of a data sheet.

    Attributes
    ----------
    title, subtitle: name of the die, and the verdict on it.
    sections: how to read and print it, and more.
    header, rows: table of probabilities.
    remark: line below the table.
    checksum: name of the printed file and its SHA-256.
    """

    title: str
    subtitle: str
    sections: Sections
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    remark: str
    checksum: str


def sheet_facts(die: FinishedDie, file: str, sha256: str) -> SheetFacts:
    """Texts of the data sheet of a finished die.

    file: name of the printed file; sha256: its checksum in hexadecimal digits.
    """
    result = die.result
    header, rows = _table(result)
    tolerances, engraved = result.tolerances, result.engraved
    remark = "Probabilities on the table that it was designed for."
    if result.thrown is None:
        error, elsewhere = result.max_abs_error, result.elsewhere
        if engraved and engraved.max_abs_error is not None and engraved.elsewhere is not None:
            error, elsewhere = engraved.max_abs_error, engraved.elsewhere
        remark = f"Largest error: {100.0 * error:.2g} %."
        remark += f" Other rests: {100.0 * elsewhere:.2g} %." if elsewhere > 0.0 else ""
    return SheetFacts(
        title=result.name,
        subtitle=result.message.splitlines()[0],
        sections=[
            ("How to read it", [_reading(result), throwing_advice(result.thrown, result.prior)]),
            ("Size", [_size(die)]),
            ("Print it", list(_printing(result))),
            *([] if tolerances is None else [("Tolerance", [tolerances.answer])]),
        ],
        header=header,
        rows=rows,
        remark=remark,
        checksum=f"SHA-256 of {file}: {sha256}",
    )


def _reading(result: Result) -> str:
    """Instructions to read the die."""
    if result.engraved is not None and result.engraved.reading:
        return result.engraved.reading
    if result.concave is None:
        return "The outcome is the face that the die rests on."
    if "die" in result.files:
        return (
            "The outcome is the side that the die rests on. Its label is cut into the side that is "
            "up."
        )
    return "The outcome is the side that the die rests on: compare it with the report."


def _size(die: FinishedDie) -> str:
    """Extents, volume and, if known, weight."""
    body, size = die.final.body, die.final.poses.hull.diameter
    extents = " × ".join(f"{extent:.1f}" for extent in np.ptp(body.points, axis=0))
    text = (
        f"{extents} mm along x, y and z; {size:.1f} mm from corner to corner; "
        f"{body.surface.volume / 1000.0:.2f} cm³"
    )
    printed, infill = die.result.printability, die.result.infill
    if printed is not None:
        weight = printed.weight_g * (1.0 if infill is None else infill.mass)
        text += f"; {weight:.1f} g of {MATERIALS[printed.material].title}"
    return f"{text}."


def _printing(result: Result) -> Iterator[str]:
    """Yield known settings of the printer."""
    printed, infill = result.printability, result.infill
    balance = None if result.engraved is None else result.engraved.balance
    is_inlaid = balance is not None and balance.by == "fill"
    material = (
        "one material in two colors, the inlay in the second" if is_inlaid else "one material"
    )
    filled = "with 100 % infill" if infill is None else "with the infill given below"
    yield (
        f"In millimeters, of {material}, {filled}. Let it cool, and remove supports without "
        "rounding the parts that it rests on."
    )
    if printed is not None:
        where = "" if printed.best.label is None else f" Put the face of {printed.best.label} down."
        spot = "nozzle" if PRINTERS[printed.printer].has_nozzle else "spots"
        yield (
            f"{printed.printer.upper()}: {spot} of {printed.spot_mm:g} mm, layers of "
            f"{printed.layer_mm:g} mm.{where}"
        )
        for warning in printed.warnings:
            # What to do about it concerns the next print, and the report says it.
            fault, _, _ = warning.rpartition(": ")
            yield f"{fault[0].upper()}{fault[1:]}."
    if infill is not None:
        yield infill.advice


def _table(result: Result) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of probabilities in percent."""
    probabilities, name = result.printed_probabilities, "printed file"
    if result.thrown is not None:
        simulated = result.thrown.simulated
        probabilities = result.thrown.momentum if simulated is None else simulated.frequencies
        name = "momentum model" if simulated is None else "thrown"
    columns = {
        "asked for %": [f"{100.0 * q:.3f}" for q in result.target],
        f"{name} %": [f"{100.0 * p:.3f}" for p in probabilities],
        # With a sign unless all decimals are 0.
        "error %": [
            f"{error:+.3f}" if abs(error) >= 0.0005 else "0.000"
            for error in 100.0 * np.subtract(probabilities, result.target)
        ],
    }
    if result.tolerances is not None:
        columns["± of prints %"] = [f"{100.0 * each:.3f}" for each in result.tolerances.deviations]
    labels = [" ".join(label.split()) for label in result.labels]
    rows = [list(row) for row in zip(labels, *columns.values(), strict=True)]
    return ["outcome", *columns], rows


@with_style
def data_sheet(
    facts: SheetFacts,
    views: Sequence[tuple[str, Picture]],
    figures: Sequence[Picture] = (),
) -> Sheet:
    """Data sheet; a table that is too long ends with the number of rows that are left out.

    views: four lines and square pictures; figures: pictures to add below the views if there is
    room.
    """
    sheet = Sheet(WIDTH, HEIGHT)
    sheet.text(facts.title, (LEFT, 53.0), size=21, **BASE)
    sheet.text(facts.subtitle, (LEFT, 71.0), size=9, color=FAINT, **BASE)
    _rule(sheet, 80.0, LEFT, ACCENT, 1.5)
    top = 89.0
    for place, (line, picture) in enumerate(views):
        left = LEFT + place * (VIEW + GAP)
        _show(sheet, picture, left, top, VIEW)
        middle = (left + VIEW / 2.0, top + VIEW + 7.0)
        sheet.text(line, middle, size=7, va="baseline", color=FAINT)
    top += VIEW + 19.0
    rows = min(len(facts.rows), LEAST_ROWS) + 3.0
    needed = max(_text_height(facts.sections, SIZES[0]), rows * LINE * SIZES[-1])
    for number, figure in enumerate(figures):
        height, width = figure.shape[:2]
        share = min((RIGHT - LEFT) / width, (BOTTOM - top - needed - GAP) / height, MAX_SCALE)
        if share >= MIN_SCALES[number > 0]:
            _show(sheet, figure, (WIDTH - share * width) / 2.0, top, share * width)
            top += share * height + GAP
    _write_sections(sheet, facts.sections, top)
    _write_table(sheet, facts, top)
    _rule(sheet, HEIGHT - 47.0, LEFT, GRID, 0.5)
    sheet.text(facts.checksum, (LEFT, HEIGHT - 34.0), size=7, color=FAINT, **BASE)
    return sheet


def sheet_pdf(sheet: Sheet, title: str) -> bytes:
    """Content of a PDF file of one page with searchable text, deterministic."""
    facts = {"Title": title, "Creator": "dicedesign", "Producer": None, "CreationDate": None}
    return sheet.save_as("pdf", 300, metadata=facts)


def _show(sheet: Sheet, picture: Picture, left: float, top: float, width: float) -> None:
    bottom = top + width * picture.shape[0] / picture.shape[1]
    sheet.drawing.imshow(picture, extent=(left, left + width, bottom, top), aspect="auto")


def _rule(sheet: Sheet, y: float, left: float, color: str, width: float) -> None:
    sheet.drawing.plot([left, RIGHT], [y, y], color=color, lw=width, solid_capstyle="butt")


def wrap(text: str, width: float, size: float) -> list[str]:
    """Lines of a text, none wider than `width`; longer words are broken."""
    for letters in range(int(3.0 * width / size), 1, -1):
        lines = textwrap.wrap(text, letters)
        if all(text_width(line, size) <= width for line in lines):
            return lines
    return list(text)


def _lines(sections: Sections, size: float) -> list[tuple[str, float, float]]:
    """Lines of the text column for a font size of paragraphs: text, font size, distance from the
    line before."""
    lines: list[tuple[str, float, float]] = []
    step = LINE * size
    for heading, paragraphs in sections:
        lines.append((heading, 12.0, 25.0 if lines else 13.0))
        for paragraph in paragraphs:
            first, *others = wrap(paragraph, TEXT_WIDTH, size)
            lines += [(first, size, step + 3.0), *((line, size, step) for line in others)]
    return lines


def _text_height(sections: Sections, size: float) -> float:
    return sum(below for *_, below in _lines(sections, size))


def _write_sections(sheet: Sheet, sections: Sections, top: float) -> None:
    """Write the text column in the largest font that fits; if none does, refer to result.json."""
    fitting = [size for size in SIZES if _text_height(sections, size) <= BOTTOM - top]
    size, base = (fitting or SIZES)[0 if fitting else -1], top
    for line, height, below in _lines(sections, size):
        base += below
        if not fitting and base > BOTTOM - 2.0 * LINE * size:
            sheet.text("more in result.json", (LEFT, base), size=size, color=FAINT, **BASE)
            break
        sheet.text(line, (LEFT, base), size=height, **BASE)


def _write_table(sheet: Sheet, facts: SheetFacts, top: float) -> None:
    """Write the table in the largest font that fits, and count the rows that do not fit."""
    for size in SIZES:
        most = int((BOTTOM - top) / (LINE * size)) - 3
        if len(facts.rows) <= most:
            break
    rows = facts.rows if len(facts.rows) <= most else facts.rows[: most - 1]
    step, base = LINE * size, top - 2.0
    # Labels are aligned left, numbers right; each column is as wide as its widest text, and the
    # remaining room is shared.
    columns = list(zip(facts.header, *rows, strict=True))
    first, *widths = (max(text_width(text, size) for text in column) for column in columns)
    space = RIGHT - TABLE_LEFT - first
    shrink = min(1.0, (space - 6.0 * len(widths)) / sum(widths))
    room = (space - shrink * sum(widths)) / len(widths)
    ends = TABLE_LEFT + first + np.cumsum(shrink * np.array(widths) + room)
    for number, row in enumerate([facts.header, *rows]):
        base += step if number != 1 else 1.3 * step
        style: dict[str, Any] = {"size": size}
        if number == 0:
            style = {"size": shrink * size, "color": FAINT}
            _rule(sheet, base + 0.4 * step, TABLE_LEFT, FAINT, 0.5)
        elif number % 2 == 0:
            band = (TABLE_LEFT - 3.0, base - 0.73 * step), RIGHT - TABLE_LEFT + 6.0, step
            sheet.drawing.add_patch(Rectangle(*band, color="#f3f5f7", linewidth=0.0))
        sheet.text(row[0], (TABLE_LEFT, base), **style, **BASE)
        for text, end in zip(row[1:], ends, strict=True):
            sheet.text(text, (end, base), ha="right", va="baseline", **style)
    left_out = len(facts.rows) - len(rows)
    for text in ([f"and {left_out} more: see result.json"] if left_out else []) + [facts.remark]:
        base += step
        sheet.text(text, (TABLE_LEFT, base), size=7, color=FAINT, **BASE)


def four_views(surface: RenderMesh, upward: Floats) -> list[tuple[str, Picture]]:
    """Titles and pictures of a die from four sides that together show all of it.

    The cameras are around a smooth surface, and at the corners of a tetrahedron otherwise.

    upward: (3,) direction that is upward, an axis.
    """
    titles = ["front", "right", "back", "left"]
    if surface.smooth:
        cameras = three_cameras(surface.points, upward, (30.0, 120.0, 210.0, 300.0))
    else:
        heights = ["above" if upward @ corner > 0.0 else "below" for corner in CORNERS]
        titles = [f"{side}, from {height}" for side, height in zip(titles, heights, strict=True)]
        cameras = [Camera(np.array(corner, dtype=np.float64), upward) for corner in CORNERS]
        cameras = frame_cameras(cameras, [surface.points] * len(cameras))
    pictures = [render(surface, camera, VIEW_PIXELS) for camera in cameras]
    return list(zip(titles, pictures, strict=True))
