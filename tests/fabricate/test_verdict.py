"""Assessments of files of solids with known probabilities."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import CORNERS, NORMALS, roof

from dicedesign.fabricate.die import Assessment, assess_file
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.optimize.targets import Target
from dicedesign.results.parts import Status

CUBE = 10.0 * CORNERS


def verdict_on(corners: np.ndarray, directions: np.ndarray, target: np.ndarray) -> Assessment:
    hull = convex_hull(corners)
    wanted = Target(tuple("abcdefghijkl"[: len(target)]), target)
    return assess_file(stl_bytes(hull.surface), directions, wanted)


def test_a_box_in_its_file() -> None:
    """A box tips over its nearest edge, whose direction is also where two basins meet."""
    half = np.array([10.0, 9.0, 7.0])
    verdict = verdict_on(CUBE * half / 10.0, NORMALS, np.full(6, 1 / 6))
    assert verdict.outcomes.elsewhere == 0.0
    assert np.degrees(verdict.outcomes.least_angle) == pytest.approx(90.0, abs=1e-4)
    assert sorted(facet.label for facet in verdict.facets) == list("abcdef")
    for facet in verdict.facets:
        across = np.abs(facet.normal).argmax()
        sides = np.delete(half, across)
        assert facet.label == facet.outcome == "abcdef"[int(np.argmax(NORMALS @ facet.normal))]
        assert facet.polygon_area_mm2 == pytest.approx(4.0 * sides.prod(), rel=1e-6)
        assert facet.inradius_mm == pytest.approx(sides.min(), rel=1e-6)
        nearest = np.degrees(np.arctan(sides.min() / half[across]))
        assert facet.margin_deg == pytest.approx(nearest, abs=1e-4)
        assert facet.border_deg == pytest.approx(nearest, abs=1e-4)
    cube = verdict_on(CUBE, NORMALS, np.full(6, 1 / 6))
    assert cube.max_abs_error < 1e-7
    assert list(cube.flaws(1e-12)) == []


def test_a_facet_in_two_parts_is_one_outcome() -> None:
    """Either part may have the label; tipping over their ridge does not leave the outcome."""
    whole = verdict_on(CUBE, NORMALS, np.full(6, 1 / 6))
    verdict = verdict_on(10.0 * roof(0.6), NORMALS, np.full(6, 1 / 6))
    assert verdict.outcomes.rest_counts.tolist() == [1, 1, 1, 1, 1, 2]
    np.testing.assert_allclose(
        verdict.outcomes.probabilities, whole.outcomes.probabilities, atol=2e-3
    )
    assert np.degrees(verdict.margins).min() > 44.0
    assert list(verdict.flaws(2e-3)) == []
    labels = [facet.label for facet in verdict.facets if facet.outcome == "f"]
    assert sorted(labels, key=str) == [None, "f"]


def exact_verdict_on(corners: np.ndarray, directions: np.ndarray) -> Assessment:
    """Verdict on a body that has the wanted probabilities."""
    first = verdict_on(corners, directions, np.zeros(len(directions)))
    return verdict_on(corners, directions, first.outcomes.probabilities)


@pytest.mark.parametrize(("degrees", "flaws"), [(4.9, [Status.CROWDED]), (5.1, [])])
def test_two_outcomes_nearer_than_five_degrees_are_not_converged(degrees, flaws) -> None:
    half = np.radians(degrees / 2.0)
    below = np.array([[np.sin(half), 0.0, -np.cos(half)], [-np.sin(half), 0.0, -np.cos(half)]])
    verdict = exact_verdict_on(10.0 * roof(degrees), np.concatenate([NORMALS[:5], below]))
    assert verdict.max_abs_error == 0.0
    assert (verdict.outcomes.rest_counts == 1).all()
    assert list(verdict.flaws(1e-12)) == flaws


@pytest.mark.parametrize(("depth", "unsteady"), [(0.03, True), (0.5, False)])
def test_an_outcome_with_a_small_margin_is_not_converged(depth, unsteady) -> None:
    """An edge was cut off so little that the new facet is barely a rest."""
    near = 10.0 - depth
    flat = [(x, y, z) for x, y in ((10.0, near), (near, 10.0)) for z in (-10.0, 10.0)]
    corners = np.concatenate([CUBE[~(CUBE[:, :2] == 10.0).all(axis=1)], flat])
    directions = np.concatenate([NORMALS, [[np.sqrt(0.5), np.sqrt(0.5), 0.0]]])
    verdict = exact_verdict_on(corners, directions)
    assert verdict.outcomes.main[6] >= 0
    assert (Status.UNSTEADY in verdict.flaws(1e-12)) == unsteady


def test_rests_of_no_outcome_are_elsewhere() -> None:
    verdict = verdict_on(CUBE, NORMALS[:4], np.array([1 / 6, 1 / 6, 1 / 6, 0.5]))
    assert verdict.outcomes.elsewhere == pytest.approx(1 / 3, abs=1e-7)
    assert verdict.max_abs_error == pytest.approx(1 / 3, abs=1e-7)
    assert [facet.outcome for facet in verdict.facets].count(None) == 2
    assert list(verdict.flaws(0.1)) == [Status.OFF_TARGET, Status.STRAY]
    assert list(verdict.flaws(None)) == []
