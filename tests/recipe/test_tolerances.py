"""Effects of printing errors and infill on the probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_design
from common.thrown import rigid_body_with_rests

from dicedesign.fabricate.engraving import cut_sections
from dicedesign.fabricate.infill import inside_walls, pocket_walls, weigh_print
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.result import PrintTolerances
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_probabilities import momentum_probabilities

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
