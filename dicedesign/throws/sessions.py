"""How dice are thrown by people whom nobody measured: what all throws share, what differs between
sessions and within one, and simulated throws of such sessions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from itertools import chain
from typing import Final

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.workers import in_order
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table
from dicedesign.throws.throw_counts import CountedDie

PARAMETERS: Final[Mapping[str, tuple[float, float]]] = {
    "restitution": (0.1, 0.9),
    "friction": (0.05, 1.2),
    "height": (0.06, 0.5),
    "speed": (0.15, 2.5),
    "spin": (5.0, 100.0),
}
"""What all sessions share, with its limits in the units of `Table`: restitution and friction, which
die and table have, and the center of all hands. The prior is flat between them, of the hand in its
logarithms. A speed or a spin below its least is nothing beside that of the fall."""

BETWEEN: Final = 0.3
"""Standard deviation of the logarithm of a session's height, speed and spin about the center, each
independently: two sessions of three are within a factor of 1.35. People asked to throw a die in the
same way differ by about as much as that; the counts of four dice cannot tell it."""

WITHIN: Final = 0.5
"""A throw has a height, speed and spin of its own: any from this part below the session's mean to
as much above it."""

SIZES: Final = (0.015, 0.035)
"""In m, of a die whose size nobody wrote down."""

SIZE: Final = 0.025
"""In m, of the dice that are simulated. One of another size s does the same when it is thrown from
a height, at a speed and with a spin that are s, the root of s and one over that root as large."""

SIMULATED: Final[Mapping[str, tuple[float, float]]] = {
    **PARAMETERS,
    "height": (0.05, 0.8),
    "speed": (0.12, 3.2),
    "spin": (4.0, 130.0),
}
"""Limits of the mean hand of a simulated session, for dice of `SIZE`; hands beyond count as at the
limit. The least height has the lowest throws begin at the die's own size above the table."""

LOWEST: Final = 0.08
"""Least mean height in m of a session that is drawn for other dice: those of up to 40 mm can be
thrown from half of it."""

BY_SIZE: Final = np.array([-1.0, -0.5, 0.5])
"""Exponents of a die's size in its height, speed and spin as one of `SIZE`."""

Offsets = Floats
"""(k, 4) of sessions: the logarithms of their height, speed and spin over the center's, and a
number in (0, 1) for a size that is not known."""


def session_offsets(sessions: int, rng: np.random.Generator) -> Offsets:
    """Equally likely sessions, spread evenly. sessions: a power of 2."""
    even = qmc.Sobol(4, rng=rng).random_base2(sessions.bit_length() - 1)
    # The normal quantile of 0 is infinite.
    return np.column_stack([BETWEEN * ndtri(np.maximum(even[:, :3], 1e-9)), even[:, 3]])


def shared_values(points: Floats, limits: Mapping[str, tuple[float, float]] = PARAMETERS) -> Floats:
    """Values (..., 5) of the parameters at points (..., 5) of the unit cube of the prior, or of
    that with other limits."""
    least, most = _coordinates(np.array(list(limits.values())).T)
    values: Floats = least + (most - least) * points
    values[..., 2:] = np.exp(values[..., 2:])
    return values


def _coordinates(values: Floats) -> Floats:
    """Coordinates (..., 5) in which the prior is uniform."""
    return np.concatenate([values[..., :2], np.log(values[..., 2:])], axis=-1)


def _session_values(points: Floats, offsets: Offsets, size: float | None) -> Floats:
    """Values (..., 5) of restitution, friction and the hand, for dice of `SIZE`, of sessions
    (..., 4) of a die at points (..., 5) of the prior's unit cube.

    size: of the die in m; None has that of the session.
    """
    sizes = SIZES[0] + (SIZES[1] - SIZES[0]) * offsets[..., 3] if size is None else np.array(size)
    moved = offsets[..., :3] + np.log(sizes / SIZE)[..., None] * BY_SIZE
    return shared_values(points) * np.insert(np.exp(moved), [0, 0], 1.0, axis=-1)


def session_points(points: Floats, offsets: Offsets, size: float | None) -> Floats:
    """Values of a session as points (..., 5) of the unit cube of simulated sets."""
    least, most = _coordinates(np.array(list(SIMULATED.values())).T)
    coordinates = _coordinates(_session_values(points, offsets, size))
    return np.clip((coordinates - least) / (most - least), 0.0, 1.0)


def draw_values(points: Floats, offsets: Offsets) -> Floats:
    """Values (n, 5) with sizes drawn for dice of `SIZE` and larger ones."""
    values = _session_values(points, offsets, SIZE)
    values[:, 2] = np.maximum(values[:, 2], LOWEST)
    return values


def table_of(start: Table, values: Floats) -> Table:
    """A table with restitution, friction and a session's mean height, speed and spin (5,), to three
    digits, for dice of `SIZE`. start: has the name and the source."""

    def rounded(value: float) -> float:
        """No counts determine more."""
        return float(f"{value:.3g}")

    restitution, friction, *means = map(rounded, values)
    height, speed, spin = (
        (rounded((1.0 - WITHIN) * mean), rounded((1.0 + WITHIN) * mean)) for mean in means
    )
    return Table(
        start.name, restitution, friction, height, speed, spin, size=SIZE, source=start.source
    )


COUNTS: Final = "counts"
"""Rows of a checkpoint: what came up with each die for each set of parameters."""


def set_counts(
    dice: Sequence[CountedDie],
    start: Table,
    sets: Floats,
    drops: int,
    seed: int,
    first: int,
    workers: Executor,
    checkpoint: Checkpoint,
    progress: Callable[[int], None] | None,
) -> list[Integers]:
    """Counts (n, g) of each die, thrown at n points of the unit cube of simulated sets.

    Parameters
    ----------
    start: has the name of the tables. drops: of each die for each set; seed: of all sets.
    first: number of the first of the points among all, which makes their seeds.
    checkpoint: what it has is taken from it, and what is simulated is added.
    progress: called with the number of drops of each die that was thrown.
    """
    tasks = []
    for number, point in enumerate(sets, start=first):
        table = table_of(start, shared_values(point, SIMULATED))
        tasks += [
            partial(outcome_counts, die, table, drops, (seed, number, i))
            for i, die in enumerate(dice)
        ]
    begun = first * len(dice)
    known = list(checkpoint.rows(COUNTS)[begun : begun + len(tasks)])
    came = []
    for place, counts in enumerate(chain(known, in_order(tasks[len(known) :], workers))):
        if place >= len(known):
            checkpoint.add(COUNTS, [counts])
        checkpoint.require(len(counts) == len(dice[place % len(dice)].labels))
        came.append(counts)
        if progress is not None:
            progress(drops)
    return [np.array(came[die :: len(dice)], dtype=np.int64) for die in range(len(dice))]


def outcome_counts(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> Integers:
    """Counts (g,) of a die's outcomes on a table, as a die of its size.

    drops: how often it is thrown; seed: one of several numbers, from which different ones are
    unrelated.
    """
    (own,) = np.random.SeedSequence(seed).generate_state(1).tolist()
    return die.by_outcome(simulate(die.body, table, drops, own).counts)
