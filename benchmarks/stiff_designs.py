"""Designs that are hard for a method, and how they end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.optimize.clusters import cluster
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.solvers.candidate import DesignStep
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.solvers.paper import solve_paper
from dicedesign.optimize.starts.search import shapes_like, shapes_near
from dicedesign.optimize.starts.shapes import prism, repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import Target, binomial, custom, fair, sum_of_dice
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.workers import one_tensor_thread
from tests.reference.measurement import Measurement, measure
from tests.reference.problem import Case, Problem, case
from tests.reference.stiff import off_balance

ERROR_LIMIT = 1e-14
"""Tolerance on the recorded error against that of the designed hull as read back; larger if its
probabilities magnify the rounding of coordinates."""


@dataclass(frozen=True)
class DesignProblem:
    """A design that is hard for its method.

    Attributes
    ----------
    start: shape and outcome directions.
    target: (k,) wanted probability of each direction.
    method: see `run_design`.
    coordinates: coordinates of the exact method.
    center_of_mass: (3,) in the coordinates of `start.points`, or None for the uniform solid.
    tolerance: largest |p - q| to end with.
    perturbation: noise on the start of a descent; 0 keeps its degeneracy.
    steps: limit on the accepted steps of a descent, or on the dice tried by the exact method.
    """

    start: Start
    target: Floats
    method: Literal["exact", "line search", "paper", "paper with finish"] = "line search"
    coordinates: Literal["facets", "vertices"] = "facets"
    center_of_mass: Floats | None = None
    tolerance: float = 1e-3
    perturbation: float = 1e-3
    steps: int = 400


AXES = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])

METHODS = {
    "paper, line search": {},
    "exact": {"method": "exact", "tolerance": 1e-12, "steps": 3000},
    "exact, vertices": {
        "method": "exact",
        "coordinates": "vertices",
        "tolerance": 1e-12,
        "steps": 150,
    },
    "paper": {"method": "paper"},
    "paper with finish": {"method": "paper with finish", "tolerance": 1e-12},
}
"""Changes of a design's fields by method."""


def design_cases() -> Iterator[Case]:
    """Yield every design with every method; quick ones converge quickly."""
    for design, method in product(_designs(), METHODS):
        # Each step by preferences takes as long as another design.
        if (design.name, method) != ("spread fair 60", "exact, vertices"):
            yield Case(
                f"design: {design.name}, {method}",
                partial(_by_method, design.build, method),
                quick=design.quick and method in ("paper, line search", "exact"),
                kind=f"designs, {method}",
            )


def _by_method(build: Callable[[], DesignProblem], name: str) -> DesignProblem:
    return replace(build(), **METHODS[name])


def _designs() -> Iterator[Case]:
    """Yield each design without a method."""
    for depth in (0.0, *(sign * 10.0**-power for power in (3, 6, 9, 12) for sign in (1.0, -1.0))):
        yield case(leaning, depth)
    yield case(_cornered)
    for power in (4, 5, 6):
        yield case(_improbable, 10.0**-power, quick=False)
        yield case(_improbable, 10.0**-power, is_searched=True, quick=False)
    yield case(_lopsided, quick=False)
    for power in (3, 6):
        yield case(_coin, 10.0**-power, quick=False)
    for factor in (0.1, 0.5, 2.0, 10.0):
        yield case(_stretched, factor, quick=0.1 < factor < 10.0)
    for build, argument in ((fair, 30), (sum_of_dice, [15, 16]), (binomial, 29), (fair, 60)):
        yield case(_spread, build, argument, quick=False)
    for power in (3, 6, 9, 12):
        yield case(near_facet, 10.0**-power, quick=power == 12)
    for power in (3, 8):
        yield case(coincident, 10.0**-power, quick=False)
    yield case(loaded_box)
    yield case(_symmetric)
    yield case(_exact, quick=False)


def leaning(depth: float) -> DesignProblem:
    """A leaning box with two opposite facets that are stable by a depth, in units of its height and
    width; unstable for negative depths."""
    lean = 1.0 - 2.0 * depth
    points = np.array(
        [[x + lean * z, y, z] for x, y, z in product((-0.5, 0.5), (-0.6, 0.6), (-0.5, 0.5))]
    )
    normals = AXES.copy()
    normals[:2, 2] = (-lean, lean)
    start = Start(points, unit_vectors(normals))
    return DesignProblem(start, fair(6).probabilities, perturbation=0.0)


def near_facet(distance: float) -> DesignProblem:
    """A center of mass at a distance from the middle of a facet."""
    start = repulsion(6, 0)
    hull = convex_hull(start.points)
    center = hull.polygon(0).mean(axis=0) - distance * hull.normals[0]
    return DesignProblem(start, fair(6).probabilities, center_of_mass=center)


def coincident(angle: float) -> DesignProblem:
    """Two of the seven facets with outcomes include a small angle in radians."""
    normals = repulsion(7, 0).directions.copy()
    axis = np.cross(normals[0], [0.0, 0.0, 1.0])
    turn = Rotation.from_rotvec(angle * axis / norms(axis))
    normals[1] = turn.apply(normals[0])
    start = Start(polyhedron_corners(normals, np.ones(7)), normals)
    return DesignProblem(start, fair(7).probabilities)


def loaded_box() -> DesignProblem:
    """A cube with a target that favors one face: all its paths are ties."""
    start = Start(np.array(list(product((-1.0, 1.0), repeat=3))), AXES)
    return DesignProblem(start, custom([0.3, *[0.14] * 5]).probabilities, perturbation=0.0)


def _cornered() -> DesignProblem:
    problem = off_balance(0.0, corner=True)
    poses = rest_poses(problem.points, problem.center)
    target = fair(len(poses.normals)).probabilities
    start = Start(problem.points, poses.normals)
    return DesignProblem(start, target, center_of_mass=problem.center, perturbation=0.0)


def _improbable(probability: float, is_searched: bool = False) -> DesignProblem:
    """Two of six outcomes have a small probability. is_searched: the start is a searched one."""
    target = custom([probability] * 2 + [0.25 - 0.5 * probability] * 4).probabilities
    start = _near(target) if is_searched else repulsion(6, 0)
    return DesignProblem(start, target, tolerance=0.1 * probability)


def _coin(probability: float) -> DesignProblem:
    target = np.array([1.0 - probability, probability])
    return DesignProblem(_near(target), target, tolerance=0.1 * probability)


def _near(target: Floats) -> Start:
    """First shape of a recipe without a start."""
    return next(start for start in shapes_near(target, 0) if start is not None)


def _lopsided() -> DesignProblem:
    return DesignProblem(repulsion(4, 0), custom([0.97, 0.01, 0.01, 0.01]).probabilities)


def _stretched(factor: float) -> DesignProblem:
    sphere = repulsion(6, 0)
    directions = unit_vectors(sphere.directions / [1.0, 1.0, factor])
    return DesignProblem(
        Start(sphere.points * [1.0, 1.0, factor], directions), fair(6).probabilities
    )


def _spread(build: Callable[..., Target], argument: int | list[int]) -> DesignProblem:
    target = build(argument).probabilities
    return DesignProblem(repulsion(len(target), 0), target)


def _symmetric() -> DesignProblem:
    return DesignProblem(prism(4), fair(4).probabilities, perturbation=0.0)


def _exact() -> DesignProblem:
    target = custom([0.1, 0.1, 0.2, 0.2, 0.2, 0.2])
    return DesignProblem(repulsion(6, 0), target.probabilities, tolerance=1e-12)


def run_design(design: DesignProblem) -> tuple[Measurement | None, list[str], float, str]:
    """Run a design by its method, limited by its steps and not by the clock. Raises as the method,
    except NoStartError.

    Returns the measurement of the designed hull, or None if there was no first shape; the faults of
    its steps and of its end; wall-clock seconds; and its end in a few words with the error of the
    hull as read back.
    """
    faults: list[str] = []

    def on_step(step: DesignStep) -> None:
        numbers = [*step.terms.values(), step.energy, step.error]
        if not np.isfinite(numbers).all():
            faults.append(f"a number of step {step.step} is not finite")

    watched: dict[str, Any] = {"center_of_mass": design.center_of_mass, "on_step": on_step}
    started = time.perf_counter()
    with one_tensor_thread():
        try:
            if design.method == "exact":
                exact = ExactOptions(
                    coordinates=design.coordinates,
                    tolerance=design.tolerance,
                    evaluations=design.steps,
                )
                result = solve_exact(shapes_like(design.start, 0), design.target, exact, **watched)
            else:
                paper = PaperOptions(
                    step="line_search" if design.method == "line search" else "momentum",
                    steps=design.steps,
                    perturbation=design.perturbation,
                    finish="exact" if design.method == "paper with finish" else "none",
                    tolerance=design.tolerance,
                )
                result = solve_paper(design.start, design.target, paper, **watched)
        except NoStartError as refused:
            return None, faults, time.perf_counter() - started, str(refused).partition(";")[0]
    seconds = time.perf_counter() - started
    measurement = measure(Problem(result.hull.vertices, design.center_of_mass))
    poses = rest_poses(result.hull.vertices, design.center_of_mass)
    of_rest = cluster(poses.normals, result.directions).of_rest
    sums = np.bincount(of_rest, poses.probabilities, len(design.target))
    error = float(np.abs(sums - design.target).max())
    limit = measurement.limit(abs(error - result.error), ERROR_LIMIT)
    is_converged = result.status is Status.CONVERGED
    if not abs(error - result.error) <= limit:
        faults.append(f"error recorded as {result.error:.3e} is {error:.3e} read back")
    if is_converged and not error <= design.tolerance + limit:
        faults.append(f"converged with an error of {error:.1e}")
    words = "converged" if is_converged else result.status.value.partition(";")[0]
    return measurement, faults, seconds, f"{words}, max |p - q| {error:.0e}"
