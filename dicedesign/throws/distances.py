"""Distances between probabilities and what was thrown, with their sampling error.

Frequencies of few throws are never the probabilities of the die, and total variation adds up the
deviations whatever their signs. So that of a perfect die is not 0: its mean is the noise floor,
    beside which
every total variation has to be read.
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

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import TRANSPORT_TOLERANCE


@dataclass(frozen=True)
class Posterior:
    """Posterior of k probabilities after some throws.

    Attributes
    ----------
    means: (k,) summing to 1.
    intervals: (k, 2) that hold each probability with the given confidence, and leave as much below
        as above.
    """

    means: Floats
    intervals: Floats


def jeffreys_means(counts: ArrayLike) -> Floats:
    """The means (k,) of `jeffreys_posterior`: probabilities above 0 that sum to 1."""
    weights: Floats = np.asarray(counts, dtype=np.float64) + 0.5
    return weights / weights.sum()


def jeffreys_posterior(counts: ArrayLike, confidence: float) -> Posterior:
    """Posterior of k probabilities after `counts` (k,), at least 0, under Jeffreys' prior (all
    Dirichlet parameters 1/2): a Dirichlet distribution with parameters `counts` + 1/2.

    confidence: probability in (0, 1) that each interval holds its probability.

    Source: Jeffreys, Proc. R. Soc. A 186, 1946.
    """
    weights = np.asarray(counts, dtype=np.float64) + 0.5
    others = weights.sum() - weights
    # What lies above, too, by its own small part: 1 less a very small one is rounded to 1.
    tail = (1.0 - confidence) / 2.0
    limits = [betaincinv(weights, others, tail), 1.0 - betaincinv(others, weights, tail)]
    return Posterior(jeffreys_means(counts), np.stack(limits, axis=-1))


BLOCK: Final = 1_000_000
"""Counts of a block, at most, unless one series has more."""


def draw_counts(probabilities: Floats, throws: int, series: int, seed: int) -> Iterator[Integers]:
    """Yield counts (b, k) of series of throws, drawn with probabilities (k,).

    How many come at a time does not change them.
    """
    random, at_once = np.random.default_rng(seed), max(1, BLOCK // len(probabilities))
    for first in range(0, series, at_once):
        yield random.multinomial(throws, probabilities, size=min(at_once, series - first))


DRAWS: Final = 10_000

SEED: Final = 0


@dataclass(frozen=True)
class MeasuredDistance:
    """A distance between given probabilities and the unknown probabilities of a die that was
    thrown.

    Attributes
    ----------
    value: between the given probabilities and the frequencies; of a total variation 0 to 1, of a
        Wasserstein distance in radians, 0 to pi.
    interval: holds that of the unknown probabilities with the asked-for confidence.
    noise_floor: mean of `value` if the given probabilities were those of the die.
    """

    value: float
    interval: tuple[float, float]
    noise_floor: float


def total_variation(first: ArrayLike, second: ArrayLike) -> float:
    """Half the sum of the absolute differences of two distributions (k,), 0 to 1: the largest
    difference that they make to the probability of any event."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum() / 2.0)


def effective_counts(outcomes: ArrayLike, weights: ArrayLike, kinds: int) -> Floats:
    """Counts (k,) that stand for throws of unequal weight, as of directions that stand for cells of
    the sphere of unequal area.

    They have the proportions of the weighted frequencies, and sum to the number of throws of equal
    weight with the same variance, the squared sum of the weights over the sum of their squares.
    Weighted throws whose initial directions are spread evenly scatter less than that says.

    Parameters
    ----------
    outcomes: (n,) what each throw showed, 0 to k - 1.
    weights: (n,) positive.
    kinds: k.

    Source: Kish, Survey Sampling, 1965, section 11.7.
    """
    given = np.asarray(weights, dtype=np.float64)
    sums = np.bincount(np.asarray(outcomes), given, kinds)
    return np.asarray(sums * given.sum() / (given * given).sum())


def noise_floor(probabilities: ArrayLike, throws: float) -> float:
    """The mean total variation between the probabilities (k,) of a die and its frequencies in at
    least one throw; of fractions of a throw, only whole ones count.

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
    """What chance adds to the frequency of one event at most, with `confidence` in (0, 1), by the
    normal limit: z sqrt(m (1 - m) / n), where m is the probability of the most probable outcome
    (k,), but at least 1/2."""
    most = max(0.5, float(probabilities.max()))
    return -float(ndtri((1.0 - confidence) / 2.0)) * math.sqrt(most * (1.0 - most) / throws)


def measure_variation(
    counts: ArrayLike, probabilities: ArrayLike, confidence: float
) -> MeasuredDistance:
    """Total variation between given probabilities and those of a thrown die, with its uncertainty.

    The interval holds for any probabilities, also for those equal to the given ones, where neither
    the bootstrap nor the delta method does:

    - As a metric, total variation differs by no more than the frequencies are from the
    probabilities of the
      die. The lower limit is less by the quantile of that, of `DRAWS` series of throws drawn with
      a fixed seed.
    - It is the largest difference in the probability of an event, so that the frequencies show at
      least what they show in the event that differs most for the die. The upper limit is more by
      what chance allows in one event, `event_error`.

    The probabilities of the die are taken there as `jeffreys_means`. Where many labels
    deviate a little the lower limit is a cautious one.

    Parameters
    ----------
    counts: (k,) at least 0, those of `effective_counts` too, with a sum of at least 1.
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
    limits = (
        max(0.0, value - scatter),
        min(1.0, value + event_error(estimate, throws, confidence)),
    )
    return MeasuredDistance(value, limits, noise_floor(probabilities, throws))


TRANSPORT_DRAWS: Final = 200


def measure_transport(
    directions: ArrayLike, counts: ArrayLike, probabilities: ArrayLike, confidence: float
) -> MeasuredDistance:
    """Wasserstein distance between given probabilities of k rests and those of a thrown body, with
    its uncertainty.

    As a metric it differs by no more than the frequencies are from the probabilities of the body.
    Each limit is off by the quantile of that, of `TRANSPORT_DRAWS` series of throws drawn with a
    fixed seed, where the probabilities of the body are taken as `jeffreys_means`. So the interval
    is a cautious one, but holds for probabilities equal to the given ones, too.

    Parameters
    ----------
    directions: (k, 3) of the rests.
    counts: (k,) at least 0, those of `effective_counts` too, with a sum of at least 1.
    probabilities: (k,) summing to 1.
    confidence: in (0, 1).

    Raises as `wasserstein_distance`.
    """
    came = np.asarray(counts, dtype=np.float64)
    value = wasserstein_distance(directions, came, directions, probabilities)

    def scatter(probabilities: Floats) -> Floats:
        """Distances of frequencies from the probabilities (k,) that they were drawn with."""
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
    """The Wasserstein distance W between two distributions of directions, in radians, 0 to pi.

    It is the mean angle by which mass has to be turned to make the one into the other, at the
    least, and is found exactly, by a linear program (HiGHS). Mass that both have at one place stays
    there, since angles obey the triangle inequality; so a body of 200 rests takes at most a program
    of 100 x 100.

    Parameters
    ----------
    first_directions, second_directions: (m, 3) and (n, 3), of any length but zero.
    first_weights, second_weights: (m,) and (n,), at least 0; each set is divided by its sum.

    Raises
    ------
    InputError: not one weight for each direction, a negative or infinite weight, or a sum of zero.

    Source: section 4.1.
    """
    # Imported here, as judging counts of labels does without any body.
    from dicedesign.geometry.sphere import angle_between, unit_vectors

    first = _shares("first_weights", first_directions, first_weights)
    second = _shares("second_weights", second_directions, second_weights)
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
    # Sums over all that a source gives, and over all that a sink gets.
    sums = vstack([kron(eye_array(m), np.ones((1, n))), kron(np.ones((1, m)), eye_array(n))], "csr")
    wanted = np.concatenate([supply, demand])
    # One equation follows from the others but for rounding, which may contradict it. That of the
    # largest share is left out: a small one could come out negative.
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


def _shares(name: str, directions: ArrayLike, weights: ArrayLike) -> Floats:
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != np.shape(directions)[:1]:
        raise InputError(
            f"{name}: expected {np.shape(directions)[0]}, one for each direction, got shape "
            f"{values.shape}; give each direction a weight"
        )
    if not (np.isfinite(values).all() and (values >= 0.0).all() and values.sum() > 0.0):
        raise InputError(
            f"{name}: expected finite numbers of at least 0 that are not all 0, got a least of "
            f"{values.min(initial=np.inf):g} and a sum of {values.sum():g}; correct them"
        )
    return values / values.sum()
