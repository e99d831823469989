"""Verdicts and advice on given designs."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_check

from dicedesign.recipe.pipeline import Work
from dicedesign.results.parts import Status

BOX = box(4.0, 5.0, 6.0)

FAIR = {"fair": 6}

FROM_PRISM = {"method": {"paper": {}}, "start": {"prism": {}}}
"""Entries of a recipe by the paper's method."""

ROUGH = {**FROM_PRISM, "method": {"paper": {"finish": "none"}}}

COARSE = {"method": {"exact": {"tolerance": 1e-5}}}

AT_TIME_LIMIT = {"target": FAIR, "status": Status.TIME_LIMIT}

VERTICES = {"method": {"exact": {"coordinates": "vertices"}}}


def message(work: Work) -> str:
    return "; ".join(work.remarks)


def test_the_error_is_named() -> None:
    good = run_to_check(BOX, starts=3)
    assert good.status is Status.CONVERGED
    assert good.plain.max_abs_error < 1e-6
    assert good.design_error < 1e-12
    work = run_to_check(BOX, target=FAIR, starts=3)
    assert work.status is Status.OFF_TARGET
    off = np.abs(work.plain.outcomes.probabilities - 1.0 / 6.0).max()
    assert off > 0.05
    numbers = re.findall(r"[0-9.]+(?= in die_plain| before rounding)", message(work))
    assert list(map(float, numbers)) == pytest.approx([off, off], rel=5e-3)
    assert work.design_error == pytest.approx(off, rel=1e-6)


def rare(smallest: float) -> dict[str, Any]:
    """Target with one small probability."""
    return {"probabilities": [smallest, *[(1.0 - smallest) / 5.0] * 5]}


NEAR = np.array([[1.0, 0.3, 0.0], [1.0, 0.0, 0.3]]) / np.sqrt(1.09)
"""Directions near a side that is nearest to another outcome."""


@pytest.mark.parametrize(
    ("arguments", "named", "is_named"),
    [
        ({}, "3 starting shapes", False),
        ({"target": FAIR, "starts": 3}, "3 starting shapes", True),
        ({"target": FAIR, "starts": 1}, "starting shapes", False),
        (AT_TIME_LIMIT, "method.exact.seconds", True),
        ({**AT_TIME_LIMIT, "entries": FROM_PRISM}, "seconds", False),
        ({**AT_TIME_LIMIT, "status": Status.STEP_LIMIT}, "method.exact.evaluations", True),
        ({**AT_TIME_LIMIT, "status": Status.NO_PROGRESS}, "method.exact.", False),
        ({"target": FAIR}, "coordinates", False),
        ({"target": FAIR, "entries": VERTICES}, "coordinates: vertices", True),
        ({"entries": VERTICES}, "coordinates", False),
        ({"target": FAIR}, "finish", False),
        ({"target": FAIR, "entries": FROM_PRISM}, "finish", False),
        ({"target": FAIR, "entries": ROUGH}, "finish: exact", True),
        ({"target": rare(9e-6), "entries": COARSE}, "method.exact.tolerance", True),
        ({"target": rare(1.1e-5), "entries": COARSE}, "method.exact.tolerance", False),
        ({"target": rare(9e-6)}, "9e-06 rarely", True),
        ({"target": rare(1e-5)}, "1e-05 rarely", False),
        ({"target": rare(9e-6), "entries": FROM_PRISM}, "rarely gets", False),
        ({"directions": np.concatenate([SIDES, NEAR]), "target": {"fair": 8}}, "2 outcomes", True),
    ],
)
def test_advice_is_given_where_it_helps(
    arguments: dict[str, Any], named: str, is_named: bool
) -> None:
    work = run_to_check(BOX, **arguments)
    assert work.status is arguments.get("status", work.status)
    assert (named in message(work)) == is_named


def test_rests_without_outcome_are_named() -> None:
    """A box with outcomes on four of its sides."""
    four = SIDES[[0, 1, 3, 4]]
    elsewhere = run_to_check(BOX, four).plain.outcomes.elsewhere
    assert elsewhere > 0.05
    for tolerance, status in ((1e-6, Status.OFF_TARGET), (0.99 * elsewhere, Status.STRAY)):
        work = run_to_check(BOX, four, entries={"method": {"exact": {"tolerance": tolerance}}})
        assert f"{elsewhere:.3g} of the probability" in message(work)
        assert work.status is status


def test_an_unsteady_outcome_and_a_small_circle_are_named() -> None:
    """A long box on its end falls when it is tilted by a twentieth of a degree."""
    work = run_to_check(box(1.0, 1.1, 1100.0), target=FAIR, entries={"size_mm": 100})
    assert Status.UNSTEADY.value in message(work)
    match = re.search(r"(\d) tips over at ([0-9.]+) degrees", message(work))
    assert match[1] == work.target.labels[int(np.argmin(work.plain.margins))]
    assert match[1] in "36"
    assert float(match[2]) == pytest.approx(np.degrees(np.arctan(1.0 / 1100.0)), rel=0.05)
    # Half the smallest side of a box with a diagonal of 30 mm.
    small = run_to_check(BOX, status=Status.TOO_SMALL)
    radius = float(re.search(r"([0-9.]+) mm", message(small))[1])
    assert radius == pytest.approx(2.0 * 30.0 / np.linalg.norm([4.0, 5.0, 6.0]), rel=5e-3)
