"""The part of a report that is about the odds of prints, in words and numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dicedesign.report.pages.html_parts import number, table_section, text_section
from dicedesign.results.result import PrintTolerances, Result

__all__ = ["print_odds_sections"]

_ERRORS: Final = {
    "dimensional_mm": ("facets", "{:g} mm in the place of each facet"),
    "shrinkage": ("shrinkage", "{:.2g} of the length along each axis of the printer"),
    "density_gradient": ("density", "{:.2g} of the density from bottom to top"),
    "bubble_mm3": ("bubble", "a bubble of {:g} mm³ anywhere"),
}
"""Heading and meaning of each error by its name."""


def print_odds_sections(result: Result) -> Iterator[str]:
    """Sections about errors of printing and about infill, where they are known."""
    if result.tolerances is not None:
        yield text_section("How well it must be printed", [result.tolerances.answer])
        yield _deviations(result, result.tolerances)
    if result.infill is not None:
        yield _infill(result)


def _deviations(result: Result, found: PrintTolerances) -> str:
    names = list(found.by_error)
    header = ["outcome", "probability", "± of prints", *(_ERRORS[name][0] for name in names)]
    odds = result.printed_probabilities
    if result.thrown is not None:
        odds = result.thrown.momentum
    columns = [odds, found.deviations, *(found.by_error[name] for name in names)]
    rows = [
        [label, *(f"{100.0 * value:.3f}" for value in values)]
        for label, *values in zip(result.labels, *columns, strict=True)
    ]
    assumed = ", ".join(_ERRORS[name][1].format(found.assumed[name]) for name in names)
    note = (
        f"Standard deviations of the odds of prints, by all errors and by each alone, of "
        f"{assumed}; to first order. Odds of such prints are off by a total variation of "
        f"{number(found.total_variation, 2)} on the mean, and {found.rolls:,} rolls notice "
        f"{100.0 * found.noticed:.1f} % of them, where of perfect dice they notice 5.0 %."
    )
    return table_section("Odds of prints (%)", header, rows, note)


def _infill(result: Result) -> str:
    found = result.infill
    assert found is not None
    solid = result.printed_probabilities
    header = ["outcome", "target", "solid", f"{100.0 * found.infill:.0f} % infill"]
    rows = [
        [label, *(f"{100.0 * value:.3f}" for value in values)]
        for label, *values in zip(
            result.labels, result.target, solid, found.probabilities, strict=True
        )
    ]
    return table_section("Odds with infill, without momentum (%)", header, rows, found.advice)
