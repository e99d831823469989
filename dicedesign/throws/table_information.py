"""What throws of a die tell about the table that it falls onto: the Fisher information of its odds.

Odds depend on restitution and friction, which belong to the table, and on how high, how fast and
with how much spin the die is thrown, which belong to a hand that nobody measures. How much they do
is found by throwing it, with restitution and friction a little lower and higher, and by many hands:
what comes up is fitted by a linear function of these five.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws import native
from dicedesign.throws.release import released
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import MOST_RESTITUTION, SPREADS, Table, least_of, scaled
from dicedesign.tolerances import ROUNDING

STEPS: Final = (0.1, 0.2)
"""By which restitution and friction are lowered and raised, unless they come to their limits."""

LIMITS: Final = ((0.0, 0.05), (MOST_RESTITUTION, 10.0))
"""Least and most of the two."""

HAND: Final = (1.5, 1.5, 1.4)
"""Factors by which height, speed and spin of a hand may be smaller or larger than the table's;
their logarithms are the standard deviations of what is known of a hand."""

BLOCKS: Final = 10
"""Of throws, each left out once for the sampling error."""

SESSIONS: Final = 8
"""Hands of a block, for each of the four tables that it is thrown onto."""

RARE: Final = 20
"""Simulated throws of an outcome, below which it is taken to tell nothing."""

SINGULAR: Final = 1e-12
"""Smallest eigenvalue of an information over the largest, up to which something is unknown."""


@dataclass(frozen=True)
class TableInformation:
    """What one throw of a die tells about restitution, friction, and the logarithms of height,
    speed and spin.

    Attributes
    ----------
    matrix: (5, 5) Fisher information, positive semidefinite.
    without: (b, 5, 5) the same with one block of the simulated throws left out.
    """

    matrix: Floats
    without: Floats

    def errors(self, throws: int) -> Errors:
        """What is left open after so many throws, of whose hand nothing is known but `HAND`."""
        found = _left_open(self.matrix, throws)
        others = np.array([_left_open(matrix, throws) for matrix in self.without])
        with np.errstate(invalid="ignore"):
            spread = np.square(others - others.mean(axis=0)).sum(axis=0)
        own = np.sqrt(spread * (BLOCKS - 1) / BLOCKS)
        return Errors(*(float(x) for pair in zip(found, own, strict=True) for x in pair))


@dataclass(frozen=True)
class Errors:
    """How well throws determine a table; infinite where they do not tell restitution and friction
    apart. Beside each number its sampling error, of the simulation that it comes from; NaN where
    that is unknown.

    Attributes
    ----------
    restitution, friction: standard errors.
    both: root of the determinant of the covariance of the two, which D-optimal dice have least.
    """

    restitution: float
    restitution_error: float
    friction: float
    friction_error: float
    both: float
    both_error: float


def _left_open(matrix: Floats, throws: int) -> Floats:
    """(3,) standard errors, and the root of the determinant."""
    known = throws * matrix
    known[2:, 2:] += np.diag(np.log(HAND) ** -2.0)
    values, vectors = np.linalg.eigh(known)
    if values[0] <= SINGULAR * values[-1]:
        return np.full(3, math.inf)
    covariance = (vectors[:2] / values) @ vectors[:2].T
    left: Floats = np.sqrt([*np.diag(covariance), np.linalg.det(covariance)])
    return left


def table_information(
    body: RigidBody,
    outcome_of_rest: Integers,
    table: Table,
    throws: int,
    seed: int,
    progress: Callable[[int], None] | None = None,
) -> TableInformation:
    """Throw a die to find out what its throws tell about tables like one.

    Parameters
    ----------
    outcome_of_rest: (k,) from 0 on, the same for rests that nobody tells apart; -1 for those that
        show nothing.
    throws: simulated ones, some ten thousand at least.
    progress: called with the number of those that ended.

    Raises InputError: the compiled kernels are missing.

    Source: Fisher, Proceedings of the Cambridge Philosophical Society 22, 1925, section 4.
    """
    kinds = int(outcome_of_rest.max()) + 1
    squares, products = np.zeros((BLOCKS, 6, 6)), np.zeros((BLOCKS, 6, kinds))
    rng = np.random.default_rng(seed)
    count = math.ceil(throws / BLOCKS / SESSIONS / 4)
    for block, _, *signs in product(range(BLOCKS), range(SESSIONS), (-1.0, 1.0), (-1.0, 1.0)):
        there, changes = _session(table, np.array(signs), rng)
        states = released(body, there, np.arange(count), "uniform", rng)
        rests = native.throw_states(body, there, states)
        shown = np.where(rests >= 0, outcome_of_rest[rests], -1)
        counts = np.bincount(shown[shown >= 0], minlength=kinds)
        causes = np.append(1.0, changes)
        squares[block] += counts.sum() * np.outer(causes, causes)
        products[block] += np.outer(causes, counts)
        if progress is not None:
            progress(count)
    all_squares, all_products = squares.sum(axis=0), products.sum(axis=0)
    return TableInformation(
        _information(all_squares, all_products),
        np.array(
            [
                _information(all_squares - s, all_products - p)
                for s, p in zip(squares, products, strict=True)
            ]
        ),
    )


def _session(table: Table, signs: Floats, rng: np.random.Generator) -> tuple[Table, Floats]:
    """A table with restitution and friction a step lower or higher, by signs (2,), for a hand that
    is drawn; and (5,) by how much it differs."""
    middle = np.array([table.restitution, table.friction])
    restitution, friction = np.clip(middle + signs * STEPS, *LIMITS).tolist()
    factors = np.exp(np.log(HAND) * rng.uniform(-1.0, 1.0, 3))
    if least_of(table.height) > 0.0:
        # No lower than the die is large, whatever the rounding.
        factors[0] = max(factors[0], (1.0 + ROUNDING) * table.size / least_of(table.height))
    hand: dict[str, Any] = {
        name: scaled(getattr(table, name), float(factor))
        for name, factor in zip(SPREADS, factors, strict=True)
    }
    there = replace(table, restitution=restitution, friction=friction, **hand)
    return there, np.array([*(np.array([restitution, friction]) - middle), *np.log(factors)])


def _information(squares: Floats, products: Floats) -> Floats:
    """That of odds which are fitted by linear functions; squares: (6, 6) sums of the products of
    the causes, the first of which is 1; products: (6, g) of the causes and what came up."""
    inverse = np.linalg.inv(squares)
    fitted = inverse @ products[:, products[0] >= RARE]
    odds, slopes = fitted[0], fitted[1:]
    # Slopes that are all chance have this on the mean.
    chance = max(len(odds) - 1, 0) * inverse[1:, 1:]
    values, vectors = np.linalg.eigh((slopes / odds) @ slopes.T - chance)
    information: Floats = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return information
