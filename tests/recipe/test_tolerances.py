"""Effects of printing errors and infill on the probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_design
from common.random_points import depths, in_pocket_walls, points_inside
from common.thrown import rigid_body_with_rests

from dicedesign.fabricate.print_tolerances import inside_walls, weigh_print
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_probabilities import momentum_probabilities

FRUSTUM = box(4.0, 4.0, 2.5)
FRUSTUM[FRUSTUM[:, 2] > 0.0] *= [0.7, 0.8, 1.0]


def print_work(points: np.ndarray, options: dict[str, Any], **more: Any) -> Work:
    entries = {"size_mm": 30.0, "print": options, **more.pop("entries", {})}
    work = run_to_design(points, entries=entries, directions=more.pop("directions", SIDES), **more)
    run_stages(work, after="design", last="tolerances")
    return work


def test_tolerances_of_a_box() -> None:
    result = print_work(box(4.0, 5.0, 6.0), {}).result()
    tolerances = result.tolerances
    assert result.infill is None
    # Opposite sides are equal.
    np.testing.assert_allclose(tolerances.deviations[:3], tolerances.deviations[3:], rtol=1e-6)
    squares = sum(np.square(one) for one in tolerances.by_error.values())
    np.testing.assert_allclose(np.square(tolerances.deviations), squares)
    assert 0.05 < tolerances.allowed_mm < 1.0
    assert 0.05 < tolerances.noticed < 0.5


def test_errors_are_those_of_the_recipe() -> None:
    options = {"errors": {"dimensional_mm": 0.3, "bubble_mm3": 0.0}}
    usual = print_work(box(4.0, 5.0, 6.0), {}).result().tolerances
    section = print_work(box(4.0, 5.0, 6.0), options).result().tolerances
    ratio = np.divide(section.by_error["dimensional_mm"], usual.by_error["dimensional_mm"])
    np.testing.assert_allclose(ratio, 0.3 / usual.assumed["dimensional_mm"])
    assert section.by_error["bubble_mm3"] == (0.0,) * 6
    assert section.assumed["dimensional_mm"] == 0.3
    assert section.allowed_mm == usual.allowed_mm


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
    assert section.max_abs_error > 1e-3
    assert section.advice in hollow.notes
    half = print_work(FRUSTUM, {"infill": 0.5, "walls_mm": 2.0}).result().infill
    assert 0.0 < half.max_abs_error < section.max_abs_error


def _uniform(points: np.ndarray) -> tuple[float, np.ndarray]:
    hull = convex_hull(points)
    ends = hull.vertices[hull.triangles] - hull.centroid
    return float(np.linalg.det(ends).sum() / 6.0), hull.centroid


def test_labels_take_infill_away() -> None:
    depth, walls = 1.0, 1.0
    options = {"infill": 0.1, "walls_mm": walls}
    entries = {"engrave": {"depth_mm": depth, "balance": "none"}}
    work = print_work(FRUSTUM, options, entries=entries)
    section, engraved = work.result().infill, work.engraved
    surface = Surface(engraved.points, engraved.triangles)
    hull = convex_hull(surface.points)
    points = points_inside(hull, 300_000)
    spread = np.ptp(hull.vertices, axis=0).prod() / 300_000
    deep = points[depths(hull, points).min(axis=1) > walls]
    lost = deep[in_pocket_walls(surface, hull, deep, depth, walls)]
    # The print lacks mass in infill; the walls around labels are solid.
    lacking = (1.0 - section.mass) * surface.volume / 0.9
    plain = inside_walls(hull, walls)
    few = 4.0 / np.sqrt(len(lost))
    assert few < 0.04
    volume = plain[0] - lacking
    assert volume == pytest.approx(spread * len(lost), rel=few)
    moved = section.mass * surface.volume * np.array(section.shift_mm) / 0.9
    moment = lacking * surface.centroid - moved
    center = (plain[0] * plain[1] - moment) / volume
    np.testing.assert_array_less(np.abs(center - lost.mean(axis=0)), few * lost.std(axis=0))


def test_infill_with_a_hidden_hollow_is_not_computed() -> None:
    entries = {"engrave": {"balance": "opposite"}}
    work = print_work(FRUSTUM, {"infill": 0.1}, entries=entries)
    assert work.engraved is not None
    assert work.result().infill is None
    (note,) = [note for note in work.notes if "infill" in note]
    assert "hidden hollow" in note


@pytest.mark.parametrize("center", [None, np.array([0.1, 0.0, 0.05])])
def test_infill_with_a_given_center_of_mass_is_not_computed(center: np.ndarray | None) -> None:
    work = print_work(box(4.0, 5.0, 6.0), {"infill": 0.2}, center_of_mass=center)
    result = work.result()
    assert result.tolerances is not None
    assert (result.infill is None) == (center is not None)
    (note,) = [note for note in work.notes if "infill" in note]
    assert ("center of mass is given" in note) == (center is not None)


def test_a_thrown_die_spreads_by_its_probabilities_on_the_table() -> None:
    method = {"exact": {"probabilities": "thrown"}}
    work = print_work(FRUSTUM, {}, entries={"method": method})
    section = work.result().tolerances
    step = 0.02
    probabilities = []
    points = work.solid.points
    for factor in (1.0 + step, 1.0 - step):
        body, poses = rigid_body_with_rests(points * [1.0, 1.0, factor])
        places = np.argmax(SIDES @ poses.normals.T, axis=1)
        probabilities.append(
            momentum_probabilities(poses, body, momentum_model("board-game"))[places]
        )
    slope = np.abs(probabilities[0] - probabilities[1]) / (2.0 * step)
    # One of the axes that shrink.
    deviations = np.array(section.by_error["shrinkage"])
    assert (deviations > 0.9 * 0.002 * slope).all()
    resting = print_work(FRUSTUM, {}).result().tolerances
    assert np.abs(np.subtract(resting.deviations, section.deviations)).max() > 1e-4


def test_rounded_edges_move_with_their_facets() -> None:
    sharp = print_work(box(4.0, 5.0, 6.0), {}).result().tolerances
    entries = {"edges": {"radius_mm": 1.0}, "engrave": True, "size_mm": 30.0}
    rounded = print_work(box(4.0, 5.0, 6.0), {}, entries=entries).result().tolerances
    np.testing.assert_allclose(rounded.deviations, sharp.deviations, rtol=0.1)
