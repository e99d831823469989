"""Design against simulated throws: what the momentum model gets wrong of a die is measured, and the
die designed anew for odds that make up for it.

The model's odds m of a die and its simulated frequencies f differ by a factor that changes little
from one die to the next. So the model is asked for `q exp(-b)` in place of the target q, with b the
mean of `log(f / m)` over the dice so far, in which later dice and larger samples count for more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.refine_options import MOST_DROPS
from dicedesign.design.result import DesignResult
from dicedesign.throws.total_variation import noise_floor, total_variation

__all__ = ["Refinement", "Round"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

GROWTH: Final = 1.5
"""Throws of a round over those of the one before."""

MEMORY: Final = 0.5
"""What a throw counts in the next round, over what that round's own count."""

SOFTENING: Final = 0.5
"""Throws added to each outcome, so that one that never came up has a logarithm."""

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
    """

    asked: Floats
    drops: int
    frequencies: Floats
    deviation: float
    noise_floor: float


@dataclass(frozen=True)
class Refinement:
    """Rounds of throwing a die and designing it anew.

    Attributes
    ----------
    target: (k,) wanted odds of the outcomes.
    orbits: (k,) a number for each outcome, the same for those whose facets are images of each other
        by a symmetry of the die: they are equally frequent but for chance.
    drops: throws of the first round. rounds: most rounds.
    throw: simulated counts (k + 1,) of a die, the last of throws that ended on no outcome, for so
        many throws and the round's number, each with random numbers of its own.
    design: from a die to one near it with other odds (k,) in the model, or None.
    on_round: called after every round of throws.
    """

    target: Floats
    orbits: Integers
    drops: int
    rounds: int
    throw: Callable[[DesignResult, int, int], Integers]
    design: Callable[[DesignResult, Floats], DesignResult | None]
    on_round: Callable[[Round], None] | None = None

    def refine(self, die: DesignResult) -> tuple[DesignResult, tuple[Round, ...]]:
        """The die that the rounds lead to from one whose odds in the model are the target, and the
        rounds. They end where the orbits deviate no more than those of a perfect die would on the
        mean. The last die has not been thrown."""
        asked = self.target
        bias, weight = np.zeros(len(asked)), 0.0
        history: list[Round] = []
        for number in range(self.rounds):
            counts = self.throw(die, min(round(self.drops * GROWTH**number), MOST_DROPS), number)
            thrown = self._round(asked, counts)
            history.append(thrown)
            if self.on_round is not None:
                self.on_round(thrown)
            if self._is_met(counts):
                break
            frequencies = self._softened(counts)
            weight *= MEMORY
            bias = (weight * bias + thrown.drops * np.log(frequencies / asked)) / (
                weight + thrown.drops
            )
            weight += thrown.drops
            found = self._corrected(die, asked, bias)
            if found is None:
                break
            die, asked = found
        return die, tuple(history)

    def _round(self, asked: Floats, counts: Integers) -> Round:
        drops = int(counts.sum())
        frequencies = counts / drops
        return Round(
            asked,
            drops,
            frequencies[:-1],
            total_variation(frequencies, np.append(self.target, 0.0)),
            noise_floor(self.target, drops),
        )

    def _is_met(self, counts: Integers) -> bool:
        """Whether the orbits deviate no more from the target than those of a perfect die would on
        the mean."""
        elsewhere = int(self.orbits.max()) + 1
        seen = np.bincount(np.append(self.orbits, elsewhere), counts)
        wanted = np.bincount(self.orbits, self.target)
        deviation = total_variation(seen / seen.sum(), np.append(wanted, 0.0))
        return deviation <= noise_floor(wanted, int(seen.sum()))

    def _softened(self, counts: Integers) -> Floats:
        """Positive frequencies (k,), equal within each orbit."""
        soft = counts[:-1] + SOFTENING
        pooled = np.bincount(self.orbits, soft) / np.bincount(self.orbits)
        frequencies: Floats = pooled[self.orbits] / soft.sum()
        return frequencies

    def _corrected(
        self, die: DesignResult, asked: Floats, bias: Floats
    ) -> tuple[DesignResult, Floats] | None:
        """A die that makes up for a bias (k,), and its odds in the model; where none is found,
        one that goes a part of the way from what was asked last."""
        wanted = np.log(self.target) - bias
        for halving in range(MOST_HALVINGS):
            part = 0.5**halving
            odds = np.exp(part * wanted + (1.0 - part) * np.log(asked))
            odds /= odds.sum()
            found = self.design(die, odds)
            if found is not None:
                return found, odds
        return None
