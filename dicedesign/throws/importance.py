"""Points of the unit cube by their weights under a posterior, drawn where that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import expit, log_expit, logit, logsumexp
from scipy.stats import multivariate_t, qmc

from dicedesign.runtime.arrays import Floats

DEGREES: Final = 5.0
"""Of freedom of the t distributions that points are drawn from, whose tails are heavier than those
of a posterior."""

WIDER: Final = 1.3
"""Factor on their covariance, for the same reason."""

FEWEST: Final = 60.0
"""Equally weighted points that a covariance is from, at least: weights that leave fewer are raised
to a power below 1 until they do not."""

MOST_ROUNDS: Final = 8
"""Of points that are drawn before those for the posterior without each of the counts."""


@dataclass(frozen=True)
class WeightedPoints:
    """Points with the likelihoods of several counts.

    Attributes
    ----------
    points: (n, d) of the unit cube, in which the prior is flat.
    log_priors: (n,) logarithms of the prior over the density that the points were drawn with.
    log_likelihoods: (n, c) of each of c counts.
    """

    points: Floats
    log_priors: Floats
    log_likelihoods: Floats

    def weights(self, without: int | None = None, power: float = 1.0) -> Floats:
        """(n,) summing to 1, of the posterior of all counts, or of all but one of them; power: of
        each weight before they are scaled."""
        kept = [i for i in range(self.log_likelihoods.shape[1]) if i != without]
        logarithms = power * (self.log_priors + self.log_likelihoods[:, kept].sum(axis=1))
        return np.asarray(np.exp(logarithms - logsumexp(logarithms)))


def effective(weights: Floats) -> float:
    """How many equally weighted points would be as good as points with weights (n,)."""
    return float(1.0 / np.square(weights).sum())


def weighted_points(
    log_likelihoods: Callable[[Floats], Floats],
    dimensions: int,
    each: int,
    rng: np.random.Generator,
    *,
    leave_one_out: bool,
) -> WeightedPoints:
    """Points where the posterior is, by importance.

    Points are spread over the prior, and then drawn from t distributions of the mean and the
    covariance that the posterior has by the points before, of logits, which have no limits: once,
    or several times where the posterior is narrow beside the prior; and at last as many for the
    posterior without each of the counts. Each is weighted by the mixture of all densities that
    points were drawn with.

    Source: Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering,
    1995 (the balance heuristic).

    Parameters
    ----------
    log_likelihoods: of points (n, d), an array (n, c) for c counts.
    each: points for each distribution, a power of 2.
    leave_one_out: whether weights without one of the counts are wanted.
    """
    spread = qmc.Sobol(dimensions, rng=rng).random_base2(each.bit_length() - 1)
    points = np.clip(spread, 1e-9, 1.0 - 1e-9)
    found = WeightedPoints(points, np.zeros(len(points)), log_likelihoods(points))
    proposals: list[tuple[Floats, Floats]] = []

    def more(left_out: Sequence[int | None]) -> WeightedPoints:
        new = [_proposal(found, without) for without in left_out]
        proposals.extend(new)
        drawn = [
            multivariate_t(mean, covariance, DEGREES, seed=rng).rvs(each)
            for mean, covariance in new
        ]
        # A point at the very border of the cube has no weight in any case.
        added = np.clip(expit(np.concatenate(drawn)), 1e-12, 1.0 - 1e-12)
        points = np.concatenate([found.points, added])
        return WeightedPoints(
            points,
            -_log_density(points, proposals),
            np.concatenate([found.log_likelihoods, log_likelihoods(added)]),
        )

    for _ in range(MOST_ROUNDS):
        found = more([None])
        if effective(found.weights()) >= FEWEST:
            break
    counts = range(found.log_likelihoods.shape[1]) if leave_one_out else ()
    return more([None, *counts])


def _proposal(found: WeightedPoints, without: int | None) -> tuple[Floats, Floats]:
    """Mean (d,) and scale (d, d) of a t distribution for logits of points."""
    power, places = 1.0, logit(found.points)
    weights = found.weights(without)
    # Powers of the logarithms, as weights themselves may have come to 0.
    while effective(weights) < FEWEST:
        power /= 2.0
        weights = found.weights(without, power)
    mean = weights @ places
    offsets = places - mean
    return mean, WIDER * offsets.T @ (weights[:, None] * offsets)


def _log_density(points: Floats, proposals: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Logarithms (n,) of the mixture of the flat density over the cube and of proposals, in the
    cube."""
    places = logit(points)
    stretch = (log_expit(places) + log_expit(-places)).sum(axis=1)
    densities = [
        multivariate_t(mean, covariance, DEGREES).logpdf(places) - stretch
        for mean, covariance in proposals
    ]
    every = np.stack([np.zeros(len(points)), *densities])
    return np.asarray(logsumexp(every, axis=0) - np.log(len(every)))
