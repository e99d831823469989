"""Verdicts and advice on given designs."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from common.dented_cube import roof
from common.made_up_die import SIDES, box, run_to_check

from dicedesign.recipe.pipeline import Work
from dicedesign.results.parts import Status

FROM_PRISM = {"method": {"paper": {}}, "start": {"prism": {}}}
"""Entries of a recipe by the paper's method."""


def message(work: Work) -> str:
    return "; ".join(work.remarks)


def test_a_converged_die_has_no_advice() -> None:
    work = run_to_check(box(4.0, 5.0, 6.0), starts=3)
    assert work.status is Status.CONVERGED
    assert len(work.remarks) == 2
    assert work.plain.max_abs_error < 1e-6
    assert work.design_error < 1e-12


def test_the_error_is_named() -> None:
    points = box(4.0, 5.0, 6.0)
    work = run_to_check(points, target={"fair": 6}, starts=3)
    assert work.status is Status.OFF_TARGET
    off = np.abs(work.plain.outcomes.probabilities - 1.0 / 6.0).max()
    assert off > 0.05
    numbers = re.findall(r"[0-9.]+(?= in die_plain| before rounding)", message(work))
    assert list(map(float, numbers)) == pytest.approx([off, off], rel=5e-3)
    assert work.design_error == pytest.approx(off, rel=1e-6)
    assert "3 starting shapes" in message(work)
    assert "finish" not in message(work)
    one = run_to_check(points, target={"fair": 6}, starts=1)
    assert "starting shapes" not in message(one)
    finished = run_to_check(points, target={"fair": 6}, entries=FROM_PRISM)
    assert "finish" not in message(finished)
    rough = {**FROM_PRISM, "method": {"paper": {"finish": "none"}}}
    assert "finish: exact" in message(run_to_check(points, target={"fair": 6}, entries=rough))


def test_rests_without_outcome_are_named() -> None:
    """A box with outcomes on four of its sides."""
    points = box(4.0, 5.0, 6.0)
    work = run_to_check(points, SIDES[[0, 1, 3, 4]])
    assert work.status is Status.OFF_TARGET
    elsewhere = work.plain.outcomes.elsewhere
    assert elsewhere > 0.05
    assert f"{elsewhere:.3g} of the probability" in message(work)
    assert "of the probability" not in message(run_to_check(points))
    wide = run_to_check(
        points, SIDES[[0, 1, 3, 4]], entries={"method": {"exact": {"tolerance": 0.99 * elsewhere}}}
    )
    assert "of the probability" in message(wide)


def test_outcomes_without_a_rest_are_counted() -> None:
    """Two directions are near a side that is nearest to another outcome."""
    near = np.array([[1.0, 0.3, 0.0], [1.0, 0.0, 0.3]]) / np.sqrt(1.09)
    work = run_to_check(box(1.0, 1.0, 1.0), np.concatenate([SIDES, near]), target={"fair": 8})
    assert (work.plain.outcomes.main < 0).sum() == 2
    assert "2 outcomes have no facet" in message(work)
    assert "have no facet" not in message(run_to_check(box(1.0, 1.0, 1.0)))


@pytest.mark.parametrize(
    ("status", "entries", "key"),
    [
        (Status.TIME_LIMIT, {}, "method.exact.seconds"),
        (Status.TIME_LIMIT, FROM_PRISM, None),
        (Status.STEP_LIMIT, {}, "method.exact.evaluations"),
        (Status.STEP_LIMIT, FROM_PRISM, None),
        (Status.NO_PROGRESS, {}, None),
    ],
)
def test_the_limit_that_was_reached_is_named(
    status: Status, entries: dict[str, Any], key: str | None
) -> None:
    work = run_to_check(box(4.0, 5.0, 6.0), status=status, target={"fair": 6}, entries=entries)
    assert work.status is status
    keys = re.findall(r"method\.\w+\.(?:seconds|evaluations)", message(work))
    assert keys == ([] if key is None else [key])
    assert Status.OFF_TARGET.value not in message(work)


@pytest.mark.parametrize("status", [Status.CONVERGED, Status.NO_PROGRESS])
def test_the_angle_between_close_outcomes_is_named(status: Status) -> None:
    points = roof(4.0)
    half = np.radians(2.0)
    below = [[-np.sin(half), 0.0, -np.cos(half)], [np.sin(half), 0.0, -np.cos(half)]]
    work = run_to_check(points, np.concatenate([SIDES[:5], below]), status, target={"fair": 7})
    assert work.plain.outcomes.least_angle == pytest.approx(np.radians(4.0), rel=1e-3)
    assert Status.CROWDED.value in message(work)
    assert "nearest are 4 degrees" in message(work)
    assert work.status is (Status.OFF_TARGET if status is Status.CONVERGED else status)
    apart = run_to_check(roof(8.0), np.concatenate([SIDES[:5], below]), status, target={"fair": 7})
    assert Status.CROWDED.value not in message(apart)


def test_an_unsteady_outcome_is_named() -> None:
    """A long box on its end falls when it is tilted by a twentieth of a degree."""
    work = run_to_check(box(1.0, 1.1, 1100.0), target={"fair": 6}, entries={"size_mm": 100})
    weakest = work.plain.margins
    assert Status.UNSTEADY.value in message(work)
    match = re.search(r"(\d) tips over at ([0-9.]+) degrees", message(work))
    assert match[1] == work.target.labels[int(np.argmin(weakest))]
    assert match[1] in "36"
    assert float(match[2]) == pytest.approx(np.degrees(np.arctan(1.0 / 1100.0)), rel=0.05)


def test_vertex_coordinates_are_named_as_cause() -> None:
    entries = {"method": {"exact": {"coordinates": "vertices"}}}
    work = run_to_check(box(4.0, 5.0, 6.0), target={"fair": 6}, entries=entries)
    assert "coordinates: vertices" in message(work)
    assert "coordinates" not in message(run_to_check(box(4.0, 5.0, 6.0), target={"fair": 6}))
    assert "coordinates" not in message(run_to_check(box(4.0, 5.0, 6.0), entries=entries))


def test_the_smallest_inscribed_circle_is_named() -> None:
    """Half the smallest side of a box with a diagonal of 30 mm."""
    points = box(4.0, 5.0, 6.0)
    size = np.linalg.norm([4.0, 5.0, 6.0])
    work = run_to_check(points, status=Status.TOO_SMALL)
    match = re.search(r"([0-9.]+) mm", message(work))
    assert float(match[1]) == pytest.approx(2.0 * 30.0 / size, rel=5e-3)
    assert "circle has a radius" not in message(run_to_check(points, target={"fair": 6}))


@pytest.mark.parametrize(("smallest", "is_rare"), [(9e-6, True), (1e-5, False)])
def test_rare_outcomes_are_named(smallest: float, is_rare: bool) -> None:
    rest = (1.0 - smallest) / 5.0
    target = {"probabilities": [smallest, *[rest] * 5]}
    work = run_to_check(box(4.0, 5.0, 6.0), target=target)
    assert (f"{smallest:.2g} rarely" in message(work)) == is_rare
    paper = run_to_check(box(4.0, 5.0, 6.0), target=target, entries=FROM_PRISM)
    assert "rarely gets" not in message(paper)
