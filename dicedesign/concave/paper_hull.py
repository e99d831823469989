"""Design of the hull of a surface by the paper's method, with a fixed center of mass (section
3.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from dicedesign.concave.hull_draft import HullDraft, exact_draft
from dicedesign.concave.hull_problem import DesignedHull, HullProblem
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.optimize.options import PaperOptions
from dicedesign.optimize.solvers.paper import solve_paper
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import analyze
from dicedesign.runtime.arrays import Floats

TRIALS = 10
"""Number of hulls from which the best is filled: section 5.2 asks for a careful search."""

MAX_WEIGHT_FACTOR = 4.0
"""Maximum factor of a weight, or divisor."""

PERTURBATIONS = 8
"""Number of random perturbations that test how sensitive the probabilities of a hull are."""

PERTURBATION = 1e-3
"""Their standard deviation in each coordinate, over the circumscribed radius."""

SCALED = ("coplanar", "barycenter", "neighbor", "apart")
"""Weights that are multiplied by random factors."""

CHOICE_SCALE = 1.0
"""Mean index of the choices that are tried."""


def search_hull(
    problem: HullProblem,
    choices: list[Floats],
    options: ConcavePaperOptions,
    random: np.random.Generator,
    on_step: Callable[[float, float], None],
    *,
    plain: bool,
) -> DesignedHull:
    """Design `TRIALS` hulls and return the best: one with the target probabilities, also when it is
    perturbed, and near the original; else the one with the smallest error.

    Parameters
    ----------
    choices: each (k, 3) unit directions of the outcomes, the cheapest first.
    options: options of the descents; their weights are multiplied by random factors.
    on_step: receives the energy and the largest |p - q| of every step.
    plain: whether the first trial takes the first choice and the given weights.
    """

    def cost(design: DesignedHull) -> tuple[float, float]:
        """Error above the tolerance, then the perturbed error plus displacement and shift of the
        center of mass."""
        missed = design.error if design.error > problem.tolerance else 0.0
        moved = float(norms(design.moved).mean() + norms(design.center_of_mass))
        return missed, _perturbed_error(problem, design) + moved

    designs = []
    for trial in range(TRIALS):
        own, chosen = options, choices[0]
        if trial > 0 or not plain:
            chosen = choices[int(random.exponential(CHOICE_SCALE)) % len(choices)]
            largest = np.log(MAX_WEIGHT_FACTOR)
            factors = np.exp(random.uniform(-largest, largest, len(SCALED)))
            given = options.weights.as_dict()
            scaled = {n: given[n] * f for n, f in zip(SCALED, factors.tolist(), strict=True)}
            own = replace(options, weights=options.weights.replace(**scaled))
        designs.append(descend_hull(problem, chosen, own, on_step))
    return min(designs, key=cost)


def descend_hull(
    problem: HullProblem,
    directions: Floats,
    options: ConcavePaperOptions,
    on_step: Callable[[float, float], None],
) -> DesignedHull:
    """Design a hull by a descent; it may have any error.

    directions: (k, 3) unit directions of the outcomes; on_step: as in `search_hull`. Vertices are
    matched with those of the original by the least sum of squared distances.
    """
    original = problem.hull.vertices
    design = solve_paper(
        Start(original, directions),
        problem.target,
        PaperOptions(
            weights=options.weights,
            sobolev=options.sobolev,
            step=options.step,
            steps=options.steps,
            hops=0,
            perturbation=0.0,
            finish="none",
        ),
        center_of_mass=np.zeros(3),
        drift=options.drift,
        on_step=lambda step: on_step(step.energy, step.error),
    )
    vertices, normals = design.hull.vertices, design.directions
    source = linear_sum_assignment(cdist(vertices, original, "sqeuclidean"))[1]
    draft = HullDraft.of(vertices, normals) if options.finish == "exact" else None
    exact = None if draft is None else exact_draft(problem, draft)
    if exact is not None:
        hull, normals = exact.rests.hull, exact.normals
        vertices, source = hull.vertices, source[hull.source]
    moved = np.zeros_like(original)
    moved[source] = vertices - original[source]
    poses = analyze(convex_hull(vertices), np.zeros(3), "given")
    error = outcome_probabilities(poses, normals).error(problem.target)
    return problem.designed(vertices, source, moved, normals, error)


def _perturbed_error(problem: HullProblem, design: DesignedHull) -> float:
    """Mean error of a design under random perturbations of its vertices."""
    random, errors = np.random.default_rng(0), []
    vertices = design.hull.vertices
    for _ in range(PERTURBATIONS):
        perturbed = vertices + PERTURBATION * random.normal(size=vertices.shape)
        try:
            poses = analyze(convex_hull(perturbed), design.center_of_mass, "given")
        except DiceError:
            # The center of mass is outside.
            errors.append(1.0)
        else:
            errors.append(outcome_probabilities(poses, design.directions).error(problem.target))
    return float(np.mean(errors))
