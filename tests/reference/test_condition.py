"""Conditions by the oracle, compared with derivatives of the model."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.gradient.rest_probabilities import evaluate_rests
from tests.reference.oracle_derivatives import derivative_condition, probability_condition
from tests.reference.random_hulls import random_hull
from tests.reference.stiff import grazing_body

torch.set_num_threads(1)


@pytest.mark.parametrize("number", [0, 1, 3, 4, 5, 7])
def test_conditions_are_near_the_bound_by_derivatives(number: int) -> None:
    """Random moves of coordinates change probabilities by a tenth to all of the largest possible
    change. The first three bodies are uniform."""
    problem = random_hull(number)[1]
    uniform = problem.center is None
    assert uniform == (number < 4)
    points = torch.tensor(problem.points, requires_grad=True)
    rests = evaluate_rests(points, None if uniform else torch.tensor(problem.center))
    reaches = np.repeat(norms(problem.points - rests.equilibria.center_of_mass), 3)
    if problem.center is not None:
        most = float((np.abs(rests.jacobian) @ reaches).max())
        assert 0.1 * most < probability_condition(rests.hull, problem.center) <= most

    along = np.random.default_rng(number).normal(size=problem.points.shape)
    slopes, bends = [], []
    for probability in rests.probabilities:
        (gradient,) = torch.autograd.grad(probability, points, create_graph=True)
        slope = (gradient * torch.tensor(along)).sum()
        (bend,) = torch.autograd.grad(slope, points, retain_graph=True)
        slopes.append(abs(slope.item()))
        bends.append(float(np.abs(bend.numpy().ravel()) @ reaches))
    most = max(bends) / max(slopes)
    source = rests.hull.source
    condition = derivative_condition(rests.hull, problem.center, along[source], np.zeros(3))
    assert 0.1 * most < condition <= most


@pytest.mark.parametrize("power", [3, 6, 9])
def test_conditions_grow_where_a_path_grazes(power: int) -> None:
    body = grazing_body(10.0**-power, 10.0 ** (-power - 2))
    assert body.center is not None
    hull = convex_hull(body.points)
    assert 0.01 < probability_condition(hull, body.center) * 10.0**-power < 10.0
    along = np.random.default_rng(power).normal(size=hull.vertices.shape)
    condition = derivative_condition(hull, body.center, along, np.zeros(3))
    assert 0.1 < condition * 10.0**-power < 1e3


def test_a_balanced_body_has_no_condition() -> None:
    """A frustum that overhangs its bottom, with the center of mass above an edge of that."""
    square = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
    hull = convex_hull(
        np.concatenate([np.c_[square, np.zeros(4)], np.c_[2 * square, np.full(4, 2)]])
    )
    assert probability_condition(hull, np.array([1.0, 0.25, 1.0])) == 0.0
