"""What the page says about prints of a die."""

from __future__ import annotations

from dataclasses import replace

from common.finished import LABELS, finished_box
from common.parsed_html import parsed

from dicedesign.report.pages.die_page import die_page
from dicedesign.results.result import InfillOdds, PrintTolerances

ERRORS = {"dimensional_mm": 0.07, "shrinkage": 0.002, "density_gradient": 0.01, "bubble_mm3": 1.0}

TOLERANCES = PrintTolerances(
    answer="Printed to within ±0.12 mm <so>, 1,000 rolls show nothing.",
    rolls=1000,
    allowed_mm=0.12,
    noticed=0.0789,
    assumed=ERRORS,
    deviations=(0.00203, 0.00224, 0.00244, 0.00282, 0.00276, 0.00142),
    by_error={name: (0.001 * number,) * 6 for number, name in enumerate(ERRORS, 1)},
    total_variation=0.0104,
)

INFILL = InfillOdds(
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


def test_every_error_of_every_outcome_is_told() -> None:
    page = parsed(die_page(finished_box(tolerances=TOLERANCES).result, {}))
    assert TOLERANCES.answer in page.text
    assert {"0.203", "0.224", "0.244", "0.282", "0.276", "0.142"} <= set(page.cells)
    for column in ("0.100", "0.200", "0.300", "0.400"):
        assert page.cells.count(column) == len(LABELS)
    for part in ("0.07 mm", "0.002 of the length", "1 mm³", "7.9 %", "0.01 on the mean"):
        assert part in page.text


def test_infill_takes_the_place_of_the_advice_to_print_solid() -> None:
    solid = parsed(die_page(finished_box().result, {})).text
    page = parsed(die_page(finished_box(infill=INFILL).result, {}))
    assert "hold for a solid of one material" in solid
    assert "hold for a solid of one material" not in page.text
    assert page.text.count(INFILL.advice) == 2
    assert {"11.000", "35.000"} <= set(page.cells)
    assert "15 % infill" in page.text


def test_a_page_without_them_says_nothing() -> None:
    result = finished_box(tolerances=TOLERANCES, infill=INFILL).result
    bare = die_page(replace(result, tolerances=None, infill=None), {})
    assert bare == die_page(finished_box().result, {})
    assert "prints" not in parsed(bare).text
