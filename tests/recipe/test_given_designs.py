"""Verdicts, advice, and effects of printing errors and infill, on given designs."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_check, run_to_design
from common.thrown import rigid_body_with_rests

from dicedesign.fabricate.engraving import cut_sections
from dicedesign.fabricate.infill import inside_walls, pocket_walls, weigh_print
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.results.result import PrintTolerances
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_probabilities import momentum_probabilities

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


# Printing errors and infill.


FRUSTUM = box(4.0, 4.0, 2.5)
FRUSTUM[FRUSTUM[:, 2] > 0.0] *= [0.7, 0.8, 1.0]


def print_work(
    points: np.ndarray, options: dict[str, Any], entries: dict[str, Any] | None = None, **known: Any
) -> Work:
    """Run up to the stage "tolerances". options: entries of `print`."""
    given = {"size_mm": 30.0, "print": options, **(entries or {})}
    work = run_to_design(points, entries=given, **known)
    run_stages(work, after="design", last="tolerances")
    return work


BOX = box(4.0, 5.0, 6.0)


@pytest.fixture(scope="module")
def tolerances() -> PrintTolerances:
    """Of a box with the usual errors."""
    result = print_work(BOX, {}).result()
    assert result.infill is None
    return result.tolerances


def test_tolerances_of_a_box_by_the_errors_of_the_recipe(tolerances: PrintTolerances) -> None:
    options = {"errors": {"dimensional_mm": 0.3, "bubble_mm3": 0.0}}
    section = print_work(BOX, options).result().tolerances
    ratio = np.divide(section.by_error["dimensional_mm"], tolerances.by_error["dimensional_mm"])
    np.testing.assert_allclose(ratio, 0.3 / tolerances.assumed["dimensional_mm"], rtol=0.01)
    np.testing.assert_allclose(section.by_error["bubble_mm3"], 0.0, atol=1e-12)
    assert section.allowed_mm == tolerances.allowed_mm
    assert 0.05 < tolerances.noticed < section.noticed < 0.5
    # Opposite sides are equal.
    np.testing.assert_allclose(tolerances.deviations[:3], tolerances.deviations[3:], rtol=1e-3)


def test_infill_moves_the_center_of_mass_and_the_probabilities() -> None:
    hollow = print_work(FRUSTUM, {"infill": 0.0, "walls_mm": 2.0})
    section = hollow.result().infill
    hull = hollow.plain.poses.hull
    mass, center = weigh_print(*_uniform(hull.vertices), inside_walls(hull, 2.0), 0.0)
    probabilities = outcome_probabilities(rest_poses(hull.vertices, center), SIDES).probabilities
    assert section.mass == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(section.probabilities, probabilities, atol=1e-6)
    np.testing.assert_allclose(
        section.shift_mm, center - hollow.plain.poses.center_of_mass, atol=1e-5
    )
    half = print_work(FRUSTUM, {"infill": 0.5, "walls_mm": 2.0}).result().infill
    assert 0.0 < half.max_abs_error < section.max_abs_error > 1e-3


def _uniform(points: np.ndarray) -> tuple[float, np.ndarray]:
    hull = convex_hull(points)
    ends = hull.vertices[hull.triangles] - hull.centroid
    return float(np.linalg.det(ends).sum() / 6.0), hull.centroid


def test_labels_take_infill_away() -> None:
    entries = {"engrave": {"depth_mm": 1.0, "balance": "none"}}
    work = print_work(FRUSTUM, {"infill": 0.1, "walls_mm": 1.0}, entries=entries)
    engraved, options = work.engraved, work.recipe.engrave
    hull = convex_hull(engraved.points)
    walls = pocket_walls(cut_sections(hull, engraved.placements, options), 1.0, 1.0)
    inside, plain = inside_walls(hull, 1.0, walls), inside_walls(hull, 1.0)
    assert inside[0] < 0.99 * plain[0]
    mass, center = weigh_print(engraved.volume, engraved.centroid, inside, 0.1)
    section = work.result().infill
    assert section.mass == pytest.approx(mass, rel=1e-5)
    np.testing.assert_allclose(section.shift_mm, center - engraved.centroid, atol=1e-4)


@pytest.mark.parametrize(
    ("entries", "known"),
    [
        ({"engrave": {"balance": "opposite"}}, {}),
        ({}, {"center_of_mass": np.array([0.1, 0.0, 0.05])}),
    ],
    ids=["hidden hollow", "given center"],
)
def test_infill_of_bodies_that_it_changes_otherwise_is_not_computed(
    entries: dict[str, Any], known: dict[str, Any]
) -> None:
    work = print_work(FRUSTUM, {"infill": 0.1}, entries=entries, **known)
    result = work.result()
    assert result.tolerances is not None
    assert result.infill is None
    assert any("infill" in note for note in work.notes)


def test_a_thrown_die_spreads_by_its_probabilities_on_the_table() -> None:
    method = {"exact": {"probabilities": "thrown"}}
    work = print_work(FRUSTUM, {}, entries={"method": method})
    points, step = work.solid.points, 0.02

    def thrown(lengths: np.ndarray) -> np.ndarray:
        body, poses = rigid_body_with_rests(points * lengths)
        places = np.argmax(SIDES @ poses.normals.T, axis=1)
        return momentum_probabilities(poses, body, momentum_model("board-game"))[places]

    slopes = [(thrown(1.0 + axis) - thrown(1.0 - axis)) / (2.0 * step) for axis in step * np.eye(3)]
    shrinkage = work.result().tolerances.by_error["shrinkage"]
    np.testing.assert_allclose(shrinkage, 0.002 * np.linalg.norm(slopes, axis=0), rtol=0.02)


def test_rounded_edges_move_with_their_facets(tolerances: PrintTolerances) -> None:
    entries = {"edges": {"radius_mm": 1.0}, "engrave": True, "size_mm": 30.0}
    rounded = print_work(BOX, {}, entries=entries).result().tolerances
    np.testing.assert_allclose(rounded.deviations, tolerances.deviations, rtol=0.1)
