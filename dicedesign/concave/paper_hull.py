"""Designing the hull of a surface by the paper's method, the center of mass held (section 3.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from dicedesign.concave.hull_design import HullDraft, exact_draft
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
"""Hulls that are designed for one to be filled: section 5.2 asks for a careful search."""

SPREAD = 4.0
"""Largest factor on a weight, or part of it, in that search."""

SHAKES = 8
"""Times that a hull is shaken to see whether its probabilities stand what a fill leaves open."""

SHAKE = 1e-3
"""Standard deviation of that in each coordinate, over the circumscribed radius."""

SCALED = ("coplanar", "barycenter", "neighbor", "apart")
"""Weights that are multiplied by them."""

CHOICE_SCALE = 1.0
"""Mean place, among the choices, of the one that a trial is made with."""


def search_hull(
    problem: HullProblem,
    choices: list[Floats],
    options: ConcavePaperOptions,
    random: np.random.Generator,
    on_step: Callable[[float, float], None],
    *,
    plain: bool,
) -> DesignedHull:
    """The hull of `TRIALS` that has the probabilities, keeps them best when it is shaken and is
    nearest to the original's; the one that misses them by least, where none has them.

    Parameters
    ----------
    choices: each (k, 3) unit directions of the outcomes, the likeliest first.
    options: of the descents; their weights are multiplied by random factors.
    on_step: called with the energy and the largest |p - q| of every step.
    plain: whether the first trial takes the first choice and the weights as they are.
    """

    def cost(design: DesignedHull) -> tuple[float, float]:
        """Cost of a hull: its error, also when shaken, its displacement and the way of its center
        of mass."""
        missed = design.error if design.error > problem.tolerance else 0.0
        moved = float(norms(design.moved).mean() + norms(design.center_of_mass))
        return missed, _shaken_error(problem, design) + moved

    designs = []
    for trial in range(TRIALS):
        own, chosen = options, choices[0]
        if trial > 0 or not plain:
            chosen = choices[int(random.exponential(CHOICE_SCALE)) % len(choices)]
            # Those of the paper's regularizers and of apart, each times a factor of its own.
            factors = np.exp(random.uniform(-np.log(SPREAD), np.log(SPREAD), len(SCALED)))
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
    """Hull at the end of a descent, with any error.

    directions: (k, 3) unit directions of the outcomes; on_step: as in `search_hull`. The corners
    are told by the least sum of squared distances from those of the original.
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
    probabilities = outcome_probabilities(
        analyze(convex_hull(vertices), np.zeros(3), "given"), normals
    )
    return problem.designed(vertices, source, moved, normals, probabilities.error(problem.target))


def _shaken_error(problem: HullProblem, design: DesignedHull) -> float:
    """Mean error of a design whose corners are put somewhere near."""
    random, errors = np.random.default_rng(0), []
    for _ in range(SHAKES):
        shaken = design.hull.vertices + SHAKE * random.normal(size=design.hull.vertices.shape)
        try:
            poses = analyze(convex_hull(shaken), design.center_of_mass, "given")
        except DiceError:
            # The center of mass is outside then.
            errors.append(1.0)
            continue
        errors.append(outcome_probabilities(poses, design.directions).error(problem.target))
    return float(np.mean(errors))
