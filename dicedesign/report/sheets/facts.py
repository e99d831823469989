"""What a data sheet says about a die."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.fabricate.printers import MATERIALS, PRINTERS
from dicedesign.geometry.solid import solid_properties
from dicedesign.report.pages.throwing import throwing_advice

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.results.result import Result

__all__ = ["SheetFacts", "sheet_facts"]

_PRINT: Final = (
    "In millimetres, of {material}, {filled}. Let it cool, and remove supports without rounding "
    "what it rests on."
)
_INLAID: Final = "one material in two colors, the inlay in the second"


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
    yield _PRINT.format(
        material=_INLAID if is_inlaid else "one material",
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
