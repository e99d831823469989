"""Hulls designed by the paper's descent, judged by the forward model."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from common.bumpy import bumpy_sphere
from common.hull_problems import choices_of, problem_of

from dicedesign import rest_poses
from dicedesign.concave.hull_problem import DesignedHull, HullProblem
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.paper_hull import descend_hull, search_hull
from dicedesign.rest.outcomes import outcome_probabilities


def error_of(design: DesignedHull, problem: HullProblem) -> float:
    """By the forward model."""
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    return outcome_probabilities(poses, design.directions).error(problem.target)


@pytest.mark.parametrize("finish", ["exact", "none"])
def test_descent_as_in_the_paper(finish: Literal["exact", "none"]) -> None:
    problem = problem_of(bumpy_sphere(1), [0.5, 0.5])
    steps: list[tuple[float, float]] = []
    options = ConcavePaperOptions(finish=finish, steps=100)
    directions = choices_of(problem)[0]
    design = descend_hull(problem, directions, options, lambda *step: steps.append(step))
    assert error_of(design, problem) == pytest.approx(design.error, abs=1e-9)
    energies = [energy for energy, _ in steps]
    assert min(energies) < energies[0]
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert np.isin(design.corners, problem.source).all()


def test_the_best_of_several_hulls_by_the_paper_is_taken() -> None:
    problem = problem_of(bumpy_sphere(1), [0.5, 0.5])
    choices = choices_of(problem)
    options, random = ConcavePaperOptions(steps=30), np.random.default_rng(1)
    design = search_hull(problem, choices, options, random, lambda *step: None, plain=True)
    first = descend_hull(problem, choices[0], options, lambda *step: None)
    assert error_of(design, problem) <= max(problem.tolerance, first.error)
