"""Every method of design behind one call, with a look at each of its steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Protocol

from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.paper_options import PaperOptions
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.optimize.starts.variations import shapes_like
from dicedesign.runtime.arrays import Floats
from tests.reference.problem import DesignProblem

__all__ = ["METHODS", "WatchedMethod"]

OnDie = Callable[[RestEvaluation, Floats], None]
"""Called before `on_step` with the die of a step, and the derivatives that its next direction is
made of: a gradient (n,) or a Jacobian (k, n)."""

OnStep = Callable[[DesignStep], None]


class WatchedMethod(Protocol):
    """A method on a stiff design, limited by the design's steps and never by the clock."""

    def __call__(self, design: DesignProblem, on_die: OnDie, on_step: OnStep) -> DesignResult:
        """Both are called with every accepted step, the start included.

        Raises NoStartError where the method finds no shape to begin with.
        """


def _exact(design: DesignProblem, on_die: OnDie, on_step: OnStep) -> DesignResult:
    options = ExactOptions(
        coordinates=design.coordinates, tolerance=design.tolerance, evaluations=design.steps
    )
    return solve_exactly(
        shapes_like(design.start, 0),
        design.target,
        options,
        center_of_mass=design.center_of_mass,
        on_step=on_step,
        on_candidate=lambda candidate: on_die(candidate.rests, candidate.odds_jacobian),
    )


def _paper(design: DesignProblem, on_die: OnDie, on_step: OnStep) -> DesignResult:
    options = PaperOptions(
        step="line_search" if design.method == "line search" else "momentum",
        steps=design.steps,
        perturbation=design.perturbation,
        finish="exact" if design.method == "paper with finish" else "none",
        tolerance=design.tolerance,
    )
    return descend_as_paper(
        design.start,
        design.target,
        options,
        center_of_mass=design.center_of_mass,
        on_step=on_step,
        on_evaluation=lambda evaluation: on_die(evaluation.rests, evaluation.gradient),
        on_candidate=lambda candidate: on_die(candidate.rests, candidate.odds_jacobian),
    )


METHODS: Final[Mapping[str, WatchedMethod]] = {
    "exact": _exact,
    "line search": _paper,
    "paper": _paper,
    "paper with finish": _paper,
}
"""By the names that `DesignProblem.method` takes."""
