"""Probabilities of a die as smooth functions of the parameters of throws, the likelihood of counts
in unmeasured sessions, and weighted points of a posterior."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize
from scipy.spatial.distance import cdist
from scipy.special import expit, gammaln, log_expit, logit, logsumexp, xlogy
from scipy.stats import multivariate_t, qmc

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.sessions import Offsets, Prior
from dicedesign.throws.throw_counts import CountedDie

LENGTHS: Final = (0.05, 50.0)
"""Range of the correlation lengths, in units of the parameters' ranges; the upper end means no
influence."""

VARIANCES: Final = (1e-3, 20.0)
"""Range of the variance of logarithmic probabilities over the unit cube."""

EXCESSES: Final = (1e-5, 0.3)
"""Range of the noise variance in excess of the counting noise."""

LEVEL: Final = 4.0
"""Prior variance of the mean logarithmic probabilities about the mean of the observations."""

NODES: Final = 9
"""Nodes of the Gauss-Hermite rule, exact for polynomials of degree 17."""


class LogProbabilityProcess:
    """Gaussian process of noisy logarithmic probabilities at points of the unit cube.

    Its covariance is squared exponential with a length for each parameter. Lengths, variance and
    excess noise maximize the marginal likelihood.

    Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, sections 2.2 and
    5.4.

    Parameters
    ----------
    points: (n, d) in [0, 1]; values: (n,); noise: (n,) variances of the values.
    """

    def __init__(self, points: Floats, values: Floats, noise: Floats) -> None:
        self.points = points
        self.mean = float(np.average(values, weights=1.0 / (noise + EXCESSES[1])))
        residuals = values - self.mean
        squares = (points[:, None] - points[None]) ** 2
        dimensions = points.shape[1]

        def cost(logarithms: Floats) -> tuple[float, Floats]:
            scales = np.exp(-2.0 * logarithms[:dimensions])
            variance, excess = np.exp(logarithms[dimensions:])
            smooth = variance * np.exp(-0.5 * squares @ scales)
            factor = cho_factor(smooth + LEVEL + np.diag(noise + excess), lower=True)
            inverse = cho_solve(factor, np.eye(len(values)))
            weights = inverse @ residuals
            pull = inverse - np.outer(weights, weights)
            by_length = 0.5 * scales * np.einsum("ij,ijd->d", pull * smooth, squares)
            by_rest = (0.5 * np.sum(pull * smooth), 0.5 * excess * np.trace(pull))
            height = 0.5 * residuals @ weights + np.log(np.diag(factor[0])).sum()
            return float(height), np.concatenate([by_length, by_rest])

        limits = np.log([LENGTHS] * dimensions + [VARIANCES, EXCESSES])
        start = np.log([1.0] * dimensions + [0.3, 1e-3])
        likeliest = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=limits)
        self.lengths: Floats = np.exp(likeliest.x[:dimensions])
        self.variance, self.excess = np.exp(likeliest.x[dimensions:]).tolist()
        covariance = self._covariance(points) + np.diag(noise + self.excess)
        self._factor = cho_factor(covariance, lower=True)
        self._weights = cho_solve(self._factor, residuals)

    def _covariance(self, points: Floats) -> Floats:
        """(m, n) covariances between points (m, d) and the observed ones."""
        squares = cdist(points / self.lengths, self.points / self.lengths, "sqeuclidean")
        return np.asarray(self.variance * np.exp(-0.5 * squares) + LEVEL)

    def means(self, points: Floats) -> Floats:
        """Expected logarithmic probabilities (m,) at points (m, d)."""
        return np.asarray(self._covariance(points) @ self._weights + self.mean)

    def variances(self, points: Floats) -> Floats:
        """Variances (m,) of the logarithmic probabilities at points (m, d)."""
        solved = solve_triangular(self._factor[0], self._covariance(points).T, lower=True)
        return np.asarray(self.variance + LEVEL - np.square(solved).sum(axis=0))


BLOCK: Final = 2**13
"""Sets whose probabilities are computed at a time, to bound the memory."""


@dataclass(frozen=True)
class ProbabilitySurrogate:
    """Surrogate of the probabilities of one die's g outcomes, by independent processes.

    Attributes
    ----------
    die: the die with its counts.
    processes: g - 1; process j models the logarithm of the probability of outcome j over the sum of
        the probabilities of later outcomes.
    """

    die: CountedDie
    processes: tuple[LogProbabilityProcess, ...]

    @classmethod
    def through(cls, die: CountedDie, points: Floats, counts: Integers) -> ProbabilitySurrogate:
        """Surrogate of simulated counts (n, g) at points (n, d) of the unit cube.

        The ratios are fitted separately, as such ratios of multinomial counts are independent.

        Source: empirical logits, Cox, Analysis of Binary Data, 1970, chapter 3.
        """
        after = counts.sum(axis=1, keepdims=True) - counts.cumsum(axis=1)
        came, others = counts[:, :-1] + 0.5, after[:, :-1] + 0.5
        values, noise = np.log(came / others), 1.0 / came + 1.0 / others
        each = zip(values.T, noise.T, strict=True)
        return cls(die, tuple(LogProbabilityProcess(points, *process) for process in each))

    def probabilities(self, points: Floats, rng: np.random.Generator | None = None) -> Floats:
        """Expected probabilities (m, g) at points (m, d), or with a generator, random probabilities
        of the posterior, independent at each point."""
        left, probabilities = np.ones(len(points)), []
        for process in self.processes:
            logarithms = process.means(points)
            if rng is not None:
                spread = np.sqrt(process.variances(points))
                logarithms = logarithms + spread * rng.normal(size=len(points))
            part = expit(logarithms)
            probabilities.append(left * part)
            left = left * (1.0 - part)
        return np.stack([*probabilities, left], axis=1)

    def log_likelihood(self, points: Floats, concentration: Floats, exact: bool) -> Floats:
        """Log likelihood (m,) of the die's real counts at points (m, 5), without the number of
        their orders, minus its largest possible value.

        concentration: (m,) A of the Dirichlet distribution of the probabilities.
        exact: average the likelihood over the surrogate's uncertainty, instead of taking it at the
            expected probabilities, which is faster. The average of each outcome over later ones
            takes the expected probability that it is one of these.

        Source: a Dirichlet-multinomial count given the earlier ones is beta-binomial; Johnson, Kotz
        and Balakrishnan, Discrete Multivariate Distributions, 1997, chapter 35, section 13.
        """
        nodes, weights = np.polynomial.hermite_e.hermegauss(NODES if exact else 1)
        counts = self.die.counts
        after = counts.sum() - counts.cumsum()
        total, whole = np.zeros(len(points)), concentration[:, None]
        for j, process in enumerate(self.processes):
            means = process.means(points)[:, None]
            spread = np.sqrt(process.variances(points)) if exact else np.zeros(len(points))
            z = means + spread[:, None] * nodes
            kinds = np.array([counts[j], after[j]])
            each = -_log_rising(whole, kinds.sum())
            for count, part in zip(kinds, (expit(z), expit(-z)), strict=True):
                each = each + _log_rising(whole * part, count)
            best = xlogy(kinds, kinds / max(kinds.sum(), 1)).sum()
            total += logsumexp(each, axis=1, b=weights / weights.sum()) - best
            whole = whole * expit(-means)
        return total

    def by_session(self, prior: Prior, points: Floats, offsets: Offsets, exact: bool) -> Floats:
        """Log likelihoods (n, k) of the die's counts in sessions (k, 3) at points (n, d) of the
        prior; exact: see `log_likelihood`."""
        at_once = max(1, BLOCK // len(offsets))
        parts = []
        for first in range(0, len(points), at_once):
            block = points[first : first + at_once, None]
            sets = prior.session_points(block, offsets, self.die.material)
            concentration = np.repeat(prior.concentration(block), len(offsets))
            values = self.log_likelihood(sets.reshape(-1, sets.shape[-1]), concentration, exact)
            parts.append(values.reshape(sets.shape[:2]))
        return np.concatenate(parts)


def _log_rising(start: Floats, count: int) -> Floats:
    """Logarithm of start (start + 1) ... (start + count - 1)."""
    return np.asarray(gammaln(start + count) - gammaln(start))


def log_likelihoods(
    prior: Prior,
    surrogates: Sequence[ProbabilitySurrogate],
    points: Floats,
    offsets: Offsets,
    exact: bool,
) -> Floats:
    """(n, 1 + c) logarithms of the likelihoods of the counts of all c dice, and of all but each, at
    points (n, d) of the prior.

    They are averaged over equally likely sessions (k, 3). Dice with equal `session_key` share one.
    """
    by_hand = np.stack([one.by_session(prior, points, offsets, exact) for one in surrogates])
    keys = [one.die.session_key for one in surrogates]
    whole, without = np.zeros(len(points)), np.zeros((len(points), len(surrogates)))
    for key in dict.fromkeys(keys):
        members = [i for i, one in enumerate(keys) if one == key]
        together = _average(by_hand[members])
        whole += together
        for i in members:
            without[:, i] = _average(by_hand[[j for j in members if j != i]]) - together
    return np.column_stack([whole, whole[:, None] + without])


def _average(by_hand: Floats) -> Floats:
    """Logarithms (n,) of the likelihoods of dice (c, n, k), averaged over k sessions."""
    return np.asarray(logsumexp(by_hand.sum(axis=0), axis=1) - np.log(by_hand.shape[2]))


DEGREES: Final = 5.0
"""Degrees of freedom of the proposal t distributions, whose tails are heavier than a
posterior's."""

WIDER: Final = 1.3
"""Factor of the proposals' covariance, for heavier tails."""

FEWEST: Final = 60.0
"""Least effective sample size for a covariance; weights are raised to a power below 1 until it is
reached."""

MAX_ROUNDS: Final = 8
"""Largest number of rounds of points for the posterior of all counts."""


@dataclass(frozen=True)
class WeightedPoints:
    """Weighted points of a posterior of several counts.

    Attributes
    ----------
    points: (n, d) of the unit cube, in which the prior is flat.
    log_priors: (n,) logarithms of prior over proposal density.
    log_likelihoods: (n, 1 + c) of all c counts, and of all but each of them.
    """

    points: Floats
    log_priors: Floats
    log_likelihoods: Floats

    def weights(self, without: int | None = None, power: float = 1.0) -> Floats:
        """Weights (n,) with the sum 1 for the posterior of all counts, or all but one of them;
        power: exponent of each weight before normalization."""
        column = 0 if without is None else 1 + without
        logarithms = power * (self.log_priors + self.log_likelihoods[:, column])
        return np.asarray(np.exp(logarithms - logsumexp(logarithms)))


def effective(weights: Floats) -> float:
    """Effective sample size of points with weights (n,)."""
    return float(1.0 / np.square(weights).sum())


def sample_posterior(
    log_likelihoods: Callable[[Floats], Floats],
    dimensions: int,
    each: int,
    rng: np.random.Generator,
    *,
    leave_one_out: bool,
) -> WeightedPoints:
    """Sample a posterior by adaptive importance sampling.

    Points are spread over the prior, then drawn from t distributions of logits with the mean and
    covariance of the posterior by the earlier points: once, or several times if the posterior is
    much narrower than the prior; finally also for the posteriors without each of the counts.
    Weights refer to the mixture of all proposal densities.

    Source: Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering,
    1995 (the balance heuristic).

    Parameters
    ----------
    log_likelihoods: function of points (n, d) with values as in `WeightedPoints`.
    each: points for each proposal distribution, a power of 2.
    leave_one_out: whether weights without one of the counts are needed.
    """
    spread = qmc.Sobol(dimensions, rng=rng).random_base2(each.bit_length() - 1)
    points = np.clip(spread, 1e-9, 1.0 - 1e-9)
    sample = WeightedPoints(points, np.zeros(len(points)), log_likelihoods(points))
    proposals = []

    def add(left_out: Sequence[int | None]) -> WeightedPoints:
        new = [_proposal(sample, without, rng) for without in left_out]
        proposals.extend(new)
        # Points at the border of the cube have no weight anyway.
        drawn = expit(np.concatenate([proposal.rvs(each) for proposal in new]))
        added = np.clip(drawn, 1e-12, 1.0 - 1e-12)
        points = np.concatenate([sample.points, added])
        places = logit(points)
        stretch = (log_expit(places) + log_expit(-places)).sum(axis=1)
        densities = [np.zeros(len(points)), *(one.logpdf(places) - stretch for one in proposals)]
        return WeightedPoints(
            points,
            np.log(len(densities)) - logsumexp(densities, axis=0),
            np.concatenate([sample.log_likelihoods, log_likelihoods(added)]),
        )

    for _ in range(MAX_ROUNDS):
        sample = add([None])
        if effective(sample.weights()) >= FEWEST:
            break
    counts = range(sample.log_likelihoods.shape[1] - 1) if leave_one_out else ()
    return add([None, *counts])


def _proposal(points_so_far: WeightedPoints, without: int | None, rng: np.random.Generator) -> Any:
    """Proposal t distribution of logits of points."""
    power, places = 1.0, logit(points_so_far.points)
    weights = points_so_far.weights(without)
    # Powers of logarithms, as weights may underflow.
    while effective(weights) < FEWEST:
        power /= 2.0
        weights = points_so_far.weights(without, power)
    mean = weights @ places
    offsets = places - mean
    covariance = WIDER * offsets.T @ (weights[:, None] * offsets)
    return multivariate_t(mean, covariance, DEGREES, seed=rng)
