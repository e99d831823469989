"""The weights of the energy over time: what a design gives up for its target, and when."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from dicedesign.optimize.energy.term import EnergyWeights

__all__ = ["Schedule"]

STALL_WINDOW: Final = 10
"""Number of last energies that tell whether progress stalls: the later half against the earlier."""

STALL_DECREASE: Final = 0.02
"""Relative decrease of the energy over half a window below which progress has stalled."""

LAST_WINDOW: Final = 200
"""The same number once the shaping terms are dropped, when narrow valleys take long."""

LAST_DECREASE: Final = 0.05
"""Relative decrease over half of it below which there is no progress left."""

SMALLEST_RELAXATION: Final = 1e-3
"""Factor on the shaping terms below which they are dropped."""

NARROWING: Final = 0.1
"""Factor on the stability margin, and on what else is narrowed (`TermOption.narrows_to`), each time
there is no progress left with the present one."""


@dataclass
class Schedule:
    """The weights in force. First the terms that shape the die and pull away from the target, as
    barycenter and neighbor, give way, in steps and then altogether; then, where the target is still
    out of reach, the stability margin.

    Attributes
    ----------
    weights: in force now; at first the full ones.
    relaxation: factor on the shaping weights each time progress stalls, in (0, 1).
    tolerance: largest |p - q| wanted.
    """

    weights: EnergyWeights
    relaxation: float
    tolerance: float
    _left: float = 1.0
    _energies: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._full = self.weights

    def record(self, energy: float) -> None:
        """Take note of the energy after a step."""
        self._energies.append(energy)

    @property
    def at_rest(self) -> bool:
        """True where the last steps did little under the present weights."""
        return self._stalled(STALL_WINDOW, STALL_DECREASE)

    @property
    def exhausted(self) -> bool:
        """True where the present weights have given what they can: the shaping ones as soon as
        progress stalls, the last ones after a longer look."""
        return self._left > 0.0 or self._stalled(LAST_WINDOW, LAST_DECREASE)

    def give_way(self) -> bool:
        """Go on to the next weights; False where there are none."""
        if self._left > 0.0:
            self._left *= self.relaxation
            if self._left < SMALLEST_RELAXATION:
                self._left = 0.0
            self.weights = self._full.relaxed(self._left)
        else:
            narrowed = self.weights.narrowed(NARROWING)
            if narrowed is None:
                return False
            self.weights = narrowed
        self._energies.clear()
        return True

    def _stalled(self, window: int, decrease: float) -> bool:
        if len(self._energies) <= window:
            return False
        recent = self._energies[-window:]
        half = window // 2
        # Below the square of the tolerance an energy has nothing more to say.
        worth = max(recent[-1], self.tolerance**2)
        return min(recent[:half]) - min(recent[half:]) < decrease * worth
