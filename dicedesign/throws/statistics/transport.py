"""The Wasserstein distance of two distributions of resting directions."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.sparse import coo_array

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.intervals import jeffreys_means
from dicedesign.throws.statistics.multinomial_draws import drawn_counts
from dicedesign.throws.statistics.total_variation import MeasuredDistance
from dicedesign.tolerances import TRANSPORT_TOLERANCE

__all__ = ["measure_transport", "wasserstein_distance"]

DRAWS: Final = 200

SEED: Final = 0


def measure_transport(
    directions: ArrayLike, counts: ArrayLike, odds: ArrayLike, confidence: float
) -> MeasuredDistance:
    """The Wasserstein distance between given odds of k rests and those of a body that was thrown.

    As a metric it differs by no more than the frequencies are from the odds of the body. Each limit
    is off by the quantile of that, of `DRAWS` series of throws drawn with a fixed seed, where the
    odds of the body are taken as `jeffreys_means`. So the interval is a cautious
    one, but holds for odds equal to the given ones, too.

    Parameters
    ----------
    directions: (k, 3) of the rests.
    counts: (k,) at least 0, those of `effective_counts` too, with a sum of at least 1.
    odds: (k,) summing to 1.
    confidence: in (0, 1).

    Raises as `wasserstein_distance`.
    """
    came = np.asarray(counts, dtype=np.float64)
    throws = math.floor(came.sum())
    value = wasserstein_distance(directions, came, directions, odds)
    around = _scatter(directions, jeffreys_means(came), throws)
    reach = float(np.quantile(around, confidence))
    floor = float(_scatter(directions, np.asarray(odds, dtype=np.float64), throws).mean())
    return MeasuredDistance(value, (max(0.0, value - reach), min(math.pi, value + reach)), floor)


def _scatter(directions: ArrayLike, odds: Floats, throws: int) -> Floats:
    """Distances of frequencies from the odds (k,) that they were drawn with."""
    return np.array(
        [
            wasserstein_distance(directions, counts, directions, odds)
            for block in drawn_counts(odds, throws, DRAWS, SEED)
            for counts in block
        ]
    )


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
    return moved * _least_cost(surplus[sources] / moved, -surplus[sinks] / moved, cost)


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


def _least_cost(supply: Floats, demand: Floats, cost: Floats) -> float:
    """The least cost of a transport of supply (m,) to demand (n,), each with sum 1, at cost (m, n)
    for each unit."""
    m, n = cost.shape
    plan = np.arange(m * n)
    rows = np.concatenate([plan // n, m + plan % n])
    sums = coo_array((np.ones(2 * m * n), (rows, np.tile(plan, 2))), shape=(m + n, m * n)).tocsr()
    wanted = np.concatenate([supply, demand])
    # One equation follows from the others but for rounding, which may contradict it. That of the
    # largest share is left out: a small one could come out negative.
    kept = np.delete(np.arange(m + n), wanted.argmax())
    answer = linprog(
        cost.ravel(),
        A_eq=sums[kept],
        b_eq=wanted[kept],
        options={"primal_feasibility_tolerance": TRANSPORT_TOLERANCE},
    )
    if not answer.success:
        raise RuntimeError(f"optimal transport: {answer.message}")
    return float(answer.fun)
