"""Design against simulated throws: what the momentum model gets wrong of a die is measured, and the
die designed anew for odds that make up for it.

The model's odds m of a die and its simulated frequencies f differ by a factor that changes little
from one die to the next. So the model is asked for `q exp(-b)` in place of the target q, with b the
mean of `log(f / m)` over the dice so far, in which later dice and larger samples count for more.

Where the die shall be robust it is thrown onto other tables as well, and what the model gets
wrong there is measured likewise, for the preference that makes it so. In the last rounds the die
is no more made better by preference: one that hardly moves keeps what was measured of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.optimize.options import MOST_DROPS
from dicedesign.optimize.result import DesignResult
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.statistics.total_variation import noise_floor, total_variation

__all__ = ["Refinement", "Round"]

GROWTH: Final = 1.5
"""Throws of a round over those of the one before."""

MEMORY: Final = 0.25
"""What a throw counts in the next round, over what that round's own count."""

SOFTENING: Final = 0.5
"""Throws added to each outcome, so that one that never came up has a logarithm."""

SETTLING: Final = 2
"""Last rounds, after which the odds alone are corrected; the first round is none of them."""

MOST_HALVINGS: Final = 4
"""How often a correction for which no die is found is halved."""


@dataclass(frozen=True)
class Round:
    """Throws of one die.

    Attributes
    ----------
    asked: (k,) its odds in the model.
    drops: throws that came to rest; frequencies: (k,) of the outcomes among them, which sum to less
        than 1 where some came to rest on no outcome.
    deviation: total variation of the frequencies from the target.
    noise_floor: what a perfect die would show on the mean in as many throws.
    changed: (n,) the deviation on each of the other tables, by half as many throws; () in the last
        rounds.
    """

    asked: Floats
    drops: int
    frequencies: Floats
    deviation: float
    noise_floor: float
    changed: tuple[float, ...] = ()

    @property
    def all_drops(self) -> int:
        """About how many throws there were, onto all tables."""
        return self.drops + len(self.changed) * math.ceil(self.drops / 2)


@dataclass(frozen=True)
class Refinement:
    """Rounds of throwing a die and designing it anew.

    Attributes
    ----------
    target: (k,) wanted odds of the outcomes.
    orbits: (k,) a number for each outcome, the same for those whose facets are images of each other
        by a symmetry of the die: they are equally frequent but for chance.
    drops: throws of the first round. rounds: most rounds.
    others: n, how many other tables the die is thrown onto too.
    throw: simulated counts (k + 1,) of a die, the last of throws that ended on no outcome, and its
        odds (k,) in the model; for so many throws, the round's number, and that of the table, 0 for
        the one it is made for. All have random numbers of their own.
    design: from a die to one near it with other odds (k,) in the model, or None; also told the
        logarithms (n, k) of the odds on the other tables over those in the model, empty without
        others, or None where it shall be nearest and no better by preference.
    on_round: called after every round of throws.
    """

    target: Floats
    orbits: Integers
    drops: int
    rounds: int
    others: int
    throw: Callable[[DesignResult, int, int, int], tuple[Integers, Floats]]
    design: Callable[[DesignResult, Floats, Floats | None], DesignResult | None]
    on_round: Callable[[Round], None] | None = None

    def refine(self, die: DesignResult) -> tuple[DesignResult, tuple[Round, ...]]:
        """The die that the rounds lead to from one whose odds in the model are the target, and the
        rounds. They end where the orbits deviate no more than those of a perfect die would on the
        mean; one that shall be robust is designed anew once at least. The last die has not been
        thrown."""
        asked, history = self.target, list[Round]()
        biases = [_Bias(len(asked)) for _ in range(1 + self.others)]
        for number in range(self.rounds):
            drops = min(round(self.drops * GROWTH**number), MOST_DROPS)
            counts, odds = self.throw(die, drops, number, 0)
            biases[0].learn(self._softened(counts), odds, drops)
            changed, settling = [], number >= max(self.rounds - SETTLING, 1)
            if not settling:
                drops = math.ceil(drops / 2)
                for other, bias in enumerate(biases[1:], 1):
                    counted, odds = self.throw(die, drops, number, other)
                    bias.learn(self._softened(counted), odds, drops)
                    changed.append(self._deviation(counted))
            history.append(self._round(asked, counts, changed))
            if self.on_round is not None:
                self.on_round(history[-1])
            met = self._is_met(counts)
            if met and not (self.others and number == 0):
                break
            sensitivity = None if settling else np.array([b.value for b in biases[1:]])
            if met:
                # The first die does not know what the other tables do, but has the right odds.
                again = self.design(die, asked, sensitivity)
                found = None if again is None else (again, asked)
            else:
                found = self._corrected(die, asked, biases[0].value, sensitivity)
            if found is None:
                break
            die, asked = found
        return die, tuple(history)

    def _deviation(self, counts: Integers) -> float:
        """Total variation of counts (k + 1,) from the target."""
        return total_variation(counts / counts.sum(), np.append(self.target, 0.0))

    def _round(self, asked: Floats, counts: Integers, changed: Sequence[float]) -> Round:
        drops = int(counts.sum())
        return Round(
            asked,
            drops,
            counts[:-1] / drops,
            self._deviation(counts),
            noise_floor(self.target, drops),
            tuple(changed),
        )

    def _is_met(self, counts: Integers) -> bool:
        """True where the orbits deviate no more from the target than those of a perfect die would
        on the mean."""
        elsewhere = int(self.orbits.max()) + 1
        counted = np.bincount(np.append(self.orbits, elsewhere), counts)
        wanted = np.bincount(self.orbits, self.target)
        deviation = total_variation(counted / counted.sum(), np.append(wanted, 0.0))
        return deviation <= noise_floor(wanted, int(counted.sum()))

    def _softened(self, counts: Integers) -> Floats:
        """Positive frequencies (k,), equal within each orbit."""
        soft = counts[:-1] + SOFTENING
        pooled = np.bincount(self.orbits, soft) / np.bincount(self.orbits)
        frequencies: Floats = pooled[self.orbits] / soft.sum()
        return frequencies

    def _corrected(
        self, die: DesignResult, asked: Floats, bias: Floats, sensitivity: Floats | None
    ) -> tuple[DesignResult, Floats] | None:
        """A die that makes up for a bias (k,), and its odds in the model; where none is found, one
        that goes a part of the way from what was asked last. sensitivity: as `design` is told."""
        wanted = np.log(self.target) - bias
        for halving in range(MOST_HALVINGS):
            part = 0.5**halving
            odds = np.exp(part * wanted + (1.0 - part) * np.log(asked))
            odds /= odds.sum()
            found = self.design(die, odds, sensitivity)
            if found is not None:
                return found, odds
        return None


class _Bias:
    """Logarithm of a die's frequencies over its odds in the model, on one table.

    Attributes
    ----------
    value: (k,) mean over the dice so far, 0 before the first.
    weight: throws that it rests on, the older for less.
    """

    def __init__(self, outcomes: int) -> None:
        self.value, self.weight = np.zeros(outcomes), 0.0

    def learn(self, frequencies: Floats, odds: Floats, drops: int) -> None:
        """Take note of positive frequencies (k,), odds (k,) in the model, and of how many drops."""
        old = MEMORY * self.weight
        self.weight = old + drops
        self.value = (old * self.value + drops * np.log(frequencies / odds)) / self.weight
