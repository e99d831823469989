"""Bias of a model of probabilities, learned from throws of several similar dice or tables.

The counts of a die on a table are Poisson numbers with means `n m exp(w . x)`, for n throws,
probabilities m in the model, and features x: how the die differs from one that was thrown, and the
table from the mean of its mixture. The weights w of each outcome have a Gaussian prior. Their
posterior is approximated by a Gaussian at its mode (Laplace). Of several guesses of the prior's
deviations, the one with the largest evidence is taken.

Sources: MacKay, Neural Computation 4(3), 1992 (evidence); McCullagh and Nelder, Generalized Linear
Models, 1989, section 6.4 (Poisson numbers with a given sum are multinomial).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr
from scipy.stats import chi2, ncx2

from dicedesign.results.parts import ByTable
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.distances import total_variation

MAX_STEPS = 50
"""Newton steps to the mode."""

CONVERGED = 1e-9
"""Change of a weight below which Newton's method has converged."""

SOFTENING = 0.5
"""Throws added to each outcome for the initial weights, so that logarithms are finite."""

MAX_DEVIATIONS = 30.0
"""Number of standard deviations at which ratios are cut off."""


@dataclass(frozen=True)
class Estimate:
    """Estimated outcome probabilities of a die on a table.

    Attributes
    ----------
    probabilities: (k,) with the sum 1. scatter: (k,) their standard deviations.
    """

    probabilities: Floats
    scatter: Floats


@dataclass
class Bias:
    """Logarithms of the probabilities of dice over those in the model.

    Attributes
    ----------
    deviations: (g, f) guesses of the prior standard deviations of the features' weights.
    """

    deviations: Floats
    _learned: list[tuple[Floats, Floats, Floats]] = field(default_factory=list)
    _fit: tuple[Floats, Floats] | None = None

    def learn(self, features: Floats, probabilities: Floats, counts: Integers) -> None:
        """Add counts (k,) of a die with features (f,) and model probabilities (k,)."""
        self._learned.append((features, probabilities, counts.astype(np.float64)))
        self._fit = None

    def logarithms(self, features: Floats) -> Floats:
        """(..., k) most likely logarithms at features (..., f)."""
        return features @ self._weights()[0].T

    def estimate(self, features: Floats, probabilities: Floats) -> Estimate:
        """Estimate for a die thrown onto t equally likely tables, from its features (t, f) and
        model probabilities (t, k) on each."""
        weights, covariances = self._weights()
        parts = probabilities * np.exp(features @ weights.T)
        sums = parts.sum(axis=0)
        # Derivatives of the logarithms of the sums in the weights.
        slopes = (parts / sums).T @ features
        means = sums / sums.sum()
        # Probabilities sum to 1, as the counts sum to the number of throws.
        variances = np.einsum("kfg,kf,kg->k", covariances, slopes, slopes)
        relative = (1.0 - 2.0 * means) * variances + means**2 @ variances
        return Estimate(means, means * np.sqrt(np.maximum(relative, 0.0)))

    def _weights(self) -> tuple[Floats, Floats]:
        """(k, f) most likely weights of each outcome, and their covariances (k, f, f)."""
        if self._fit is None:
            rows, probabilities, counts = map(np.array, zip(*self._learned, strict=True))
            fits = (_fit_weights(rows, probabilities, counts, guess) for guess in self.deviations)
            self._fit = max(fits, key=lambda fit: fit[2])[:2]
        return self._fit


def _fit_weights(
    features: Floats, probabilities: Floats, counts: Floats, deviations: Floats
) -> tuple[Floats, Floats, float]:
    """Most likely weights (k, f), their covariances (k, f, f), and the log evidence up to a
    constant, by Newton's method.

    For n series of throws: features (n, f), model probabilities (n, k), counts (n, k);
    deviations: (f,) of the prior.
    """
    expected = counts.sum(axis=1, keepdims=True) * probabilities
    precision = np.diag(deviations**-2.0)
    outcomes = probabilities.shape[1]
    weights = np.zeros((outcomes, len(deviations)))
    # The first feature is 1; a good guess whatever the others are.
    weights[:, 0] = np.log((counts.sum(0) + SOFTENING) / (expected.sum(0) + SOFTENING))
    for _ in range(MAX_STEPS):
        means = expected * np.exp(features @ weights.T)
        curvature = (means.T[:, None] * features.T) @ features + precision
        slopes = (counts - means).T @ features - weights @ precision
        steps = np.linalg.solve(curvature, slopes[..., None])[..., 0]
        weights = weights + steps
        if np.abs(steps).max() < CONVERGED:
            break
    logarithms = features @ weights.T
    likelihood = float((counts * logarithms - expected * np.exp(logarithms)).sum())
    likelihood -= 0.5 * float((weights**2 @ np.diag(precision)).sum())
    # Occam factor: posterior over prior deviation of each weight.
    left = np.linalg.slogdet(curvature)[1].sum() + 2.0 * outcomes * np.log(deviations).sum()
    return weights, np.linalg.inv(curvature), likelihood - 0.5 * float(left)


def expected_variation(estimate: Estimate, target: Floats) -> float:
    """Expected total variation between estimated probabilities and a target (k,).

    Source: the mean of the absolute value of a Gaussian, Leone, Nelson and Nottingham,
    Technometrics 3(4), 1961.
    """
    off, scatter = estimate.probabilities - target, estimate.scatter
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(np.clip(off / scatter, -MAX_DEVIATIONS, MAX_DEVIATIONS))
    means = scatter * np.sqrt(2.0 / np.pi) * np.exp(-0.5 * ratio**2)
    means += off * (1.0 - 2.0 * ndtr(-ratio))
    return float(means.sum() / 2.0)


OFTEN = 0.9
"""Share of the tables on which a die should be right."""

ROLLS = 1_000
"""Rolls by which a person would notice that a die is wrong."""

NOTICED = 0.01
"""Significance at which it is noticed: so often a perfect die would be, by chance."""

DEVIATIONS = (1.0, 0.1)
"""Prior deviations of the model's error: in common, and by each measure of a table. Large, so that
the estimates follow the throws rather than the model."""

SERIES = 40
"""Simulated series of throws that measure the effect of chance alone."""

SEED = 0


def measure_tables(
    target: Floats, measures: Floats, predicted: Floats, counts: Integers
) -> ByTable:
    """Probabilities of a die on each of t equally likely tables, from throws onto all of them.

    The logarithms of probabilities over the model's are assumed linear in the measures of a table.
    So throws onto all tables inform about each, and few throws onto each suffice.

    Parameters
    ----------
    target: (k,) wanted probabilities.
    measures: (t, d) of the tables. predicted, counts: (t, k) model probabilities and counts.
    """
    on_tables = _estimate_on_tables(measures, predicted, counts)
    values = np.abs(on_tables - target).sum(axis=1) / 2.0
    rng, chance = np.random.default_rng(SEED), []
    for _ in range(SERIES):
        drawn = rng.multinomial(counts.sum(axis=1), on_tables)
        by_chance = _estimate_on_tables(measures, predicted, drawn)
        chance.append([total_variation(*pair) for pair in zip(by_chance, on_tables, strict=True)])
    # Power of a chi-square test, from the noncentral distribution.
    degrees = max(len(target) - 1, 1)
    distances = ROLLS * ((on_tables - target) ** 2 / target).sum(axis=1)
    powers = ncx2.sf(chi2.isf(NOTICED, degrees), degrees, distances)
    return ByTable(
        probabilities=tuple(tuple(row) for row in on_tables.tolist()),
        values=tuple(values.tolist()),
        often=float(np.quantile(values, OFTEN)),
        worst=float(values.max()),
        chance_often=float(np.quantile(chance, OFTEN, axis=1).mean()),
        chance_worst=float(np.max(chance, axis=1).mean()),
        noticed=float(powers.mean()),
    )


def _estimate_on_tables(measures: Floats, predicted: Floats, counts: Integers) -> Floats:
    """(t, k) most likely probabilities on each table."""
    features = np.insert(measures, 0, 1.0, axis=1)
    bias = Bias(np.repeat(DEVIATIONS, [1, measures.shape[1]])[None])
    rows = list(zip(features, predicted, counts, strict=True))
    for row in rows:
        bias.learn(*row)
    return np.array([bias.estimate(row[None], model[None]).probabilities for row, model, _ in rows])
