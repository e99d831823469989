"""A design with every accepted step looked at, and its end measured in 60-digit arithmetic."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dicedesign.bench.bodies.problem import DesignProblem, Problem
from dicedesign.bench.reference.measurement import Measurement, measure
from dicedesign.geometry.solid import solid_properties
from dicedesign.optimize.energy.clusters import cluster
from dicedesign.optimize.energy.objective import Evaluation
from dicedesign.optimize.options import DescentOptions, Stopping
from dicedesign.optimize.result import DesignResult
from dicedesign.optimize.solvers.descent import descend_to_target
from dicedesign.rest.poses import rest_poses
from dicedesign.results.status import Status
from dicedesign.runtime.threads import one_tensor_thread

__all__ = ["WatchedDesign", "step_faults", "watch_design"]

SUM_LIMIT: Final = 1e-12
"""By how much the probabilities of a step may miss 1."""

ERROR_LIMIT: Final = 1e-9
"""By how much the recorded error may differ from that of the designed hull, read back."""


@dataclass(frozen=True)
class WatchedDesign:
    """What became of a design.

    Attributes
    ----------
    result: of the descent.
    measurement: of the designed hull, against the oracle.
    error: largest |p - q| of the designed hull, each rest counted for the nearest outcome.
    faults: what must not happen and did, with the step at which it did first.
    largest_gradient: largest entry of a gradient on the way.
    seconds: wall-clock time of the design.
    """

    result: DesignResult
    measurement: Measurement
    error: float
    faults: tuple[str, ...]
    largest_gradient: float
    seconds: float

    @property
    def ending(self) -> str:
        """How it ended, in a few words with the error."""
        status = self.result.status
        if status is Status.CONVERGED:
            return f"converged, max |p - q| {self.error:.0e}"
        return f"{status.value.partition(';')[0]}, max |p - q| {self.error:.0e}"


def watch_design(design: DesignProblem) -> WatchedDesign:
    """Run a design. Raises as `descend_to_target`."""
    watch = _Watch()
    options = DescentOptions(
        coordinates=design.coordinates,
        stopping=Stopping(design.tolerance, design.steps, design.seconds),
        perturbation=design.perturbation,
    )
    started = time.perf_counter()
    with one_tensor_thread():
        result = descend_to_target(
            design.start,
            design.target,
            options,
            center_of_mass=design.center_of_mass,
            on_evaluation=watch,
        )
    seconds = time.perf_counter() - started
    center = design.center_of_mass
    poses = rest_poses(result.hull.vertices, center)
    of_rest = cluster(poses.normals, result.directions).of_rest
    sums = np.bincount(of_rest, poses.probabilities, len(design.target))
    error = float(np.abs(sums - design.target).max())
    recorded = result.history[-1].error
    if not abs(error - recorded) <= ERROR_LIMIT:
        watch.faults.append(f"error recorded as {recorded:.1e} is {error:.1e}")
    if result.status is Status.CONVERGED and not error <= design.tolerance + SUM_LIMIT:
        watch.faults.append(f"converged with an error of {error:.1e}")
    return WatchedDesign(
        result,
        measure(Problem(result.hull.vertices, center)),
        error,
        tuple(watch.faults),
        watch.largest_gradient,
        seconds,
    )


def step_faults(evaluation: Evaluation) -> list[str]:
    """What is wrong with an accepted step, each in a few words."""
    hull = evaluation.rests.hull
    faults = [f"{name} energy {v}" for name, v in evaluation.values.items() if not np.isfinite(v)]
    if not np.isfinite(evaluation.gradient).all():
        faults.append("gradient not finite")
    volume = solid_properties(hull.vertices, hull.triangles)[0]
    if not volume > 0.0:
        faults.append(f"volume {volume:.1e}")
    if not (hull.heights(evaluation.rests.center.detach().numpy()) > 0.0).all():
        faults.append("center of mass lost")
    probabilities = evaluation.rests.probabilities.detach().numpy()
    excess = float(probabilities.sum()) - 1.0
    if not abs(excess) <= SUM_LIMIT:
        faults.append(f"probabilities sum to 1 + {excess:.1e}")
    if (probabilities < 0.0).any():
        faults.append(f"probability {probabilities.min():.1e}")
    return faults


@dataclass
class _Watch:
    """Called with every accepted step."""

    faults: list[str] = field(default_factory=list)
    largest_gradient: float = 0.0
    _steps: int = 0

    def __call__(self, evaluation: Evaluation) -> None:
        found = step_faults(evaluation)
        if found and not self.faults:
            self.faults = [f"{fault} at step {self._steps}" for fault in found]
        largest = float(np.abs(evaluation.gradient).max())
        self.largest_gradient = max(self.largest_gradient, largest)
        self._steps += 1
