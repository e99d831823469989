"""Prior of unmeasured throws by people, and simulated throws of their sessions.

The model of counts:

- A session is one way of throwing, a hand, which all dice of the session share. Its mean height h,
  speed v and spin w are in units of the die: h / a, v / sqrt(g a) and w sqrt(a / g), with the
  size a of the die. Throws of similar dice in equal units are similar, so sizes need not be known.
- Logarithms of these means are normal about a center that all sessions share, independently, with
  one standard deviation, `between`. Single throws differ from the means by up to `WITHIN`.
- Each material, a pair of what the die and the table are made of, has its own restitution and
  friction.
- The probabilities of a die scatter about the simulated ones by more than chance: dice are made
  imperfectly, and hands drift. They have a Dirichlet distribution with the concentration A, where
  `scatter` is 1 / (1 + A), so counts are Dirichlet-multinomial: the variance of n throws is
  1 + (n - 1) scatter times the multinomial's (Mosimann, Biometrika 49, 1962).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import GRAVITY, Table
from dicedesign.throws.throw_counts import CountedDie

MODEL: Final = "hands in sizes of the die, materials, Dirichlet-multinomial counts"
"""Identifies the model in checkpoints."""

SURFACES: Final[Mapping[str, tuple[float, float]]] = {
    "restitution": (0.1, 0.9),
    "friction": (0.05, 1.2),
}
"""Parameters of each material with the limits of their flat priors: from nearly dead to nearly
elastic, and from below Teflon to above rubber."""

HANDS: Final[Mapping[str, tuple[float, float]]] = {
    "height": (2.0, 25.0),
    "speed": (0.3, 5.0),
    "spin": (0.25, 5.0),
    "between": (0.1, 0.8),
    "scatter": (1e-5, 0.02),
}
"""Parameters of all sessions, with the limits of their priors, which are flat in logarithms.

The center of the sessions' heights, speeds and spins is in units of the die. A die of 25 mm falls
from 5 cm, just out of the hand, to 63 cm, from above a table to its top or from a low throw to the
floor; it flies at 0.15 to 2.5 m/s, the speeds of a fall from 0.05 and 13 sizes; and it turns 0.8 to
16 times a second. It rolls out of a hand with twice its speed as spin. Less speed or spin is
negligible in a fall. Two of three sessions are within a factor of 1.1 to 2.2 of the center. A
scatter of 1e-5 is not seen in 10,000 throws; with 0.02, a probability of a half has a standard
deviation of 0.07. The limits are chosen, not measured."""

SHARED: Final = len(HANDS)

WITHIN: Final = 0.5
"""Largest relative deviation of a throw's height, speed and spin from the session's means. Chosen,
not measured."""

SIZE: Final = 0.025
"""Size of simulated dice and of the fitted table's, in m."""

UNITS: Final = np.array([SIZE, math.sqrt(GRAVITY * SIZE), math.sqrt(GRAVITY / SIZE)])
"""Units of height, speed and spin for dice of `SIZE`, in m, m/s and rad/s."""

SIMULATED: Final[Mapping[str, tuple[float, float]]] = {
    **SURFACES,
    "height": (2.0, 32.0),
    "speed": (0.1, 6.0),
    "spin": (0.1, 9.0),
}
"""Limits of the means of a simulated session, within those of the momentum model; means outside are
clipped. At the least height, the lowest throws begin at the die's own size."""

LOWEST: Final = 3.2
"""Least mean height of posterior tables, so that dice of up to 40 mm fit below half of it."""

Offsets = Floats
"""(k, 3) sessions: standard normal deviations of the logarithms of height, speed and spin."""


def session_offsets(sessions: int, rng: np.random.Generator) -> Offsets:
    """Equally likely sessions, evenly spread. sessions: their number, a power of 2."""
    even = qmc.Sobol(3, rng=rng).random_base2(sessions.bit_length() - 1)
    # The normal quantile of 0 is infinite.
    return np.asarray(ndtri(np.maximum(even, 1e-9)))


def _ends(limits: Mapping[str, tuple[float, float]], flat: int) -> Floats:
    """Least and largest coordinates (2, d), of which all but the first `flat` are logarithms."""
    ends = np.array(list(limits.values())).T
    ends[:, flat:] = np.log(ends[:, flat:])
    return ends


def _values(points: Floats, limits: Mapping[str, tuple[float, float]], flat: int) -> Floats:
    """Values (..., d) at points (..., d) of the unit cube."""
    least, most = _ends(limits, flat)
    values: Floats = least + (most - least) * points
    values[..., flat:] = np.exp(values[..., flat:])
    return values


def simulated_values(points: Floats) -> Floats:
    """Values (..., 5) of simulated sessions at points (..., 5) of the unit cube."""
    return _values(points, SIMULATED, len(SURFACES))


@dataclass(frozen=True)
class Prior:
    """Prior of the d parameters of the model: `SURFACES` of each material, then `HANDS`.

    Attributes
    ----------
    materials: distinct names.
    """

    materials: tuple[str, ...]

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Limits of the parameters by name; that of the unnamed material "" is the bare one."""
        surfaces = {
            f"{name} of {material}" if material else name: limits
            for material in self.materials
            for name, limits in SURFACES.items()
        }
        return {**surfaces, **HANDS}

    def values(self, points: Floats) -> Floats:
        """Values (..., d) at points (..., d) of the unit cube, in which the prior is flat."""
        return _values(points, self.limits, len(self.limits) - SHARED)

    def concentration(self, points: Floats) -> Floats:
        """Concentrations A (...) of the Dirichlet distribution at points (..., d)."""
        return np.asarray(1.0 / self.values(points)[..., -1] - 1.0)

    def session_values(self, points: Floats, offsets: Offsets, material: str) -> Floats:
        """Restitution and friction of a material, and mean height, speed and spin (..., 5) of
        sessions (..., 3) at points (..., d)."""
        values = self.values(points)
        first = len(SURFACES) * self.materials.index(material)
        between = values[..., -SHARED + 3, None]
        hands = values[..., -SHARED : -SHARED + 3] * np.exp(between * offsets)
        surfaces = values[..., first : first + len(SURFACES)]
        surfaces = np.broadcast_to(surfaces, (*hands.shape[:-1], len(SURFACES)))
        return np.concatenate([surfaces, hands], axis=-1)

    def session_points(self, points: Floats, offsets: Offsets, material: str) -> Floats:
        """Points (..., 5) of sessions in the unit cube of simulated ones; see `session_values`."""
        values = self.session_values(points, offsets, material)
        least, most = _ends(SIMULATED, len(SURFACES))
        values[..., len(SURFACES) :] = np.log(values[..., len(SURFACES) :])
        return np.clip((values - least) / (most - least), 0.0, 1.0)


def table_of(start: Table, values: Floats) -> Table:
    """Table with restitution, friction and a session's mean height, speed and spin (5,), to three
    digits, for dice of `SIZE`. start: name and source."""
    restitution, friction = map(round_value, values[:2])
    height, speed, spin = (
        (round_value((1.0 - WITHIN) * mean), round_value((1.0 + WITHIN) * mean))
        for mean in map(round_value, values[2:] * UNITS)
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
    sets: Sequence[Floats],
    drops: int,
    seed: int,
    first: int,
    workers: Executor,
    checkpoint: Checkpoint,
    progress: Callable[[int], object],
) -> list[Integers]:
    """Counts (n, g) of each die, thrown in sessions at n points of its own.

    Parameters
    ----------
    start: name of the tables. drops: of each die for each set; seed: of all sets.
    sets: for each die, points (n, 5) of the unit cube of simulated sessions.
    first: number of the first point among all points; determines the seeds.
    checkpoint: earlier simulations are read from it, new ones are added.
    progress: called with the number of drops of each die that was thrown.
    """
    tasks = []
    for number, points in enumerate(zip(*sets, strict=True), start=first):
        for i, (die, point) in enumerate(zip(dice, points, strict=True)):
            table = table_of(start, simulated_values(point))
            tasks.append(partial(outcome_counts, die, table, drops, (seed, number, i)))
    came = checkpoint.results(f"{COUNTS} {first}", tasks, workers, lambda _: progress(drops))
    return [np.array(came[die :: len(dice)], dtype=np.int64) for die in range(len(dice))]


def outcome_counts(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> Integers:
    """Simulated counts (g,) of a die's outcomes on a table, as a die of the table's size.

    drops: number of throws; seed: several numbers, any change of which gives unrelated throws.
    """
    (own,) = np.random.SeedSequence(seed).generate_state(1).tolist()
    return die.by_outcome(simulate(die.body, table, drops, own).counts)
