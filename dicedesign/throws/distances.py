"""Distances between probabilities and throws, with their sampling error.

Frequencies of few throws differ from the probabilities of the die, and total variation adds up all
deviations. So it is not 0 even for a perfect die: its mean is the noise floor, with which every
total variation must be compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.sparse import eye_array, kron, vstack
from scipy.special import betaincinv, betaln, ndtri, xlog1py, xlogy

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import TRANSPORT_TOLERANCE


def jeffreys_means(counts: ArrayLike) -> Floats:
    """Posterior means (k,) of probabilities under Jeffreys' prior (all Dirichlet parameters 1/2).

    They are above 0 and sum to 1.

    Source: Jeffreys, Proc. R. Soc. A 186, 1946.
    """
    weights: Floats = np.asarray(counts, dtype=np.float64) + 0.5
    return weights / weights.sum()


def jeffreys_intervals(counts: ArrayLike, confidence: float) -> Floats:
    """(k, 2) equal-tailed credible intervals of probabilities under Jeffreys' prior.

    counts: (k,) at least 0. confidence: posterior probability of each interval, in (0, 1).
    """
    weights = np.asarray(counts, dtype=np.float64) + 0.5
    others = weights.sum() - weights
    # The upper limit also by its small tail: 1 less a tiny tail rounds to 1.
    tail = (1.0 - confidence) / 2.0
    limits = [betaincinv(weights, others, tail), 1.0 - betaincinv(others, weights, tail)]
    return np.stack(limits, axis=-1)


MAX_COUNTS: Final = 1_000_000
"""Counts drawn at a time, at most, unless one series has more."""


def draw_counts(probabilities: Floats, throws: int, series: int, seed: int) -> Iterator[Integers]:
    """Yield blocks (b, k) of random counts, `series` rows in all, from probabilities (k,).

    The size of a block does not change the counts.
    """
    random, at_once = np.random.default_rng(seed), max(1, MAX_COUNTS // len(probabilities))
    for first in range(0, series, at_once):
        yield random.multinomial(throws, probabilities, size=min(at_once, series - first))


DRAWS: Final = 10_000

SEED: Final = 0


@dataclass(frozen=True)
class MeasuredDistance:
    """Distance between given probabilities and the unknown probabilities of a die, from throws.

    Attributes
    ----------
    value: between the given probabilities and the frequencies; a total variation in 0 to 1, or a
        Wasserstein distance in radians, 0 to pi.
    interval: confidence interval of the distance of the unknown probabilities.
    noise_floor: mean of `value` for a die that has the given probabilities.
    """

    value: float
    interval: tuple[float, float]
    noise_floor: float


def total_variation(first: ArrayLike, second: ArrayLike) -> float:
    """Half the sum of absolute differences of two distributions (k,), 0 to 1: the largest
    difference in the probability of any event."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum() / 2.0)


def effective_counts(outcomes: ArrayLike, weights: ArrayLike, kinds: int) -> Floats:
    """Equivalent counts (k,) of throws of unequal weight, such as start directions that stand for
    cells of unequal area.

    They are proportional to the weighted frequencies. Their sum is the number of equally weighted
    throws with equal variance: the squared sum of the weights over the sum of their squares.
    Evenly spread start directions scatter less than that.

    Parameters
    ----------
    outcomes: (n,) outcome of each throw, 0 to k - 1.
    weights: (n,) positive.
    kinds: k.

    Source: Kish, Survey Sampling, 1965, section 11.7.
    """
    given = np.asarray(weights, dtype=np.float64)
    sums = np.bincount(np.asarray(outcomes), given, kinds)
    return np.asarray(sums * given.sum() / (given * given).sum())


def noise_floor(probabilities: ArrayLike, throws: float) -> float:
    """Mean total variation between the probabilities (k,) of a die and its frequencies.

    throws: at least 1; rounded down to a whole number.

    Source: the mean absolute deviation of a binomial distribution by De Moivre, 1730; Diaconis and
    Zabell, Statistical Science 6(3), 1991, eq. 1.1.
    """
    p = np.asarray(probabilities, dtype=np.float64)
    n = math.floor(throws)
    above = np.floor(n * p) + 1.0
    below = n - above + 1.0
    halves = np.exp(xlogy(above, p) + xlog1py(below, -p) - betaln(above, below))
    return float(halves.sum() / n)


def event_error(probabilities: Floats, throws: float, confidence: float) -> float:
    """Largest sampling error of an event's frequency, with `confidence` in (0, 1).

    By the normal limit z sqrt(m (1 - m) / n), where m is the largest of the probabilities (k,), but
    at least 1/2.
    """
    most = max(0.5, float(probabilities.max()))
    return -float(ndtri((1.0 - confidence) / 2.0)) * math.sqrt(most * (1.0 - most) / throws)


def measure_variation(
    counts: ArrayLike, probabilities: ArrayLike, confidence: float
) -> MeasuredDistance:
    """Total variation between given probabilities and the unknown ones of a thrown die, with its
    uncertainty.

    The interval holds for any probabilities, also the given ones, where neither the bootstrap nor
    the delta method does:

    - By the triangle inequality, total variation is wrong by at most the distance between the
      frequencies and the die's probabilities. The lower limit subtracts a quantile of that
      distance, from `DRAWS` series of throws drawn with a fixed seed.
    - Total variation is the largest difference in the probability of an event, and the frequencies
      show at least the difference in the event that differs most. The upper limit adds the
      sampling error of one event, `event_error`.

    Both take the die's probabilities as `jeffreys_means`. The lower limit is conservative if many
    labels deviate a little.

    Parameters
    ----------
    counts: (k,) at least 0, also those of `effective_counts`, with a sum of at least 1.
    probabilities: (k,) summing to 1.
    confidence: in (0, 1).
    """
    came = np.asarray(counts, dtype=np.float64)
    throws = float(came.sum())
    value = total_variation(came / throws, probabilities)
    estimate = jeffreys_means(came)
    distances = [
        np.abs(drawn / math.floor(throws) - estimate).sum(axis=1) / 2.0
        for drawn in draw_counts(estimate, math.floor(throws), DRAWS, SEED)
    ]
    scatter = float(np.quantile(np.concatenate(distances), (1.0 + confidence) / 2.0))
    error = event_error(estimate, throws, confidence)
    limits = max(0.0, value - scatter), min(1.0, value + error)
    return MeasuredDistance(value, limits, noise_floor(probabilities, throws))


TRANSPORT_DRAWS: Final = 200


def measure_transport(
    directions: ArrayLike, counts: ArrayLike, probabilities: ArrayLike, confidence: float
) -> MeasuredDistance:
    """Wasserstein distance between given probabilities of k rests and the unknown ones of a thrown
    body, with its uncertainty.

    By the triangle inequality it is wrong by at most the distance between the frequencies and the
    body's probabilities. Both limits are off by a quantile of that distance, from
    `TRANSPORT_DRAWS` series of throws drawn with a fixed seed from `jeffreys_means`. So the
    interval is conservative, but holds for the given probabilities, too.

    Parameters
    ----------
    directions: (k, 3) of the rests.
    counts: (k,) at least 0, also those of `effective_counts`, with a sum of at least 1.
    probabilities: (k,) summing to 1.
    confidence: in (0, 1).
    """
    came = np.asarray(counts, dtype=np.float64)
    value = wasserstein_distance(directions, came, directions, probabilities)

    def scatter(probabilities: Floats) -> Floats:
        """Distances of random frequencies from their probabilities (k,)."""
        series = draw_counts(probabilities, math.floor(came.sum()), TRANSPORT_DRAWS, SEED)
        pairs = ((drawn, probabilities) for block in series for drawn in block)
        return np.array([wasserstein_distance(directions, a, directions, b) for a, b in pairs])

    reach = float(np.quantile(scatter(jeffreys_means(came)), confidence))
    floor = float(scatter(np.asarray(probabilities, dtype=np.float64)).mean())
    return MeasuredDistance(value, (max(0.0, value - reach), min(math.pi, value + reach)), floor)


def wasserstein_distance(
    first_directions: ArrayLike,
    first_weights: ArrayLike,
    second_directions: ArrayLike,
    second_weights: ArrayLike,
) -> float:
    """Wasserstein distance W between two distributions of directions, in radians, 0 to pi.

    It is the smallest mean angle by which mass must turn to make the one distribution into the
    other, computed exactly by a linear program (HiGHS). Mass that both have in one place stays
    there, since angles obey the triangle inequality; so a body of 200 rests takes at most a program
    of 100 x 100.

    Parameters
    ----------
    first_directions, second_directions: (m, 3) and (n, 3), of any length but zero.
    first_weights, second_weights: (m,) and (n,), at least 0, not all 0; each is divided by its sum.

    Source: section 4.1.
    """
    # Imported late: a test of throws needs no geometry.
    from dicedesign.geometry.sphere import angle_between, unit_vectors

    first, second = (
        np.asarray(weights, dtype=np.float64) / np.sum(weights)
        for weights in (first_weights, second_weights)
    )
    places, place = np.unique(
        np.concatenate([first_directions, second_directions]), axis=0, return_inverse=True
    )
    surplus = np.bincount(place.ravel(), np.concatenate([first, -second]), len(places))
    sources, sinks = surplus > 0.0, surplus < 0.0
    moved = float(surplus[sources].sum())
    if moved == 0.0 or not sinks.any():
        return 0.0
    unit = unit_vectors(places)
    cost = angle_between(unit[sources][:, None], unit[sinks])
    supply, demand = surplus[sources] / moved, -surplus[sinks] / moved
    m, n = cost.shape
    # Sums over all that leaves a source, and over all that reaches a sink.
    sums = vstack([kron(eye_array(m), np.ones((1, n))), kron(np.ones((1, m)), eye_array(n))], "csr")
    wanted = np.concatenate([supply, demand])
    # One equation follows from the others but for rounding, which may contradict it. The equation
    # of the largest share is left out: a small share could come out negative.
    others = np.delete(np.arange(m + n), wanted.argmax())
    answer = linprog(
        cost.ravel(),
        A_eq=sums[others],
        b_eq=wanted[others],
        options={"primal_feasibility_tolerance": TRANSPORT_TOLERANCE},
    )
    if not answer.success:
        raise RuntimeError(f"optimal transport: {answer.message}")
    return moved * float(answer.fun)
