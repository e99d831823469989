"""What a page says of the attempts at a concave die."""

from __future__ import annotations

import pytest
from common.finished import finished_box
from common.parsed_html import parsed

from dicedesign.errors import InputError
from dicedesign.report.pages.die_page import die_page
from dicedesign.results.parts import (
    Concave,
    Displacement,
    Draft,
    HullOfSurface,
    Search,
    SurfaceSize,
    TradeOff,
)

HEADER = 8
"""Columns of the table of attempts."""


def cells(drafts: tuple[Draft, ...], attempts: int, attempt: int | None = None) -> list[str]:
    concave = Concave(
        probabilities_before=(0.125,) * 6,
        elsewhere_before=0.25,
        displacement=Displacement(0.0, 0.0),
        hull=HullOfSurface(8, 8, 0.0),
        surface=SurfaceSize(8, 12),
        quality=(),
        surface_quality={},
        self_intersections=0,
    )
    search = Search(attempts, None, attempt, TradeOff(0.005, 45.0, 10.0, drafts))
    result = finished_box(concave=concave, search=search).result
    assert result.error_before == 0.25
    return parsed(die_page(result, {})).cells


def test_what_was_wanted_stands_beside_what_was_reached() -> None:
    told = cells((), attempts=4)
    for name, values in (
        ("error of the odds, rests elsewhere included", ["at most 0.005", "0.25", "0.05"]),
        ("angle between outcomes", ["at least 45°", "-", "90.0°"]),
        ("angle at which an outcome is left", ["at least 10°", "-", "45.0°"]),
    ):
        at = told.index(name)
        assert told[at + 1 : at + 4] == values


def test_the_best_attempts_are_listed_and_the_die_first() -> None:
    """Even attempts have the odds, the larger the number the farther they were moved; the third
    has become the die."""
    drafts = tuple(
        Draft(k, None if k == 2 else 1.5, 0.001 if k % 2 == 0 else 0.1, 0.01 * k, 50.0, 12.0, 0)
        for k in range(1, 31)
    )
    told = cells(drafts, attempts=40, attempt=3)
    at = told.index("3, this die")
    rows = [told[at + HEADER * k : at + HEADER * (k + 1)] for k in range(12)]
    assert [row[0] for row in rows[1:]] == [str(2 * k) for k in range(1, 12)]
    assert rows[0][1:7] == ["3.00", "1.0e-01", "50.0", "12.0", "0", "1.5"]
    assert rows[1][1:7] == ["2.00", "1.0e-03", "50.0", "12.0", "0", "-"]
    assert {row[7] for row in rows[1:]} == {"nothing"} != {rows[0][7]}
    assert "24" not in told


def test_dice_of_no_surface_have_none() -> None:
    result = finished_box().result
    assert "Attempts" not in parsed(die_page(result, {})).text
    with pytest.raises(InputError, match="surface"):
        result.error_before  # noqa: B018
