"""The data sheet of a die: one page to print and keep with it, as PNG and PDF.

Lengths are in points of the page; y runs downward.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import Rectangle

from dicedesign.fabricate.printers import MATERIALS, PRINTERS
from dicedesign.geometry.triangles import solid_properties
from dicedesign.report.palette import ACCENT, DARK, FAINT, GRID
from dicedesign.report.render.pictures import Picture
from dicedesign.report.render.raster import Camera, framed
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.sheet import Sheet, styled, text_width
from dicedesign.report.throwing import throwing_advice
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.results.result import Result

PRINT: Final = (
    "In millimetres, of {material}, {filled}. Let it cool, and remove supports without rounding "
    "what it rests on."
)

INLAID: Final = "one material in two colors, the inlay in the second"

WIDTH: Final = 595.3

HEIGHT: Final = 842.0
"""A4, 210 mm by 297 mm."""

LEFT: Final = 38.0

RIGHT: Final = WIDTH - LEFT

BOTTOM: Final = HEIGHT - 58.0
"""Where text and table end."""

TEXT_WIDTH: Final = 226.0

TABLE_LEFT: Final = LEFT + TEXT_WIDTH + 24.0

SIZES: Final = (9.0, 8.0, 7.0)
"""Sizes of letters of text and table, of which the first that fits is taken."""

HEADING: Final = 12.0

LINE: Final = 1.45
"""Height of a line of text, over the size of its letters."""

GAP: Final = 11.5

VIEW: Final = (RIGHT - LEFT - 3.0 * GAP) / 4.0
"""Side of a picture."""

VIEW_PIXELS: Final = 496

CORNERS: Final = ((1, -1, 1), (1, 1, -1), (-1, 1, 1), (-1, -1, -1))
"""Of a tetrahedron: no part of a convex die is seen at a slant of more than 71 degrees from all of
them."""

LEAST_SHARE: Final = 0.2
"""Of a point that a pixel of a figure may be shown at."""


@dataclass(frozen=True)
class SheetFacts:
    """The words and numbers of a data sheet.

    Attributes
    ----------
    title, subtitle: name of the die, and what it is in a line.
    sections: heading and paragraphs of each.
    header, rows: of the table of odds, as many texts in each.
    remark: below the table.
    checksum: SHA-256 of the printed file, after its name.
    """

    title: str
    subtitle: str
    sections: Sequence[tuple[str, Sequence[str]]]
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    remark: str
    checksum: str


def sheet_facts(die: FinishedDie, file: str, sha256: str) -> SheetFacts:
    """The facts of a finished die.

    file: name of the printed one; sha256: its checksum in hexadecimal digits.
    """
    result = die.result
    header, rows = _table(result)
    return SheetFacts(
        title=result.name,
        subtitle=f"a die of {len(result.labels)} outcomes, {result.status.replace('_', ' ')}",
        sections=[
            ("How to read it", list(_reading(result))),
            ("Size", [_size(die)]),
            ("Print it", list(_printing(result))),
            *(("Tolerance", [text]) for text in _tolerance(result)),
        ],
        header=header,
        rows=rows,
        remark=_remark(result),
        checksum=f"SHA-256 of {file}: {sha256}",
    )


def _reading(result: Result) -> Iterator[str]:
    """How the die is read and thrown."""
    told = None if result.engraved is None else result.engraved.reading
    is_marked = "die" in result.files
    if told:
        yield told
    elif result.concave is not None:
        yield (
            "The outcome is the side that the die lies on. Its label is cut into the side that is "
            "up then."
            if is_marked
            else "The outcome is the side that the die lies on: compare it with the report."
        )
    else:
        yield "The outcome is the face that the die rests on."
    yield throwing_advice(result.thrown, result.prior)


def _size(die: FinishedDie) -> str:
    """Extents, volume and, where it is known, weight."""
    judged = None if die.engraved is None else die.engraved.assessment
    judged = judged or die.plain
    body, size = judged.body, judged.poses.hull.diameter
    assert body.triangles is not None
    extents = " × ".join(f"{extent:.1f}" for extent in np.ptp(body.points, axis=0))
    volume, _ = solid_properties(body.points, body.triangles)
    told = f"{extents} mm along x, y and z; {size:.1f} mm from corner to corner; "
    told += f"{volume / 1000.0:.2f} cm³"
    printed, infill = die.result.printability, die.result.infill
    if printed is not None:
        weight = printed.weight_g * (1.0 if infill is None else infill.mass)
        told += f"; {weight:.1f} g of {MATERIALS[printed.material].title}"
    return f"{told}."


def _printing(result: Result) -> Iterator[str]:
    """Settings of the printer, as far as they are known."""
    printed, infill = result.printability, result.infill
    balance = None if result.engraved is None else result.engraved.balance
    is_inlaid = balance is not None and balance.by == "fill"
    yield PRINT.format(
        material=INLAID if is_inlaid else "one material",
        filled="with 100 % infill" if infill is None else "as full as is said below",
    )
    if printed is not None:
        where = "" if printed.best.label is None else f" Put the face of {printed.best.label} down."
        spot = "nozzle" if PRINTERS[printed.printer].has_nozzle else "spots"
        yield (
            f"{printed.printer.upper()}: {spot} of {printed.spot_mm:g} mm, layers of "
            f"{printed.layer_mm:g} mm.{where}"
        )
        yield from printed.warnings
    if infill is not None:
        yield infill.advice


def _tolerance(result: Result) -> Iterator[str]:
    """How exactly it has to be printed, where it is known."""
    found = result.tolerances
    if found is not None:
        yield found.answer


def _table(result: Result) -> tuple[list[str], list[list[str]]]:
    """The odds in percent."""
    columns = [("asked for", result.target)]
    odds = result.printed_probabilities
    name = "printed file"
    if result.thrown is not None:
        simulated = result.thrown.simulated
        odds = result.thrown.momentum if simulated is None else simulated.frequencies
        name = "momentum model" if simulated is None else "thrown"
    columns.append((name, odds))
    errors = tuple(p - q for p, q in zip(odds, result.target, strict=True))
    found = result.tolerances
    header = ["outcome", *(f"{head} %" for head, _ in columns), "error %"]
    rows = [
        [" ".join(label.split()), f"{100.0 * q:.3f}", f"{100.0 * p:.3f}", _signed(100.0 * error)]
        for label, q, p, error in zip(result.labels, result.target, odds, errors, strict=True)
    ]
    if found is not None:
        header.append("± of prints %")
        for row, deviation in zip(rows, found.deviations, strict=True):
            row.append(f"{100.0 * deviation:.3f}")
    return header, rows


def _signed(value: float) -> str:
    """Three decimals with a sign, or without where all are 0."""
    return f"{value:+.3f}" if abs(value) >= 0.0005 else "0.000"


def _remark(result: Result) -> str:
    """The largest error in one line."""
    if result.thrown is not None:
        return "Odds on the table that it was designed for."
    error, elsewhere = result.max_abs_error, result.elsewhere
    engraved = result.engraved
    if engraved and engraved.max_abs_error is not None and engraved.elsewhere is not None:
        error, elsewhere = engraved.max_abs_error, engraved.elsewhere
    told = f"Largest error: {100.0 * error:.2g} %"
    return f"{told}. Other rests: {100.0 * elsewhere:.2g} %." if elsewhere > 0.0 else f"{told}."


@styled
def data_sheet(
    facts: SheetFacts,
    views: Sequence[tuple[str, Picture]],
    figures: Sequence[Picture] = (),
) -> Sheet:
    """The sheet. A table that is too long ends with how many rows are left out.

    views: four times a line and a square picture; figures: to show below these where there is room,
    at most as wide as the page.
    """
    sheet = Sheet(WIDTH, HEIGHT)
    sheet.text(facts.title, (LEFT, 53.0), size=21, anchor="ls")
    sheet.text(facts.subtitle, (LEFT, 71.0), size=9, anchor="ls", color=FAINT)
    sheet.drawing.plot([LEFT, RIGHT], [80.0, 80.0], color=ACCENT, lw=1.5, solid_capstyle="butt")
    top = 89.0
    for place, (line, picture) in enumerate(views):
        left = LEFT + place * (VIEW + GAP)
        _show(sheet, picture, left, top, VIEW)
        sheet.text(line, (left + VIEW / 2.0, top + VIEW + 7.0), size=7, anchor="ms", color=FAINT)
    top += VIEW + 19.0
    needed = max(_text_height(facts.sections, SIZES[0]), _table_height(len(facts.rows), SIZES[-1]))
    for figure in figures:
        height, width = figure.shape[:2]
        share = min((RIGHT - LEFT) / width, (BOTTOM - top - needed - GAP) / height, 0.48)
        if share >= LEAST_SHARE:
            _show(sheet, figure, (WIDTH - share * width) / 2.0, top, share * width)
            top += share * height + GAP
    _write_sections(sheet, facts.sections, top)
    _write_table(sheet, facts, top)
    foot = HEIGHT - 47.0
    sheet.drawing.plot([LEFT, RIGHT], [foot, foot], color=GRID, lw=0.5)
    sheet.text(facts.checksum, (LEFT, HEIGHT - 34.0), size=7, anchor="ls", color=FAINT)
    return sheet


def sheet_pdf(sheet: Sheet, title: str) -> bytes:
    """One page of PDF with text that can be searched; the same drawing gives the same bytes."""
    facts = {"Title": title, "Creator": "dicedesign", "Producer": None, "CreationDate": None}
    return sheet.saved("pdf", 300, metadata=facts)


def _show(sheet: Sheet, picture: Picture, left: float, top: float, width: float) -> None:
    bottom = top + width * picture.shape[0] / picture.shape[1]
    sheet.drawing.imshow(picture, extent=(left, left + width, bottom, top), aspect="auto")


def wrap(text: str, width: float, size: float) -> Iterator[str]:
    """The lines of a text of some width; words that are longer are cut."""
    line, used, space = "", 0.0, text_width(" ", size)
    for word in text.split():
        while text_width(word, size) > width:
            if line:
                yield line
            line, used = "", 0.0
            kept = len(word) - 1
            while kept > 1 and text_width(word[:kept], size) > width:
                kept -= 1
            yield word[:kept]
            word = word[kept:]
        needed = text_width(word, size)
        if line and used + space + needed > width:
            yield line
            line, used = word, needed
        else:
            line, used = (f"{line} {word}", used + space + needed) if line else (word, needed)
    if line:
        yield line


def _section_lines(
    sections: Sequence[tuple[str, Sequence[str]]], size: float
) -> Iterator[tuple[str, float, float]]:
    """Text, size, and room above each line of the text column, paragraphs in letters of a size."""
    for number, (heading, paragraphs) in enumerate(sections):
        yield heading, HEADING, LINE * HEADING + (7.0 if number else -4.0)
        for paragraph in paragraphs:
            above = 3.0
            for line in wrap(paragraph, TEXT_WIDTH, size):
                yield line, size, LINE * size + above
                above = 0.0


def _text_height(sections: Sequence[tuple[str, Sequence[str]]], size: float) -> float:
    return sum(above for *_, above in _section_lines(sections, size))


def _write_sections(
    sheet: Sheet, sections: Sequence[tuple[str, Sequence[str]]], top: float
) -> None:
    """Write the text column in letters as large as it fits; what does not ends with where it is."""
    room = BOTTOM - top
    size = next((s for s in SIZES if _text_height(sections, s) <= room), SIZES[-1])
    fits = _text_height(sections, size) <= room
    base = top
    for line, height, above in _section_lines(sections, size):
        base += above
        if not fits and base > BOTTOM - 2.0 * LINE * size:
            sheet.text("more in result.json", (LEFT, base), size=size, anchor="ls", color=FAINT)
            break
        sheet.text(line, (LEFT, base), size=height, anchor="ls")


def _table_height(rows: int, size: float) -> float:
    """Of a table with its head and the line below it."""
    return (rows + 3.0) * LINE * size


def _write_table(sheet: Sheet, facts: SheetFacts, top: float) -> None:
    room = BOTTOM - top
    size = next((s for s in SIZES if _table_height(len(facts.rows), s) <= room), SIZES[-1])
    step = LINE * size
    most = max(int(room / step) - 3, 1)
    rows = facts.rows if len(facts.rows) <= most else facts.rows[: most - 1]
    # The labels are on the left, all numbers end at the right of their columns.
    first = max(text_width(row[0], size) for row in [facts.header, *rows])
    # Each column is as wide as its widest text; what room is left is shared among them.
    columns = list(zip(*[facts.header, *rows], strict=True))[1:]
    widths = np.array([max(text_width(text, size) for text in column) for column in columns])
    space = RIGHT - TABLE_LEFT - first
    head_size = size * min(1.0, (space - 6.0 * len(widths)) / widths.sum())
    widths *= head_size / size
    ends = TABLE_LEFT + first + np.cumsum(widths + (space - widths.sum()) / len(widths))
    base = top + step - 2.0

    def write(cells: Sequence[str], size: float, color: str) -> None:
        sheet.text(cells[0], (TABLE_LEFT, base), size=size, anchor="ls", color=color)
        for text, end in zip(cells[1:], ends, strict=True):
            sheet.text(text, (end, base), size=size, anchor="rs", color=color)

    write(facts.header, head_size, FAINT)
    line = base + 0.4 * step
    sheet.drawing.plot([TABLE_LEFT, RIGHT], [line, line], color=FAINT, lw=0.5)
    base += 0.3 * step
    for number, row in enumerate(rows):
        base += step
        if number % 2:
            band = (TABLE_LEFT - 3.0, base - 0.73 * step), RIGHT - TABLE_LEFT + 6.0, step
            sheet.drawing.add_patch(Rectangle(*band, color="#f3f5f7", linewidth=0.0))
        write(row, size, DARK)
    left_out = len(facts.rows) - len(rows)
    for text in ([f"and {left_out} more: see result.json"] if left_out else []) + [facts.remark]:
        base += step
        sheet.text(text, (TABLE_LEFT, base), size=7, anchor="ls", color=FAINT)


def four_views(surface: Surface, upward: Floats) -> list[tuple[str, Picture]]:
    """A die from four sides that together show all of it, and from where the pictures are.

    A smooth surface is seen from around it, another from the corners of a tetrahedron.

    upward: (3,) direction that is up, an axis.
    """
    sides: dict[str, Floats] = {}
    if surface.smooth:
        right = np.roll(upward, 1)
        front = np.cross(right, upward)
        rise = np.radians(15.0)
        for name, turn in {"front": 30.0, "right": 120.0, "back": 210.0, "left": 300.0}.items():
            level = np.cos(np.radians(turn)) * front + np.sin(np.radians(turn)) * right
            sides[name] = np.cos(rise) * level + np.sin(rise) * upward
    else:
        for corner in CORNERS:
            sides["from ({}, {}, {})".format(*corner)] = np.array(corner, dtype=np.float64)
    cameras = [Camera(side, upward, np.zeros(3), 1.0) for side in sides.values()]
    cameras = framed(cameras, [surface.points] * len(cameras))
    pictures = [render(surface, camera, VIEW_PIXELS) for camera in cameras]
    return list(zip(sides, pictures, strict=True))
