"""Prior of unmeasured throws by people: parameters that all throws share, variation between
sessions and within one, and simulated throws of such sessions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from typing import Final

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
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
"""Shared parameters with their limits, in the units of `Table`: restitution and friction, and the
center of the sessions' height, speed and spin. The prior is flat between the limits, for the last
three in logarithms. A speed or spin below the lower limit is negligible in a fall."""

BETWEEN: Final = 0.3
"""Standard deviation of the logarithms of a session's height, speed and spin, independently: two of
three sessions are within a factor of 1.35 of the center. People who are asked to throw a die in the
same way differ by about as much; the counts of four dice do not determine it."""

WITHIN: Final = 0.5
"""Largest relative deviation of a throw's height, speed and spin from the session's means."""

SIZES: Final = (0.015, 0.035)
"""Range of unknown sizes of dice, in m."""

SIZE: Final = 0.025
"""Size of simulated dice, in m. A die that is s times as large behaves equally if its height, speed
and spin are s, sqrt(s) and 1 / sqrt(s) times as large."""

SIMULATED: Final[Mapping[str, tuple[float, float]]] = {
    **PARAMETERS,
    "height": (0.05, 0.8),
    "speed": (0.12, 3.2),
    "spin": (4.0, 130.0),
}
"""Limits of the means of a simulated session, for dice of `SIZE`; means outside are clipped. At the
least height, the lowest throws begin at the die's own size."""

LOWEST: Final = 0.08
"""Least mean height in m of posterior tables, so that dice of up to 40 mm fit below half of it."""

BY_SIZE: Final = np.array([-1.0, -0.5, 0.5])
"""Exponents of a die's relative size in its equivalent height, speed and spin."""

Offsets = Floats
"""(k, 4) sessions: logarithms of height, speed and spin relative to the center's, and a number in
(0, 1) that selects an unknown size."""


def session_offsets(sessions: int, rng: np.random.Generator) -> Offsets:
    """Equally likely sessions, evenly spread. sessions: their number, a power of 2."""
    even = qmc.Sobol(4, rng=rng).random_base2(sessions.bit_length() - 1)
    # The normal quantile of 0 is infinite.
    return np.column_stack([BETWEEN * ndtri(np.maximum(even[:, :3], 1e-9)), even[:, 3]])


def shared_values(points: Floats, limits: Mapping[str, tuple[float, float]] = PARAMETERS) -> Floats:
    """Values (..., 5) of parameters at points (..., 5) of the unit cube between their limits."""
    least, most = _coordinates(np.array(list(limits.values())).T)
    values: Floats = least + (most - least) * points
    values[..., 2:] = np.exp(values[..., 2:])
    return values


def _coordinates(values: Floats) -> Floats:
    """Coordinates (..., 5) in which the prior is uniform."""
    return np.concatenate([values[..., :2], np.log(values[..., 2:])], axis=-1)


def _session_values(points: Floats, offsets: Offsets, size: float | None) -> Floats:
    """Values (..., 5) of the parameters of sessions (..., 4) at points (..., 5) of the prior's unit
    cube, converted to dice of `SIZE`.

    size: of the die in m; None takes the session's.
    """
    sizes = SIZES[0] + (SIZES[1] - SIZES[0]) * offsets[..., 3] if size is None else np.array(size)
    moved = offsets[..., :3] + np.log(sizes / SIZE)[..., None] * BY_SIZE
    return shared_values(points) * np.insert(np.exp(moved), [0, 0], 1.0, axis=-1)


def session_points(points: Floats, offsets: Offsets, size: float | None) -> Floats:
    """Points (..., 5) of sessions in the unit cube of simulated sets; see `_session_values`."""
    least, most = _coordinates(np.array(list(SIMULATED.values())).T)
    coordinates = _coordinates(_session_values(points, offsets, size))
    return np.clip((coordinates - least) / (most - least), 0.0, 1.0)


def draw_values(points: Floats, offsets: Offsets) -> Floats:
    """Values (n, 5) of sessions of dice of `SIZE`, from heights that also suit larger dice."""
    values = _session_values(points, offsets, SIZE)
    values[:, 2] = np.maximum(values[:, 2], LOWEST)
    return values


def table_of(start: Table, values: Floats) -> Table:
    """Table with restitution, friction and a session's mean height, speed and spin (5,), to three
    digits, for dice of `SIZE`. start: name and source."""
    restitution, friction, *means = map(round_value, values)
    height, speed, spin = (
        (round_value((1.0 - WITHIN) * mean), round_value((1.0 + WITHIN) * mean)) for mean in means
    )
    return Table(
        start.name, restitution, friction, height, speed, spin, size=SIZE, source=start.source
    )


def round_value(value: float) -> float:
    """Round to three digits; no counts determine more."""
    return float(f"{value:.3g}")


COUNTS: Final = "counts"
"""Name of the rows of a checkpoint, before the number of the first set of parameters: counts of
each die for each set."""


def set_counts(
    dice: Sequence[CountedDie],
    start: Table,
    sets: Floats,
    drops: int,
    seed: int,
    first: int,
    workers: Executor,
    checkpoint: Checkpoint,
    progress: Callable[[int], object],
) -> list[Integers]:
    """Counts (n, g) of each die, thrown at n points of the unit cube of simulated sets.

    Parameters
    ----------
    start: name of the tables. drops: of each die for each set; seed: of all sets.
    first: number of the first point among all points; determines the seeds.
    checkpoint: earlier simulations are read from it, new ones are added.
    progress: called with the number of drops of each die that was thrown.
    """
    tasks = []
    for number, point in enumerate(sets, start=first):
        table = table_of(start, shared_values(point, SIMULATED))
        tasks += [
            partial(outcome_counts, die, table, drops, (seed, number, i))
            for i, die in enumerate(dice)
        ]
    came = checkpoint.results(f"{COUNTS} {first}", tasks, workers, lambda _: progress(drops))
    return [np.array(came[die :: len(dice)], dtype=np.int64) for die in range(len(dice))]


def outcome_counts(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> Integers:
    """Simulated counts (g,) of a die's outcomes on a table, as a die of the table's size.

    drops: number of throws; seed: several numbers, any change of which gives unrelated throws.
    """
    (own,) = np.random.SeedSequence(seed).generate_state(1).tolist()
    return die.by_outcome(simulate(die.body, table, drops, own).counts)
