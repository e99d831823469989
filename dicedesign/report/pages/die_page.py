"""The report of a die: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Final

from dicedesign.report.figures.figure import FIGURES
from dicedesign.report.live.live_die import LiveDie
from dicedesign.report.pages.attempts import attempt_sections
from dicedesign.report.pages.html_parts import (
    figure_section,
    list_section,
    number,
    page,
    stages_section,
    table_section,
    text_section,
)
from dicedesign.report.pages.linked import MAP, linked_sections, page_script
from dicedesign.report.pages.print_odds import print_odds_sections
from dicedesign.report.pages.printability import printability_sections
from dicedesign.report.pages.throwing import throwing_advice, throws_told
from dicedesign.results.parts import Concave
from dicedesign.results.result import Balance, Result

__all__ = ["die_page"]

_SOLID: Final = (
    "Print the STL file in millimetres with 100 % infill, so that the density is uniform: the odds "
    "hold for a solid of one material. "
)

_COOLING: Final = "Let it cool, and remove supports without rounding "

_UNLABELLED: Final = (
    "The outcome of a throw is the facet that the die rests on, i.e. the face down."
)

_READING_A_SHAPE: Final = (
    "the places that it rests on. The outcome of a throw is the side that the die lies on: compare "
    "it with the pictures at the top. "
)

_MARKED: Final = (
    " In die.stl the label of each outcome is cut into the side that is up then: read the one on "
    "top. die_plain.stl has none."
)


def die_page(result: Result, images: Mapping[str, bytes], live: LiveDie | None = None) -> str:
    """The report of any kind of die as HTML.

    Parameters
    ----------
    result: of the run.
    images: PNG or GIF bytes of figures by name, see `FIGURES`; others are left out.
    live: the die for its 3D view; None for a page that does not move.

    Returns
    -------
    str, a whole document; the same for the same arguments.
    """
    script = None if live is None else page_script(live)
    return page(result.name, list(_sections(result, images, live)), script)


def _sections(result: Result, images: Mapping[str, bytes], live: LiveDie | None) -> Iterator[str]:
    verdict = f"<strong>{escape(result.status)}</strong>: {escape(result.message)}"
    yield f'<h1>{escape(result.name)}</h1>\n<p class="verdict">{verdict}</p>'
    if result.thrown is not None:
        yield text_section("On the table", throws_told(result.thrown))
    yield from linked_sections(result, images.get(MAP), live)
    hidden = {figure.instead_of for figure in FIGURES if figure.name in images}
    for figure in FIGURES:
        if figure.name in images and figure.name not in hidden | {MAP}:
            yield figure_section(figure.title, images[figure.name], figure.caption)
    yield _odds(result)
    if result.search is not None:
        yield from attempt_sections(result, result.search)
    balance = None if result.engraved is None else result.engraved.balance
    if balance is not None:
        yield text_section("From the shape to the object", [_balance(result, balance)])
    yield from print_odds_sections(result)
    if result.concave is not None:
        yield list_section("Quality of the surface", result.concave.quality)
        yield _measures(result.concave)
    if result.printability is not None:
        yield from printability_sections(result.printability)
    if result.notes:
        yield list_section("Notes", result.notes)
    if result.stages:
        yield stages_section(result.stages, result.peak_since)
    if result.design.energy is not None:
        terms = [[term, number(value, 4)] for term, value in result.design.energy.items()]
        yield table_section("Energy", ["term", "value"], terms)
    yield list_section("Files", [f"{kind}: {name}" for kind, name in result.files.items()])
    yield text_section("How to print and read the die", [_instructions(result)])


def _odds(result: Result) -> str:
    """Every kind of odds that is known."""
    thrown = result.thrown
    achieved = "achieved" if thrown is None else "without momentum"
    columns = [["target", *_percent(result.target, None)]]
    kinds: list[tuple[str, Sequence[float] | None, float | None]] = []
    if result.concave is not None:
        before = result.concave
        kinds.append(("before", before.probabilities_before, before.elsewhere_before))
    kinds.append((achieved, result.probabilities, result.elsewhere))
    if thrown is None:
        kinds.append(("only engraved", _unbalanced(result), None))
    if result.engraved is not None:
        kinds.append(("as printed", result.engraved.probabilities, result.engraved.elsewhere))
    for name, odds, elsewhere in kinds:
        if odds is not None:
            columns.append([name, *_percent(odds, elsewhere)])
    if thrown is not None:
        columns.append(["momentum model", *_percent(thrown.momentum, None)])
        if thrown.simulated is not None:
            limits = [
                f"{100.0 * low:.2f} to {100.0 * high:.2f}"
                for low, high in thrown.simulated.intervals
            ]
            columns.append(["simulated throws", *_percent(thrown.simulated.frequencies, None)])
            columns.append(["95 % interval", *limits, "-"])
    columns.append(["rests", *map(str, result.rest_counts), "-"])
    header, *rows = zip(["outcome", *result.labels, "elsewhere"], *columns, strict=True)
    note = (
        f"Largest difference from the target {'as ' if thrown is None else ''}{achieved}: "
        f"{number(result.max_abs_error, 3)}. Rests on facets that lie almost in one plane count as "
        "one outcome; elsewhere are all that belong to none."
    )
    return table_section("Odds in numbers (%)", header, rows, note)


def _unbalanced(result: Result) -> Sequence[float] | None:
    """Odds of the engraved die before its shape was moved; None where it was not moved."""
    balance = None if result.engraved is None else result.engraved.balance
    return None if balance is None or len(balance.errors) < 2 else balance.unbalanced


def _balance(result: Result, balance: Balance) -> str:
    """How labels and edges were made up for, in words."""
    model = "" if result.thrown is None else " by the momentum model"
    plain = f"The plain shape is off by {result.max_abs_error:.1e}. " if not model else ""
    first = f"{plain}With its labels and edges it would be off by {balance.errors[0]:.1e}{model}."
    if len(balance.errors) < 2:
        return f"{first} Nothing was moved."
    how = f"Its facets were moved by up to {balance.moved_mm:.2g} mm"
    if balance.stretch is not None:
        how = f"It was stretched by {100.0 * balance.stretch:.2g} %"
    rounds = len(balance.errors) - 1
    times = f"{rounds} round{'' if rounds == 1 else 's'}"
    last = f"{min(balance.errors):.1e}{model}"
    error = None if result.engraved is None else result.engraved.max_abs_error
    if not model and error is not None:
        last += f", and {error:.1e} in the file as it was read back"
    return f"{first} {how} in {times}, until it was off by {last}."


def _percent(odds: Sequence[float], elsewhere: float | None) -> list[str]:
    """Odds (k,) and those of all other rests, if they are known."""
    others = "-" if elsewhere is None else f"{100.0 * elsewhere:.3f}"
    return [*(f"{100.0 * value:.3f}" for value in odds), others]


def _measures(concave: Concave) -> str:
    """How far a surface was changed."""
    moved, hull, surface = concave.displacement, concave.hull, concave.surface
    rows = [
        ["mean displacement", f"{100.0 * moved.mean:.3g} % of the diagonal"],
        ["largest displacement", f"{100.0 * moved.largest:.3g} % of the diagonal"],
        ["vertices of the surface", str(surface.vertices)],
        ["triangles of the surface", str(surface.triangles)],
        ["vertices of its hull before", str(hull.vertices_before)],
        ["vertices of its hull after", str(hull.vertices_after)],
        ["gap to the designed hull", f"{number(hull.gap, 2)} of the diagonal"],
    ]
    return table_section("Measures", ["measure", "value"], rows)


def _instructions(result: Result) -> str:
    """How to print, throw and read the die."""
    is_shape = result.concave is not None
    told = None if result.engraved is None else result.engraved.reading
    reading = _READING_A_SHAPE if is_shape else f"edges. {told or _UNLABELLED} "
    marked = _MARKED if is_shape and "die" in result.files else ""
    filling = _SOLID
    if result.infill is not None:
        filling = f"Print the STL file in millimetres. {result.infill.advice} "
    return f"{filling}{_COOLING}{reading}{throwing_advice(result.thrown, result.prior)}{marked}"
