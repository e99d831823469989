"""The page of convex, thrown and reshaped dice, and what it says of attempts and of prints."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import pytest
from common.finished import CONCAVE, LABELS, finished_box, page_text
from common.made_up_die import SIDES, box, run_to_check
from common.parsed_html import Checker, parse_page

from dicedesign.errors import InputError
from dicedesign.recipe.output import make_finished_die
from dicedesign.recipe.pipeline import run_stages
from dicedesign.report.figures import FIGURES
from dicedesign.report.pages import throwing_advice
from dicedesign.results.parts import (
    Draft,
    PrintedLabel,
    Search,
    SimulatedThrows,
    TableResult,
    TradeOff,
)
from dicedesign.results.result import Designed, InfillProbabilities, PrintTolerances
from dicedesign.throws.tables import load_table

PNG = b"\x89PNG"
RESHAPED = {
    "concave": CONCAVE,
    "design": Designed(0.1),
    "rest_counts": (3, 1, 1, 1, 1, 17),
    "notes": ("7 vertices were welded",),
}
THROWN = TableResult(
    load_table("board-game").as_dict()
    | {"restitution": 0.5, "friction": 0.3, "height": 0.1, "speed": 0.2, "spin": 10.0}
    | {"size": 0.0317, "name": "my <table>", "source": "guessed"},
    (0.16, 0.16, 0.16, 0.16, 0.16, 0.2),
    (),
    SimulatedThrows(
        "native",
        1,
        100_100,
        60,
        (16_000, 16_000, 16_000, 16_000, 16_000, 20_000),
        (0.16, 0.16, 0.16, 0.16, 0.16, 0.2),
        ((0.158, 0.162),) * 6,
        0.005,
        (0.0023, 0.0077),
        0.0011,
    ),
)


def page_of(images: dict[str, bytes] | None = None, **changes: Any) -> Checker:
    return parse_page(page_text(finished_box(**changes), images))


def test_a_convex_die() -> None:
    images = dict.fromkeys(("bars", "convergence", "gauss_map", "views", "faces"), PNG)
    page = page_of(images)
    assert len(page.sources) == 5
    assert ("<6>", "16.667") in zip(page.cells, page.cells[1:], strict=False)
    assert {"start", "0.50", "301.2", "-", "smoothness & size", "0.25"} <= set(page.cells)
    for text in (
        "max |p - q| is 0.1 & more",
        *(FIGURES[name].title for name in images),
        *(FIGURES[name].caption for name in images),
        "whole program during the stage,",
        "can rest on all 6 faces",
        "(0.000, 1.500, -2.000) mm",
        "die_plain: die_plain.stl",
        "100 % infill",
        "the face down",
        "Set it down gently",
        "A thrown die has other probabilities.",
    ):
        assert text in page.text
    for absent in ("On the table", "Measures", "Notes", "Quality of the surface"):
        assert absent not in page.text


def test_a_die_that_keeps_a_shape() -> None:
    names = ("rests", "before_after", "probabilities", "hull", "displacement", "energy")
    page = page_of(dict.fromkeys(names, PNG), **RESHAPED)
    assert len(page.sources) == 6
    at = page.cells.index("elsewhere")
    assert page.cells[at : at + 5] == ["elsewhere", "-", "25.000", "0.000", "-"]
    for text in (
        "3.12 % of the diagonal",
        "11.5 % of the diagonal",
        "3.2e-06 of the diagonal",
        "430",
        "6598",
        "No two triangles <cross>.",
        "7 vertices were welded",
        "the side that the die rests on",
    ):
        assert text in page.text
    assert "Facets" not in page.text
    rests, *shown, energy = (FIGURES[name].caption for name in names)
    order = ["How to read the die", rests, "How to print the die", "Notes"]
    order += ["Quality of the surface", *shown, "Files", "Numbers for experts", energy]
    order += ["Measures", "Stages"]
    places = [page.text.index(title) for title in order]
    assert places == sorted(places)
    assert "cut into the side that is up" not in page.text
    marked = page_of(**RESHAPED, files={"die": "die.stl", "die_plain": "die_plain.stl"})
    assert "cut into the side that is up" in marked.text


def test_a_die_to_be_thrown() -> None:
    images = dict.fromkeys(("bars", "table", "rounds", "views"), PNG) | {"throw": b"GIF89a"}
    page = page_of(images, thrown=THROWN)
    # Without the bars of probabilities that the die is not meant to have.
    assert len(page.sources) == 4
    assert FIGURES["bars"].title not in page.text
    assert sum(source.startswith("data:image/gif;") for source in page.sources) == 1
    assert "158" not in page.text
    assert "15.80 to 16.20" in page.cells
    for text in (
        "falls from 10 cm above the table",
        "moves sideways at 20 cm a second and spins 1.6 times a second",
        "bounces off with 50 % of its speed; the coefficient of friction is 0.3",
        "31.7 mm across",
        'This is the table "my <table>": guessed.',
        "In 100,100 throws that the design had not seen, simulated by the package's own engine,",
        "total variation of 0.0050",
        "a perfect die would show 0.0011",
        "off by 0.0023 to 0.0077",
        "60 throws did not come to rest",
        "40 came to rest on a face without a label",
        "let it fall from about 10 cm above the table, with a little push and spin",
    ):
        assert text in page.text


def test_inconclusive_throws_and_no_throws() -> None:
    assert THROWN.simulated is not None
    even = replace(THROWN.simulated, interval=(0.0, 0.004), unresolved=0, drops=100_000)
    text = page_of(thrown=replace(THROWN, simulated=even)).text
    assert "do not distinguish it from a perfect die" in text
    assert "off by at most 0.0040" in text
    assert "did not come to rest" not in text
    assert "without a label" not in text
    text = page_of(thrown=replace(THROWN, simulated=None)).text
    assert "No throws of it were simulated" in text
    text = page_of(thrown=replace(THROWN, table=load_table("carpet").as_dict())).text
    assert "it is set down on the table, in a random orientation. It does not bounce" in text
    assert "honey" in text
    assert "at release" not in text


def test_throws_of_many_heights_and_spins() -> None:
    table = {**THROWN.table, "height": [0.05, 0.2], "speed": [0.0, 1.2], "spin": [2 * pi, 9 * pi]}
    thrown = replace(THROWN, table=table)
    assert "let it fall from 5 to 20 cm above" in throwing_advice(thrown)
    manner = page_of(thrown=thrown).text
    assert "falls from 5 to 20 cm above the table, in a random orientation" in manner
    assert "moves sideways at 0 to 1.2 m a second and spins 1 to 4.5 times a second" in manner
    assert "from a range, each throw draws its own value" in manner
    assert "from a range" not in page_of(thrown=THROWN).text


@pytest.mark.parametrize("changes", [{}, RESHAPED, {"thrown": THROWN}])
def test_pages_need_nothing_else_and_escape(changes: dict[str, Any]) -> None:
    images = {figure.name: PNG for figure in FIGURES}
    text = page_text(finished_box(**changes), images)
    for part in ("http:", "https:", "<link", "<6>", "<cross>", "<table>:"):
        assert part not in text
    assert "<title>a &lt; box</title>" in text
    assert 'name="viewport"' in text
    assert all(source.startswith("data:image/") for source in parse_page(text).sources)
    assert text == page_text(finished_box(**changes), images)


def test_figures_that_are_absent_leave_their_section_out() -> None:
    text = page_of().text
    for name in FIGURES.names:
        assert FIGURES[name].caption in page_of({name: PNG}).text
        assert FIGURES[name].caption not in text


HEADER = 9
"""Columns of the table of attempts."""


def cells(drafts: tuple[Draft, ...], attempts: int, attempt: int | None = None) -> list[str]:
    search = Search(attempts, None, attempt, TradeOff(0.005, 45.0, 10.0, 0.03, drafts))
    die = finished_box(concave=CONCAVE, search=search)
    assert die.result.error_before == 0.25
    return parse_page(page_text(die)).cells


def test_goals_are_listed_beside_results() -> None:
    listed = cells((), attempts=4)
    for name, values in (
        ("error of the probabilities, rests elsewhere included", ["at most 0.005", "0.25", "0.05"]),
        ("angle between outcomes", ["at least 45°", "-", "90.0°"]),
        ("angle at which an outcome tips over", ["at least 10°", "-", "45.0°"]),
    ):
        at = listed.index(name)
        assert listed[at + 1 : at + 4] == values


def test_the_best_attempts_are_listed_and_the_die_first() -> None:
    """Even attempts have the probabilities, the larger the number the farther they were moved; the
    third has become the die."""
    drafts = tuple(
        Draft(
            k,
            None if k == 2 else 1.5,
            0.001 if k % 2 == 0 else 0.1,
            0.01 * k,
            50.0,
            12.0,
            0,
            0.01 if k % 2 == 0 else None,
        )
        for k in range(1, 31)
    )
    listed = cells(drafts, attempts=40, attempt=3)
    at = listed.index("3, this die")
    rows = [listed[at + HEADER * k : at + HEADER * (k + 1)] for k in range(12)]
    assert [row[0] for row in rows[1:]] == [str(2 * k) for k in range(1, 12)]
    assert rows[0][1:8] == ["3.00", "1.0e-01", "50.0", "12.0", "0", "-", "1.5"]
    assert rows[1][1:8] == ["2.00", "1.0e-03", "50.0", "12.0", "0", "0.01", "-"]
    assert {row[8] for row in rows[1:]} == {"nothing"} != {rows[0][8]}
    assert "24" not in listed


def test_dice_of_no_surface_have_none() -> None:
    assert "Attempts" not in page_of().text
    with pytest.raises(InputError, match="concave"):
        finished_box().result.error_before  # noqa: B018


ERRORS = {"dimensional_mm": 0.07, "shrinkage": 0.002, "density_gradient": 0.01, "bubble_mm3": 1.0}

TOLERANCES = PrintTolerances(
    answer="Within about 0.12 mm <so>, 1,000 rolls rarely reveal an error.",
    rolls=1000,
    allowed_mm=0.12,
    noticed=0.0789,
    assumed=ERRORS,
    deviations=(0.00203, 0.00224, 0.00244, 0.00282, 0.00276, 0.00142),
    by_error={name: (0.001 * number,) * 6 for number, name in enumerate(ERRORS, 1)},
    mean=(0.17, 0.17, 0.17, 0.17, 0.17, 0.15),
    elsewhere=0.0,
    total_variation=0.0104,
    nine_in_ten=0.0213,
)

INFILL = InfillProbabilities(
    infill=0.15,
    walls_mm=1.2,
    advice="At 15 % infill nobody notices. Print it so, or solid.",
    probabilities=(0.11, 0.12, 0.13, 0.14, 0.15, 0.35),
    elsewhere=0.0,
    max_abs_error=0.01,
    mass=0.45,
    shift_mm=(0.0, 0.0, 0.05),
    least_infill=0.0,
)


def test_every_error_of_every_outcome_is_reported() -> None:
    page = page_of(tolerances=TOLERANCES)
    assert TOLERANCES.answer in page.text
    assert {"0.203", "0.224", "0.244", "0.282", "0.276", "0.142"} <= set(page.cells)
    for column in ("0.100", "0.200", "0.300", "0.400"):
        assert page.cells.count(column) == len(LABELS)
    for part in ("0.07 mm", "0.002 of the length", "1 mm³", "7.9 %", "variation of 0.01"):
        assert part in page.text


def test_infill_takes_the_place_of_the_advice_to_print_solid() -> None:
    solid = page_of().text
    page = page_of(infill=INFILL)
    assert "hold for a solid of one material" in solid
    assert "hold for a solid of one material" not in page.text
    assert page.text.count(INFILL.advice) == 2
    assert {"11.000", "35.000"} <= set(page.cells)
    assert "15 % infill" in page.text


def test_a_page_has_the_measures_of_the_print() -> None:
    work = run_to_check(box(1.0, 1.0, 1.0), SIDES, entries={"engrave": True, "print": "sla"})
    run_stages(work, after="check", last="printing")
    die = make_finished_die(work)
    facts = die.result.printability
    assert facts is not None
    page = parse_page(page_text(die))
    for cell in (
        "SLA, 0.05 mm, layers of 0.05 mm",
        f"{facts.weight_g:.3g} g of resin, 1.15 g/cm³, solid",
        "17.3 × 17.3 × 17.3 mm",
        "none",
        "one valid closed solid",
    ):
        assert cell in page.cells
    for label in facts.labels:
        assert label.text in page.cells
        assert f"{label.wall_mm:.2g}" in page.cells
    bare = replace(die, result=replace(die.result, printability=None))
    assert "Printing" not in parse_page(page_text(bare)).text


def test_missing_values_are_dashes_and_texts_are_escaped() -> None:
    work = run_to_check(box(1.0, 1.1, 1.2), SIDES, entries={"engrave": False})
    run_stages(work, after="check", last="printing")
    die = make_finished_die(work)
    facts = die.result.printability
    assert facts is not None
    concave = replace(
        facts,
        smallest_facet=None,
        labels=(PrintedLabel("<7>", None, None, None),),
        best=replace(facts.best, overhang_mm2=12.34, support_mm3=3.14, label="<7>"),
        file=replace(facts.file, open_edges=3),
    )
    result = replace(die.result, printability=concave)
    page = parse_page(page_text(replace(die, result=result)))
    at = page.cells.index("<7>")
    assert page.cells[at + 1 : at + 4] == ["-"] * 3
    assert "<7>" in page.cells
    assert "12.3 mm², 3 mm³ beneath" in page.cells
    assert "3 open edges" in page.text
    assert "Orientations on the bed" not in page.text
