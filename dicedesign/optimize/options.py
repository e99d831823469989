"""Options of the methods for convex dice, separate from the methods, so that reading a recipe loads
no method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from dicedesign.errors import InputError
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.terms import EnergyWeights
from dicedesign.runtime.registry import Options
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.tables import hand_named, with_hand

LARGEST_SMOOTHING = 1e6
"""Limit on lambda: beyond it the operator averages the whole surface, and its matrix is singular to
rounding."""

FINEST_TOLERANCE = 1e-15
"""Limit on tolerances, as rounding leaves errors of a few 1e-16."""

Tolerance = Annotated[float, Field(ge=FINEST_TOLERANCE, lt=1.0)]

Positive = Annotated[float, Field(gt=0.0)]

MOST_WORK = 250_000
"""Default limit on the evaluations of dice in a design by the exact method, times outcomes."""

MOST_DROPS = 10_000_000

MOST_ROUNDS = 50


@dataclass(frozen=True)
class SobolevOptions(Options):
    """The operator `(I + lambda L)^-p` of section 3.3.

    Attributes
    ----------
    smoothing: lambda, above 0 and at most `LARGEST_SMOOTHING`.
    power: p, 1 to 4.
    """

    smoothing: Annotated[float, Field(gt=0.0, le=LARGEST_SMOOTHING)] = 2.0
    power: Annotated[int, Field(ge=1, le=4)] = 2


@dataclass(frozen=True)
class RefineOptions(Options):
    """Options of `method.exact.refine`.

    Attributes
    ----------
    drops: simulated throws of the first round, 1 to `MOST_DROPS`; later rounds have more.
    rounds: most rounds of throwing a die and designing it again, 1 to `MOST_ROUNDS`; rounds end
        early when the expected error is `within` reach.
    verdict: throws that judge the finished die, 1 to `MOST_DROPS`.
    within: tolerance: largest total variation from the target in the verdict's throws; above 0 and
        below 1.
    engine: name of the simulator.
    """

    drops: Annotated[int, Field(ge=1, le=MOST_DROPS)] = 5_000
    rounds: Annotated[int, Field(ge=1, le=MOST_ROUNDS)] = 8
    verdict: Annotated[int, Field(ge=1, le=MOST_DROPS)] = 100_000
    within: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.01
    engine: str = "native"

    def __post_init__(self) -> None:
        super().__post_init__()
        # Raises if there is no such engine.
        ENGINES[self.engine]


def legible() -> Preferences:
    """Weights for large labels first, then for stable rests and a round die."""
    return Preferences(circles=1.0, margin=0.1, asymmetry=0.1, roundness=0.2)


@dataclass(frozen=True)
class ExactOptions(Options):
    """Options of `method: exact`.

    Attributes
    ----------
    tolerance: largest |p - q| wanted, from `FINEST_TOLERANCE` on and below 1.
    coordinates: "facets" moves half-spaces and keeps every facet flat; "vertices" moves vertices,
        so that facets become triangles.
    sobolev: Sobolev metric `(I + lambda L)^p` of the steps, with graph Laplacian L; requires
        `coordinates` "vertices". None for the Euclidean metric.
    prefer: weights of secondary objectives once the probabilities are met; by default large labels
        and stable rests. If any weight is given, all others are 0.
    probabilities: "resting" for a die set down without momentum, "thrown" for one thrown onto a
        table, by the momentum model.
    table: table of thrown dice: a name, or the path of a .json file.
    hand: throw distribution in place of the table's own: cup, hand or tower.
    refine: correction of the momentum model by simulated throws, for thrown probabilities; None for
        none.
    starts: most starting shapes that are tried, at least 1; fewer if a dozen reach the
        probabilities but not the recipe's `min_inradius_mm`.
    evaluations: most evaluations of dice, at least 1; the first shape with the wanted rests is
        tried in any case. None for `MOST_WORK` over the number of outcomes, about a minute's.
    seconds: wall-clock limit on the search, positive, or None. With a limit, the result depends on
        the speed of the machine.
    """

    tolerance: Tolerance = 1e-12
    coordinates: Literal["facets", "vertices"] = "facets"
    sobolev: SobolevOptions | None = None
    prefer: Preferences = field(default_factory=legible)
    probabilities: Literal["resting", "thrown"] = "resting"
    table: str = "board-game"
    hand: str | None = None
    refine: RefineOptions | None = None
    starts: Annotated[int, Field(ge=1)] = 60
    evaluations: Annotated[int, Field(ge=1)] | None = None
    seconds: Positive | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sobolev is not None and self.coordinates != "vertices":
            raise InputError(
                'sobolev: expected coordinates "vertices", whose gradient lives on the surface, '
                f"got {self.coordinates!r}; leave sobolev out or change coordinates"
            )
        if self.refine is not None and self.probabilities != "thrown":
            raise InputError(
                'refine: expected probabilities "thrown" with it, got "resting"; leave refine out, '
                "or write probabilities: thrown"
            )
        if self.hand is not None:
            if self.probabilities != "thrown":
                raise InputError(
                    f'hand: expected probabilities "thrown" with it, got {self.probabilities!r}; '
                    "leave hand out, or write probabilities: thrown"
                )
            # Raises if there is no such throw distribution.
            hand_named(self.hand)

    @property
    def table_with_hand(self) -> str:
        """Name of the table with its throw distribution, for `load_table`."""
        return with_hand(self.table, self.hand)


SOLID_ANGLE = (4.0 * np.pi) ** 2
"""Ratio of the dice energy in solid angles, the unit of published weights, to the dice energy in
probabilities (eq. 12)."""


class PaperWeights(EnergyWeights):
    """Weights of recipes and of the paper, relative to a dice energy in solid angles,
    `sum_i (A_i - 4 pi q_i)^2`; see `TERMS` for the terms. `of_probabilities` has them in the unit
    of eq. 12.

    With the defaults, every published target is reached from most starts; "apart" is not in the
    paper. Raises InputError for a number out of range.
    """

    __slots__ = ()

    defaults: ClassVar[Mapping[str, float]] = {
        "coplanar": 2.0,
        "barycenter": 0.1,
        "neighbor": 2.0,
        "neighbor_radius": 0.1,
        "apart": 0.15,
        "hold": 0.5,
        "clear": 0.1,
    }

    @property
    def of_probabilities(self) -> EnergyWeights:
        """Equivalent weights relative to the dice energy in probabilities (eq. 12)."""
        numbers = self.as_dict()
        for term, _ in self.active:
            if term.weight is not None:
                numbers[term.name] *= 1.0 / SOLID_ANGLE
        return EnergyWeights(**numbers)


@dataclass(frozen=True)
class PaperOptions(Options):
    """Options of `method: paper`.

    Attributes
    ----------
    weights: weights of the terms beside the dice energy, in the paper's unit (`PaperWeights`).
        With momentum, "barycenter", "neighbor", "hold" and "clear" fade; all others are fixed.
    sobolev: preconditioning of the gradient, or None.
    step: "momentum", with steps of decreasing length that cross jumps of the energy, a line search
        from the best of them, and new tries from there; or "line_search", the paper's, which stops
        at a jump and ignores the terms "hold" and "clear".
    steps: limit on the steps of the first try, rejected ones included with momentum, at least 0.
    hops: limit on the new tries with momentum, from the best shape with noise on its vertices, each
        with 4/9 of the steps; 0 to 100.
    perturbation: standard deviation of the seeded noise on the vertices of the start, whose half
        extent is 1; from 0 on and below 1.
    finish: "exact" replaces each outcome's facets by one and continues with the exact method, where
        the terms no longer act; "none" ends as in the paper.
    tolerance: largest |p - q| wanted, from `FINEST_TOLERANCE` on and below 1; None for 1e-12 with
        an exact finish and 2e-2 without.
    prefer: weights of secondary objectives after an exact finish; see `ExactOptions`.
    """

    weights: PaperWeights = field(default_factory=PaperWeights)
    sobolev: SobolevOptions | None = None
    step: Literal["momentum", "line_search"] = "momentum"
    steps: Annotated[int, Field(ge=0)] = 900
    hops: Annotated[int, Field(ge=0, le=100)] = 4
    perturbation: Annotated[float, Field(ge=0.0, lt=1.0)] = 1e-3
    finish: Literal["exact", "none"] = "exact"
    tolerance: Tolerance | None = None
    prefer: Preferences = field(default_factory=legible)

    @property
    def effective_tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.tolerance is not None:
            return self.tolerance
        return 1e-12 if self.finish == "exact" else 2e-2
