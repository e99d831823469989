"""Terms of the energy that a descent minimizes, and their weights: the terms of the paper, one that
keeps facets stable or unstable by a margin, and one that keeps outcomes apart.

Rests are clustered to outcomes by direction (section 3.2). An outcome without a rest, or without a
facet, always has a cost: the dice energy misses its whole target, and the barycenter, neighbor and
stability terms are at least what one facet can cost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final, TypeAlias

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Number, Numbers, Registry
from dicedesign.tolerances import SAME_REST_ANGLE

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.gradient.rest_probabilities import RestEvaluation
    from dicedesign.runtime.arrays import Floats, Integers


@dataclass(frozen=True)
class Clusters:
    """Outcome for which each rest counts.

    Attributes
    ----------
    of_rest: (r,) outcome of each rest.
    directions: (k, 3) the unit directions u_i of the outcomes.
    """

    of_rest: Integers
    directions: Floats

    def sums(self, probabilities: Tensor) -> Tensor:
        """(k,) summed probabilities (r,) of each cluster."""
        import torch

        zeros = torch.zeros(len(self.directions), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.of_rest), probabilities)

    @property
    def empty(self) -> int:
        """Number of outcomes without a rest."""
        return len(self.directions) - len(np.unique(self.of_rest))

    def means(self, rest_normals: Floats) -> tuple[Floats, Floats]:
        """Normalized mean normals (k, 3) of the clusters, from normals of all rests (r, 3), and the
        lengths (k, 1) of their sums. An empty cluster keeps its direction (section 3.2)."""
        sums = np.zeros_like(self.directions)
        np.add.at(sums, self.of_rest, rest_normals)
        length = np.sqrt((sums * sums).sum(-1))[:, None]
        means = np.where(length > 0.0, sums / np.where(length > 0.0, length, 1.0), self.directions)
        return means, length


def cluster(rest_normals: Floats, directions: Floats) -> Clusters:
    """Assign each rest (r, 3) to the nearest direction (k, 3) (section 3.2)."""
    return Clusters(np.argmax(rest_normals @ directions.T, axis=1), directions)


@dataclass(frozen=True)
class ClusteredRests:
    """The current shape of a descent, as energy terms see it.

    Attributes
    ----------
    rests: hull and rests; tensors are functions of its `vertices` (n, 3), such as
        `rests.center` (3,), `rests.probabilities` (r,), `rests.rest_normals` (r, 3),
        `rests.facet_depths` (m,), `rests.facet_areas` (m,) and `rests.facet_normals(facets)`.
    clusters: which outcome each rest counts for, and the outcomes' directions.
    target: (k,) target probabilities of the outcomes.
    """

    rests: RestEvaluation
    clusters: Clusters
    target: Floats

    @classmethod
    def of(cls, rests: RestEvaluation, directions: Floats, target: Floats) -> ClusteredRests:
        """Rests clustered by the nearest directions (k, 3), with target probabilities (k,)."""
        return cls(rests, cluster(rests.hull.normals[rests.facets], directions), target)

    @property
    def hull(self) -> ConvexHull:
        """The hull, as numbers."""
        return self.rests.hull

    @property
    def outcome_probabilities(self) -> Tensor:
        """(k,) of the outcomes."""
        return self.clusters.sums(self.rests.probabilities)

    @property
    def saddles(self) -> Tensor:
        """(s, 3) saddles of the rests."""
        return self.rests.saddles

    @property
    def maxima(self) -> Tensor:
        """(2 s, 3) maxima of the rests."""
        return self.rests.maxima


ValueAndGradient: TypeAlias = "Callable[[ClusteredRests, EnergyWeights], tuple[float, Floats]]"
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
    value_and_gradient: faster alternative for a term of the depths of facets
        (`RestEvaluation.depths`) or of the unit normals of rests: its value and its derivatives in
        the depths (m,) or normals (r, 3), as numbers.
    weight: default weight in recipes; None for a term that always has weight 1.
    options: other options in recipes, with names that no other term uses.
    single_rests: whether steps are refused that give an outcome a second rest.
    """

    evaluate: Callable[[ClusteredRests, EnergyWeights], Tensor]
    value_and_gradient: ValueAndGradient | None = None
    weight: float | None = 0.0
    options: tuple[TermOption, ...] = ()
    single_rests: bool = False


LARGEST_SQUARED_DISTANCE: Final = 4.0
"""Largest squared distance of two unit vectors: the cost of a cluster without a rest."""

SMALLEST_MEAN: Final = 1e-3
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


def differentiable(
    value_and_gradient: ValueAndGradient,
) -> Callable[[ClusteredRests, EnergyWeights], Tensor]:
    """Make `Term.evaluate` from `Term.value_and_gradient`."""

    def evaluate(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
        import torch

        value, gradient = value_and_gradient(state, weights)
        rests = state.rests
        varying = rests.facet_depths if gradient.ndim == 1 else rests.rest_normals
        return value + (torch.as_tensor(gradient) * (varying - varying.detach())).sum()

    return evaluate


def outcome_facets(normals: Floats, directions: Floats, depths: Floats) -> Integers:
    """Assign distinct facets (k,), with normals (m, 3), to the outcomes of directions (k, 3).

    The sum of cosines is largest. Among facets within `SAME_REST_ANGLE` of a direction, such as the
    parts of a broken facet, the one of largest depth (m,) is taken: two of equal depth can change
    places with the same stability energy. With m < k facets, only m outcomes have one.
    """
    # Imported late, as few energies use it.
    from scipy.optimize import linear_sum_assignment

    cosines = directions @ normals.T
    within = cosines > np.cos(SAME_REST_ANGLE)
    # Facets within the angle have at least 2, more than any cosine.
    gain = np.where(within, 3.0 + np.clip(depths, -1.0, 1.0), cosines)
    return np.asarray(linear_sum_assignment(-gain)[1], dtype=np.int64)


def stability_energy(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Energy that keeps one facet for each outcome stable and all others unstable by a margin, and
    its derivatives (m,) in the depths of the facets.

    A facet of depth s (`RestEvaluation.facet_depths`) costs `max(0, 1 - s / margin)^2` with an
    outcome, and `max(0, 1 + s / margin)^2` without. An outcome without a facet costs the most.
    Probabilities jump where a depth crosses zero; this barrier lets a smooth method move along the
    jump. Not in the paper.
    """
    normals, directions = state.hull.normals, state.clusters.directions
    depths, margin = state.rests.depths, weights.stability_margin
    wanted = outcome_facets(normals, directions, depths)
    signs = np.full(len(normals), -1.0)
    signs[wanted] = 1.0
    lacking = np.maximum(1.0 - signs * depths / margin, 0.0)
    least = (len(directions) - len(wanted)) * (1.0 + 1.0 / margin) ** 2
    return float(lacking @ lacking) + least, -2.0 / margin * signs * lacking


CLOSEST: Final = 1e-6
"""Squared distance of two directions below which the energy is constant, so that it is finite."""


def apart_energy(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Energy that keeps the mean normals m_i of outcomes a chord length d = `apart_distance` apart,
    and its derivatives (r, 3) in the unit normals of the rests.

    Each pair costs `-(1 - x)^2 ln x` for `x = |m_i - m_j|^2 / d^2` below 1. The value and two
    derivatives vanish at x = 1; below a distance of 1e-3 the energy is constant. Not in the paper,
    whose energy allows two outcomes to become one facet.
    """
    clusters, reach = state.clusters, weights.apart_distance**2
    normals = state.hull.normals[state.rests.paths.rests]
    means, lengths = clusters.means(normals)
    first, second = np.triu_indices(len(means), 1)
    offset = means[first] - means[second]
    squared = (offset * offset).sum(1)
    near = squared < reach
    first, second, squared = first[near], second[near], squared[near]
    part = np.maximum(squared, CLOSEST) / reach
    value = float((-((1.0 - part) ** 2) * np.log(part)).sum())
    steepness = 2.0 * (1.0 - part) * np.log(part) - (1.0 - part) ** 2 / part
    steepness = np.where(squared > CLOSEST, steepness, 0.0) / reach
    pull = (2.0 * steepness)[:, None] * offset[near]
    by_mean = np.zeros_like(means)
    np.add.at(by_mean, first, pull)
    np.add.at(by_mean, second, -pull)
    # Derivative of the normalization of each cluster's sum of normals.
    across = by_mean - means * (by_mean * means).sum(1)[:, None]
    return value, (across / np.where(lengths > 0.0, lengths, 1.0))[clusters.of_rest]


TERMS: Final = Registry(
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
            name="stability",
            line="keeps one facet for each outcome stable and all others unstable; 0 is the "
            "paper's energy",
            weight=0.1,
            options=(
                TermOption(
                    name="stability_margin",
                    default=0.05,
                    line="distance of a facet from the edge of (in)stability, over the "
                    "circumscribed radius, below which the term acts; above 0 and at most 1",
                    expected="a fraction above 0 and at most 1",
                    remedy="leave it out for 0.05",
                    allows=lambda margin: 0.0 < margin <= 1.0,
                ),
            ),
            single_rests=True,
            evaluate=differentiable(stability_energy),
            value_and_gradient=stability_energy,
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
            evaluate=differentiable(apart_energy),
            value_and_gradient=apart_energy,
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
                if number.name in declared:
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

    @property
    def single_rests(self) -> bool:
        """Whether a term with a weight requires one rest for each outcome and no other."""
        return any(term.single_rests for term, _ in self.active)
