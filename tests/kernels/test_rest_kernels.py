"""The compiled kernels decide as the NumPy code does, or not at all."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import fields

import numpy as np
import pytest
from common.kernels import compiled_only, without_kernels

from dicedesign.errors import DiceError
from dicedesign.kernels import ops as kernels
from dicedesign.kernels.ops import Tie
from dicedesign.rest.basins import basin_areas, find_basins, tie_distance
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.morse import Separatrices, separatrices
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.tracing import trace_to_rests
from tests.reference.random_hulls import extreme_hulls

pytestmark = compiled_only


def answer(equilibria: Equilibria, kernel: bool) -> Separatrices | str | None:
    body = equilibria.hull, equilibria.center_of_mass, equilibria.tie_distance
    try:
        with nullcontext() if kernel else without_kernels():
            undecided = kernel and kernels.separatrices(*body) is None
            return None if undecided else separatrices(equilibria)
    except Tie:
        return "tied"
    except DiceError as error:
        return str(error)


@pytest.mark.parametrize("ties", [True, False])
def test_separatrices_are_those_of_numpy(ties: bool) -> None:
    undecided, bodies = 0, 0
    for hull in extreme_hulls(200, most=40):
        center = hull.centroid
        distance = tie_distance(hull, center) if ties else 0.0
        kernel, numpy_ = classify(hull, center, distance), classify(hull, center, distance)
        compiled, expected = answer(kernel, True), answer(numpy_, False)
        bodies += 1
        if compiled is None:
            undecided += 1
        elif isinstance(compiled, str):
            assert compiled == expected
        else:
            assert isinstance(expected, Separatrices)
            for name in (field.name for field in fields(Separatrices)):
                np.testing.assert_array_equal(getattr(compiled, name), getattr(expected, name))
            np.testing.assert_array_equal(kernel.growth_sign, numpy_.growth_sign)
            np.testing.assert_array_equal(kernel.side_sign, numpy_.side_sign)
    assert undecided < 0.02 * bodies


def test_without_kernels_probabilities_are_the_same() -> None:
    for hull in extreme_hulls(60, most=40):
        with without_kernels():
            expected = rest_poses(hull.vertices)
        poses = rest_poses(hull.vertices)
        assert len(poses.probabilities) == len(expected.probabilities)
        np.testing.assert_allclose(poses.probabilities, expected.probabilities, atol=1e-13)
        nearest = (poses.normals @ expected.normals.T).max(axis=1)
        np.testing.assert_allclose(nearest, 1.0, atol=1e-12)


def test_areas_and_destinations_are_those_of_numpy() -> None:
    answers = []
    for hull in extreme_hulls(120, most=40):
        center, facets = hull.centroid, np.arange(len(hull.normals))
        basins, *_ = find_basins(hull, center)
        areas = kernels.basin_areas(hull, basins.paths, center)
        destinations = kernels.destinations(hull, center, 0.0, facets)
        assert areas is not None
        answers.append(destinations is not None)
        with without_kernels():
            expected = basin_areas(basins.equilibria, basins.paths)
            np.testing.assert_allclose(areas, expected, rtol=1e-9, atol=2e-14)
            if destinations is not None:
                expected_facets = trace_to_rests(classify(hull, center), facets)
                np.testing.assert_array_equal(destinations, expected_facets)
    assert np.mean(answers) > 0.98
