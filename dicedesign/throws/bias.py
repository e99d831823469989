"""What a model of probabilities gets wrong of dice that are much alike, learned from throws of all
of them.

The counts of a die on a table are Poisson numbers with means `n m exp(w . x)`, for n throws,
probabilities m in the model, and features x of die and table: how the die differs from one that was
    thrown, and the
table from the one that is meant. The weights w of each outcome are Gaussian at first. Their most
likely values given all counts, and the curvature there, make a Gaussian again (Laplace). How large
the weights may be is not known beforehand where there are several guesses: that one is taken under
which the counts are the most likely.

Sources: MacKay, Neural Computation 4(3), 1992 (evidence); McCullagh and Nelder, Generalized Linear
Models, 1989, section 6.4 (Poisson numbers whose sum is given are multinomial).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.special import ndtr

from dicedesign.results.parts import OtherTables
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.distances import total_variation

MOST_STEPS: Final = 50
"""Newton steps to the most likely weights."""

SMALL: Final = 1e-9
"""Change of a weight below which they are found."""

SOFTENING: Final = 0.5
"""Throws added to each outcome where the steps begin, so that one that never came up has a
logarithm."""

CERTAIN: Final = 30.0
"""Standard deviations beyond which nothing lies."""


@dataclass(frozen=True)
class Estimate:
    """Probabilities of outcomes of a die on a table, as far as they are known.

    Attributes
    ----------
    probabilities: (k,) with the sum 1. scatter: (k,) standard deviations of them.
    """

    probabilities: Floats
    scatter: Floats


@dataclass
class Bias:
    """Logarithms of the probabilities of dice over those in the model.

    Attributes
    ----------
    deviations: (g, f) guesses of the standard deviations of the weights of the features, before any
        throws.
    """

    deviations: Floats
    _learned: list[tuple[Floats, Floats, Floats]] = field(default_factory=list)
    _fit: tuple[Floats, Floats] | None = None

    def learn(self, features: Floats, probabilities: Floats, counts: Integers) -> None:
        """Take note of counts (k,) of a die with features (f,), whose probabilities in the model
        are (k,)."""
        self._learned.append((features, probabilities, counts.astype(np.float64)))
        self._fit = None

    def logarithms(self, features: Floats) -> Floats:
        """(..., k) most likely logarithms at features (..., f)."""
        return features @ self._weights()[0].T

    def estimate(self, features: Floats, probabilities: Floats) -> Estimate:
        """Estimate for a die with features (f,) whose model probabilities are (k,)."""
        weights, covariances = self._weights()
        means = probabilities * np.exp(weights @ features)
        means = means / means.sum()
        # The sum of the probabilities is known, as that of the throws was.
        variances = np.einsum("kfg,f,g->k", covariances, features, features)
        relative = (1.0 - 2.0 * means) * variances + means**2 @ variances
        return Estimate(means, means * np.sqrt(np.maximum(relative, 0.0)))

    def _weights(self) -> tuple[Floats, Floats]:
        """(k, f) most likely weights of each outcome, and their covariances (k, f, f)."""
        if self._fit is None:
            rows, probabilities, counts = map(np.array, zip(*self._learned, strict=True))
            fits = (_most_likely(rows, probabilities, counts, guess) for guess in self.deviations)
            self._fit = max(fits, key=lambda fit: fit[2])[:2]
        return self._fit


def _most_likely(
    features: Floats, probabilities: Floats, counts: Floats, deviations: Floats
) -> tuple[Floats, Floats, float]:
    """Weights (k, f) and covariances (k, f, f) by Newton's method, for features (n, f),
    probabilities (n, k) and counts (n, k) of n series of throws, and the logarithm of the counts'
    likelihood, less what does not depend on the deviations (f,)."""
    expected = counts.sum(axis=1, keepdims=True) * probabilities
    precision = np.diag(deviations**-2.0)
    outcomes = probabilities.shape[1]
    weights = np.zeros((outcomes, len(deviations)))
    # Near the answer as a rule, whatever the features but the first, which is 1.
    weights[:, 0] = np.log((counts.sum(0) + SOFTENING) / (expected.sum(0) + SOFTENING))
    for _ in range(MOST_STEPS):
        means = expected * np.exp(features @ weights.T)
        curvature = (means.T[:, None] * features.T) @ features + precision
        slopes = (counts - means).T @ features - weights @ precision
        steps = np.linalg.solve(curvature, slopes[..., None])[..., 0]
        weights = weights + steps
        if np.abs(steps).max() < SMALL:
            break
    logarithms = features @ weights.T
    likelihood = float((counts * logarithms - expected * np.exp(logarithms)).sum())
    likelihood -= 0.5 * float((weights**2 @ np.diag(precision)).sum())
    # Of each weight the part of its deviation that the counts have left.
    left = np.linalg.slogdet(curvature)[1].sum() + 2.0 * outcomes * np.log(deviations).sum()
    return weights, np.linalg.inv(curvature), likelihood - 0.5 * float(left)


def expected_variation(estimate: Estimate, target: Floats) -> float:
    """The mean total variation between a target (k,) and probabilities that are known so far.

    Source: the mean of the absolute value of a Gaussian, Leone, Nelson and Nottingham,
    Technometrics 3(4), 1961.
    """
    off, scatter = estimate.probabilities - target, estimate.scatter
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(np.clip(off / scatter, -CERTAIN, CERTAIN))
    means = scatter * np.sqrt(2.0 / np.pi) * np.exp(-0.5 * ratio**2)
    means += off * (1.0 - 2.0 * ndtr(-ratio))
    return float(means.sum() / 2.0)


OFTEN: Final = 0.9
"""Part of the tables that a die is to be right on."""

DEVIATIONS: Final = (1.0, 0.1)
"""Of what the model gets wrong: in common, and by each measure of a table. Large enough for throws
to have their say, so that what is found is not nearer to the model than the die."""

SERIES: Final = 40
"""Series of throws that are drawn to see what chance alone does."""

SEED: Final = 0


@dataclass(frozen=True)
class Series:
    """Throws onto one table.

    Attributes
    ----------
    probabilities: (k,) in a model. counts: (k,) of the outcomes.
    """

    probabilities: Floats
    counts: Integers


def variations_on_tables(
    target: Floats, measures: Floats, others: Sequence[Series], meant: Series, drops: int
) -> OtherTables:
    """The total variation of a die on other tables than the one that is meant, from throws onto
    all.

    On each table the logarithms of its probabilities over those in a model are taken to be linear
    in what measures the table. So throws onto all tables tell of each, and few of each will do.

    Parameters
    ----------
    target: (k,) wanted probabilities. measures: (n, d) of the others, 0 for the table that is
        meant.
    others: n series of throws, of `drops` in all; meant: those onto the table that is meant.
    """
    on_tables = _probabilities_on_tables(measures, others, meant)
    values = [total_variation(probabilities, target) for probabilities in on_tables]
    rng, chance = np.random.default_rng(SEED), []
    frequencies = meant.counts / meant.counts.sum()

    def again(series: Series, probabilities: Floats) -> Series:
        """Simulate as many throws of a die with probabilities (k,)."""
        return Series(series.probabilities, rng.multinomial(series.counts.sum(), probabilities))

    for _ in range(SERIES):
        drawn = [
            again(one, probabilities) for one, probabilities in zip(others, on_tables, strict=True)
        ]
        by_chance = _probabilities_on_tables(measures, drawn, again(meant, frequencies))
        chance.append([total_variation(a, b) for a, b in zip(by_chance, on_tables, strict=True)])
    return OtherTables(
        drops,
        tuple(values),
        float(np.quantile(values, OFTEN)),
        max(values),
        float(np.quantile(chance, OFTEN, axis=1).mean()),
        float(np.max(chance, axis=1).mean()),
    )


def _probabilities_on_tables(
    measures: Floats, others: Sequence[Series], meant: Series
) -> list[Floats]:
    """The most likely probabilities (k,) on each of the other tables."""
    deviations = np.repeat(DEVIATIONS, [1, measures.shape[1]])
    bias, rows = Bias(deviations[None]), np.insert(measures, 0, 1.0, axis=1)
    bias.learn(np.eye(rows.shape[1])[0], meant.probabilities, meant.counts)
    for row, series in zip(rows, others, strict=True):
        bias.learn(row, series.probabilities, series.counts)
    return [
        bias.estimate(row, one.probabilities).probabilities
        for row, one in zip(rows, others, strict=True)
    ]
