"""Design by any method, with checks of every accepted step, and of the result in 60 digits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import mpmath
import numpy as np

from benchmarks.stiff_designs import DesignProblem
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.optimize.clusters import cluster
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.solvers.candidate import DesignResult, DesignStep
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.solvers.paper import solve_paper
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.workers import one_tensor_thread
from tests.reference.measurement import Measurement, measure
from tests.reference.oracle import (
    DIGITS,
    exact,
    facet_polygons,
    oracle_probabilities,
    solid_centroid,
)
from tests.reference.problem import Problem

SUM_LIMIT = 1e-12
"""Tolerance on the sum of the probabilities of a step."""

ERROR_LIMIT = 1e-14
"""Tolerance on the recorded error against that of the designed hull, read back or in 60 digits;
larger if its probabilities magnify the rounding of coordinates."""


def watch_design(design: DesignProblem) -> tuple[Measurement | None, list[str], float, str]:
    """Run a design by its method, and list its faults. Raises as the method, except NoStartError.

    Returns the measurement of the designed hull against the oracle, or None if there was no first
    shape; the faults of the first step that has any; wall-clock seconds of the design; and its end
    in a few words with the error.
    """
    faults: list[str] = []
    dice: list[tuple[RestEvaluation, Floats]] = []

    def on_step(step: DesignStep) -> None:
        numbers = {**step.terms, "whole": step.energy, "error": step.error}
        step_found = step_faults(*dice[-1], numbers)
        if step_found and not faults:
            faults.extend(f"{fault} at step {step.step}" for fault in step_found)
        del dice[:-1]

    started = time.perf_counter()
    with one_tensor_thread():
        try:
            result = run_method(design, lambda *die: dice.append(die), on_step)
        except NoStartError as refused:
            return None, faults, time.perf_counter() - started, str(refused).partition(";")[0]
    seconds = time.perf_counter() - started
    measurement = measure(Problem(result.hull.vertices, design.center_of_mass))
    error = _end(design, result, measurement, faults)
    converged = result.status is Status.CONVERGED
    words = "converged" if converged else result.status.value.partition(";")[0]
    return measurement, faults, seconds, f"{words}, max |p - q| {error:.0e}"


def run_method(
    design: DesignProblem,
    on_die: Callable[[RestEvaluation, Floats], None],
    on_step: Callable[[DesignStep], None],
) -> DesignResult:
    """Run a design by its method, limited by its steps and not by the clock.

    on_die: called before `on_step` with the die of every accepted step and of the start, and the
    derivatives for its next direction: a gradient (n,) or a Jacobian (k, n).
    Raises NoStartError if the method finds no first shape.
    """
    watched: dict[str, Any] = {
        "center_of_mass": design.center_of_mass,
        "on_step": on_step,
        "on_candidate": lambda candidate: on_die(candidate.rests, candidate.probability_jacobian),
    }
    if design.method == "exact":
        exact = ExactOptions(
            coordinates=design.coordinates, tolerance=design.tolerance, evaluations=design.steps
        )
        return solve_exact(shapes_like(design.start, 0), design.target, exact, **watched)
    paper = PaperOptions(
        step="line_search" if design.method == "line search" else "momentum",
        steps=design.steps,
        perturbation=design.perturbation,
        finish="exact" if design.method == "paper with finish" else "none",
        tolerance=design.tolerance,
    )
    return solve_paper(
        design.start,
        design.target,
        paper,
        **watched,
        on_evaluation=lambda evaluation: on_die(evaluation.rests, evaluation.gradient),
    )


def _end(
    design: DesignProblem, result: DesignResult, measurement: Measurement, faults: list[str]
) -> float:
    """Error of a result in 60 digits. Adds to the faults."""
    center = design.center_of_mass
    poses = rest_poses(result.hull.vertices, center)
    of_rest = cluster(poses.normals, result.directions).of_rest
    sums = np.bincount(of_rest, poses.probabilities, len(design.target))
    read = float(np.abs(sums - design.target).max())
    # The probabilities of a tied body are means over several bodies.
    exact = read
    if not measurement.tied:
        hull = convex_hull(result.hull.vertices)
        exact = exact_outcome_error(hull, center, result.directions, design.target)
    for name, error in (("read back", read), ("in 60 digits", exact)):
        difference = abs(error - result.error)
        limit = measurement.limit(difference, ERROR_LIMIT)
        if not difference <= limit:
            faults.append(f"error recorded as {result.error:.3e} is {error:.3e} {name}")
        if result.status is Status.CONVERGED and not error <= design.tolerance + limit:
            faults.append(f"converged with an error of {error:.1e} {name}")
    return exact


def exact_outcome_error(
    hull: ConvexHull, center: Floats | None, directions: Floats, target: Floats
) -> float:
    """Largest |p - q| of a die, each rest counted for the outcome whose direction is nearest.

    hull: the die; center: (3,) center of mass, or None for that of the uniform solid in 60 digits;
    directions: (k, 3) unit; target: (k,).

    Raises OracleError if the die balances exactly.
    """
    with mpmath.workdps(DIGITS):
        vertices = exact(hull.vertices)
        middle = solid_centroid(vertices, hull.triangles) if center is None else center
        misses = -exact(target)
        probabilities = oracle_probabilities(vertices, facet_polygons(hull), [middle])
        for normal, probability in zip(hull.normals, probabilities, strict=True):
            misses[np.argmax(directions @ normal)] += probability
        return float(abs(misses).max())


def step_faults(
    rests: RestEvaluation, derivatives: Floats, numbers: Mapping[str, float]
) -> list[str]:
    """List the faults of an accepted step.

    rests: the die; derivatives: of any shape, for the next direction; numbers: terms of the energy
    and the error, by name.
    """
    hull, probabilities = rests.hull, rests.probability_values
    heights = hull.heights(rests.center_of_mass.detach().numpy())
    excess = float(probabilities.sum()) - 1.0
    checks = {
        "derivatives not finite": np.isfinite(derivatives).all(),
        f"volume {hull.surface.volume:.1e}": hull.surface.volume > 0.0,
        "center of mass lost": (heights > 0.0).all(),
        f"probabilities sum to 1 + {excess:.1e}": abs(excess) <= SUM_LIMIT,
        f"probability {probabilities.min():.1e}": (probabilities >= 0.0).all(),
        **{f"{name} {value}": np.isfinite(value) for name, value in numbers.items()},
    }
    return [fault for fault, is_right in checks.items() if not is_right]
