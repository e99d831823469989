"""Terms of the energy that a descent minimizes, and their weights: the terms of the paper, terms
that keep facets stable or unstable by a margin, and one that keeps outcomes apart.

An outcome without a rest, or without a facet, always has a cost: the dice energy misses its whole
target, and the barycenter and neighbor terms are at least what one facet can cost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Number, Numbers, Registry

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.clusters import ClusteredRests
    from dicedesign.runtime.arrays import Floats, Integers


ValueAndSlopes: TypeAlias = "Callable[[ClusteredRests, EnergyWeights], tuple[float, Floats]]"
"""See `Term`."""


@dataclass(frozen=True, kw_only=True)
class TermOption(Number):
    """An option of a term in recipes, besides its weight."""


@dataclass(frozen=True, kw_only=True)
class Term(Extension):
    """One term of the energy.

    Attributes
    ----------
    evaluate: the term without its weight, as a scalar tensor that is differentiable in the
        vertices, from the current shape and all weights and options, such as
        `weights.neighbor_radius`.
    value_and_slopes: faster alternative for a term of the depths of facets
        (`RestEvaluation.depths`) or of the unit normals of rests: its value and its derivatives in
        the depths (m,) or normals (r, 3), as numbers. Kernels do the rest of the chain rule.
    weight: default weight in recipes; None for a term that always has weight 1.
    options: other options in recipes, with names that no other term uses.
    """

    evaluate: Callable[[ClusteredRests, EnergyWeights], Tensor]
    value_and_slopes: ValueAndSlopes | None = None
    weight: float | None = 0.0
    options: tuple[TermOption, ...] = ()


LARGEST_SQUARED_DISTANCE = 4.0
"""Largest squared distance of two unit vectors: the cost of a cluster without a rest."""

SMALLEST_MEAN = 1e-3
"""Least length of the sum of a region's maxima that is normalized: maxima that cancel have no mean
direction, and the gradient is unbounded near that."""


def dice_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Sum of the squared differences of the outcomes' probabilities from the target, E_dice
    (eq. 12)."""
    import torch

    wanted = torch.as_tensor(state.target, dtype=torch.float64)
    return ((state.outcome_probabilities - wanted) ** 2).sum()


def coplanar_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Sum of the squared distances of rest normals over ordered pairs within a cluster, E_cl
    (eq. 13). For a cluster of n, it is 2 n times the sum of squared distances from the mean."""
    import torch

    clusters, normals = state.clusters, state.rests.rest_normals
    of_rest = torch.as_tensor(clusters.of_rest)
    counts = torch.bincount(of_rest, minlength=len(clusters.directions)).clamp_min(1)[:, None]
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    means = zeros.index_add(0, of_rest, normals) / counts
    return (2.0 * counts[of_rest] * (normals - means[of_rest]) ** 2).sum()


def barycenter_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Sum of the squared distances of rest normals from the barycenter of their cluster's region,
    the normalized mean of the maxima on its border, E_bc (eq. 14)."""
    import torch

    rests, clusters, paths = state.rests, state.clusters, state.rests.paths
    sides = clusters.of_rest[paths.basins]
    borders = np.flatnonzero(sides[:, 0] != sides[:, 1])
    energy = LARGEST_SQUARED_DISTANCE * clusters.empty * torch.ones((), dtype=torch.float64)
    if len(borders) == 0:
        return energy
    branch = np.stack([2 * borders, 2 * borders + 1], axis=1)
    outcome = np.repeat(sides[borders].ravel(), 2)
    peak = np.repeat(paths.maxima[branch][:, None, :], 2, axis=1).ravel()
    outcome, peak = np.unique(np.stack([outcome, peak]), axis=1)
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    sums = zeros.index_add(0, torch.as_tensor(outcome), rests.vertex_directions(peak))
    lengths = torch.linalg.vector_norm(sums, dim=1, keepdim=True)
    barycenters = sums / lengths.clamp_min(SMALLEST_MEAN)
    bordered = np.isin(clusters.of_rest, outcome)
    own = barycenters[clusters.of_rest[bordered]]
    return energy + ((rests.rest_normals[bordered] - own) ** 2).sum()


def neighbor_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Sum of the squared distances of facet normals from the directions u_i within a radius, for
    stable and unstable facets, E_nb (eq. 15). An outcome without a facet nearby costs the squared
    radius."""
    import torch

    directions, radius = state.clusters.directions, weights.neighbor_radius
    squared = ((directions[:, None, :] - state.hull.normals[None, :, :]) ** 2).sum(-1)
    outcome, facet = np.nonzero(squared < radius**2)
    alone = len(directions) - len(np.unique(outcome))
    offset = state.rests.facet_normals(facet) - torch.as_tensor(directions[outcome])
    return (offset**2).sum() + alone * radius**2


CLOSEST = 1e-6
"""Squared distance of two directions below which the energy is constant, so that it is finite."""


def apart_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Energy that keeps the mean normals m_i of outcomes a chord length d = `apart_distance` apart.

    Each pair costs `-(1 - x)^2 ln x` for `x = |m_i - m_j|^2 / d^2` below 1. The value and two
    derivatives vanish at x = 1; below a distance of 1e-3 the energy is constant. Not in the paper,
    whose energy allows two outcomes to become one facet.
    """
    import torch

    means, lengths, first, second = _near_means(state, weights)
    # An empty cluster keeps its direction.
    fixed = torch.as_tensor(np.where(lengths > 0.0, 0.0, means))
    of_rest = torch.as_tensor(state.clusters.of_rest)
    sums = fixed.index_add(0, of_rest, state.rests.rest_normals)
    unit = sums / torch.linalg.vector_norm(sums, dim=1, keepdim=True)
    squared = ((unit[first] - unit[second]) ** 2).sum(1)
    part = squared.clamp_min(CLOSEST) / weights.apart_distance**2
    return -((1.0 - part) ** 2 * part.log()).sum()


def apart_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Value and derivatives (r, 3) of the apart energy in the unit normals of the rests."""
    means, lengths, first, second = _near_means(state, weights)
    reach, of_rest = weights.apart_distance**2, state.clusters.of_rest
    if len(first) == 0:
        return 0.0, np.zeros((len(of_rest), 3))
    offset = means[first] - means[second]
    squared = (offset * offset).sum(1)
    part = np.maximum(squared, CLOSEST) / reach
    value = float((-((1.0 - part) ** 2) * np.log(part)).sum())
    steepness = 2.0 * (1.0 - part) * np.log(part) - (1.0 - part) ** 2 / part
    steepness = np.where(squared > CLOSEST, steepness, 0.0) / reach
    pull = (2.0 * steepness)[:, None] * offset
    by_mean = np.zeros_like(means)
    np.add.at(by_mean, first, pull)
    np.add.at(by_mean, second, -pull)
    # Derivative of the normalization of each cluster's sum of normals.
    across = by_mean - means * (by_mean * means).sum(1)[:, None]
    return value, (across / np.where(lengths > 0.0, lengths, 1.0))[of_rest]


def _near_means(
    state: ClusteredRests, weights: EnergyWeights
) -> tuple[Floats, Floats, Integers, Integers]:
    """Mean normals (k, 3) of the outcomes, the lengths (k, 1) of their sums, and the pairs of
    outcomes within `apart_distance`."""
    means, lengths = state.clusters.means(state.hull.normals[state.rests.facets])
    # Of unit vectors: |a - b|^2 = 2 - 2 a . b.
    first, second = np.nonzero(np.triu(means @ means.T > 1.0 - 0.5 * weights.apart_distance**2, 1))
    return means, lengths, first, second


LINEAR_FROM = 2.0
"""Lack of depth, in units of the margin, from which the hold energy grows linearly."""


def hold_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Energy that holds the facet of each outcome stable by a margin.

    A facet of depth s costs x^2 for x = `max(0, 1 - s / hold_margin)`, and 4 x - 4 beyond x = 2.
    The dice energy does not see an outcome about to lose its last rest, whose basin still has an
    area; this barrier turns the descent in time. Not in the paper.
    """
    depths = state.rests.facet_depths[state.bearing]
    lack = (1.0 - depths / weights.hold_margin).clamp_min(0.0)
    near = lack.clamp_max(LINEAR_FROM)
    return (near * (2.0 * lack - near)).sum()


def hold_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Value and derivatives (m,) of the hold energy in the depths of the facets."""
    depths, bearing = state.rests.depths, state.bearing
    lack = np.maximum(1.0 - depths[bearing] / weights.hold_margin, 0.0)
    near = np.minimum(lack, LINEAR_FROM)
    slopes = np.zeros(len(depths))
    slopes[bearing] = -2.0 / weights.hold_margin * near
    return float(near @ (2.0 * lack - near)), slopes


def clear_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Energy that keeps facets without an outcome unstable by a margin: a facet of depth s costs
    `max(0, 1 + s / clear_margin)^2`. Not in the paper."""
    others = np.delete(np.arange(len(state.hull.normals)), state.bearing)
    excess = (1.0 + state.rests.facet_depths[others] / weights.clear_margin).clamp_min(0.0)
    return (excess**2).sum()


def clear_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Value and derivatives (m,) of the clear energy in the depths of the facets."""
    excess = np.maximum(1.0 + state.rests.depths / weights.clear_margin, 0.0)
    excess[state.bearing] = 0.0
    return float(excess @ excess), 2.0 / weights.clear_margin * excess


def _margin(name: str, default: float) -> TermOption:
    return TermOption(
        name=name,
        default=default,
        line="depth over the circumscribed radius up to which the term acts, above 0 and at most 1",
        expected="a number above 0 and at most 1",
        remedy=f"leave it out for {default:g}",
        allows=lambda margin: 0.0 < margin <= 1.0,
    )


TERMS = Registry(
    "energy term",
    Term,
    builtin=(
        Term(
            name="dice",
            line="squared differences of the outcomes' probabilities from the target (eq. 12)",
            evaluate=dice_energy,
            weight=None,
        ),
        Term(
            name="coplanar",
            line="draws the rests of an outcome into one plane (lambda_cl of eq. 13)",
            evaluate=coplanar_energy,
            weight=0.1,
        ),
        Term(
            name="barycenter",
            line="draws an outcome's rests to the barycenter of its basin (lambda_bc of eq. 14)",
            evaluate=barycenter_energy,
            weight=2.0,
        ),
        Term(
            name="neighbor",
            line="draws facets near an outcome's direction to it (lambda_nb of eq. 15)",
            evaluate=neighbor_energy,
            weight=0.1,
            options=(
                TermOption(
                    name="neighbor_radius",
                    default=0.2,
                    line="chord length epsilon of the ball about an outcome's direction in eq. 15, "
                    "above 0 and at most 2",
                    expected="a chord length above 0 and at most 2",
                    remedy="leave it out for 0.2",
                    allows=lambda radius: 0.0 < radius <= 2.0,
                ),
            ),
        ),
        Term(
            name="apart",
            line="keeps outcomes from growing into one facet; 0 is the paper's energy",
            weight=0.0,
            options=(
                TermOption(
                    name="apart_distance",
                    default=0.4,
                    line="chord length between the mean normals of two outcomes below which the "
                    "term acts, from 0.01 to 2; 0.4 is 23 degrees",
                    expected="a chord length from 0.01 to 2",
                    remedy="leave it out for 0.4",
                    allows=lambda distance: 0.01 <= distance <= 2.0,
                ),
            ),
            evaluate=apart_energy,
            value_and_slopes=apart_slopes,
        ),
        Term(
            name="hold",
            line="holds the facet of each outcome stable; 0 is the paper's energy",
            weight=0.0,
            options=(_margin("hold_margin", 0.05),),
            evaluate=hold_energy,
            value_and_slopes=hold_slopes,
        ),
        Term(
            name="clear",
            line="keeps facets without an outcome unstable; 0 is the paper's energy",
            weight=0.0,
            options=(_margin("clear_margin", 0.03),),
            evaluate=clear_energy,
            value_and_slopes=clear_slopes,
        ),
    ),
    group="dicedesign.terms",
)


class EnergyWeights(Numbers):
    """Weights of the terms (eq. 16) and their other options; see `TERMS`. A term of weight 0 is not
    evaluated.

    Weights are relative to the dice energy in probabilities, `sum_i (p_i - q_i)^2` (eq. 12). A
    weight of a recipe or of `PaperWeights` is (4 pi)^2, about 158, times as large.

    Raises InputError for a number out of range.
    """

    __slots__ = ()

    prefix = "weights."

    defaults: ClassVar[Mapping[str, float]] = {}
    """Defaults of weights and options, if they differ from those of the terms."""

    @classmethod
    def list_numbers(cls) -> Mapping[str, Number]:
        """Weight and options of each term; terms that always have weight 1 have none."""
        declared: dict[str, Number] = {}
        for term in TERMS:
            weight = Number(
                name=term.name,
                default=term.weight or 0.0,
                line=term.line,
                expected="a number not below 0",
                remedy="0 leaves the term out",
                allows=lambda value: 0.0 <= value < np.inf,
            )
            for number in (*(() if term.weight is None else (weight,)), *term.options):
                if number.name in declared or hasattr(cls, number.name):
                    raise InputError(
                        f"energy term {term.name!r}: expected names of its own for its weight and "
                        f"its options, got {number.name!r}, which is taken; choose another"
                    )
                default = cls.defaults.get(number.name, number.default)
                declared[number.name] = replace(number, default=default)
        return declared

    @property
    def active(self) -> tuple[tuple[Term, float], ...]:
        """Terms with a weight above 0, and these weights, in order."""
        pairs = ((term, 1.0 if term.weight is None else getattr(self, term.name)) for term in TERMS)
        return tuple((term, weight) for term, weight in pairs if weight > 0.0)
