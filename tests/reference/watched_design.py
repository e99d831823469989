"""Design by any method, with checks of every accepted step, and of the result in 60 digits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
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
from tests.reference.oracle import exact_outcome_error
from tests.reference.problem import DesignProblem, Problem


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
    watch, result, ending = _Watch(), None, ""
    started = time.perf_counter()
    with one_tensor_thread():
        try:
            result = run_method(design, watch.on_die, watch.on_step)
        except NoStartError as refused:
            ending = str(refused).partition(";")[0]
    seconds, measurement = time.perf_counter() - started, None
    if result is not None:
        measurement = measure(Problem(result.hull.vertices, design.center_of_mass))
        error = _end(design, result, measurement, watch.faults)
        converged = result.status is Status.CONVERGED
        words = "converged" if converged else result.status.value.partition(";")[0]
        ending = f"{words}, max |p - q| {error:.0e}"
    return measurement, watch.faults, seconds, ending


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


def step_faults(
    rests: RestEvaluation, derivatives: Floats, terms: Mapping[str, float]
) -> list[str]:
    """List the faults of an accepted step.

    rests: the die; derivatives: of any shape, for the next direction; terms: of the energy, by
    name.
    """
    hull = rests.hull
    faults = [f"{name} energy {value}" for name, value in terms.items() if not np.isfinite(value)]
    if not np.isfinite(derivatives).all():
        faults.append("derivatives not finite")
    volume = hull.surface.volume
    if not volume > 0.0:
        faults.append(f"volume {volume:.1e}")
    if not (hull.heights(rests.center_of_mass.detach().numpy()) > 0.0).all():
        faults.append("center of mass lost")
    probabilities = rests.probabilities.detach().numpy()
    excess = float(probabilities.sum()) - 1.0
    if not abs(excess) <= SUM_LIMIT:
        faults.append(f"probabilities sum to 1 + {excess:.1e}")
    if (probabilities < 0.0).any():
        faults.append(f"probability {probabilities.min():.1e}")
    return faults


@dataclass
class _Watch:
    """Collects the faults of the first accepted step that has any."""

    faults: list[str] = field(default_factory=list)
    steps: int = 0
    _last: tuple[RestEvaluation, Floats] | None = None

    def on_die(self, rests: RestEvaluation, derivatives: Floats) -> None:
        self._last = rests, derivatives

    def on_step(self, step: DesignStep) -> None:
        rests, derivatives = self._last
        faults = step_faults(rests, derivatives, {**step.terms, "whole": step.energy})
        if not np.isfinite(step.error):
            faults.append(f"error {step.error}")
        if faults and not self.faults:
            self.faults = [f"{fault} at step {self.steps}" for fault in faults]
        self.steps += 1
