"""The likelihood of what came up with a die, thrown in a session that nobody measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import logsumexp

from dicedesign.runtime.arrays import Floats
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.fitting.odds_surrogate import OddsSurrogate
from dicedesign.throws.fitting.sessions import Offsets, session_points

__all__ = ["ThrownSession", "log_likelihoods"]

BLOCK: Final = 2**13
"""Sets whose odds are found at a time, which bounds the memory."""


@dataclass(frozen=True)
class ThrownSession:
    """One die, thrown in one session.

    Attributes
    ----------
    die: what was thrown, and what came up.
    surrogate: its odds, by the simulated set.
    """

    die: CountedDie
    surrogate: OddsSurrogate

    def by_session(self, points: Floats, offsets: Offsets, exact: bool) -> Floats:
        """Logarithms (n, k) of the likelihood of its counts in sessions (k, 4) at points (n, 5) of
        the prior; exact: as of `OddsSurrogate.log_likelihood`."""
        at_once = max(1, BLOCK // len(offsets))
        parts = []
        for first in range(0, len(points), at_once):
            sets = session_points(points[first : first + at_once], offsets, self.die.size)
            found = self.surrogate.log_likelihood(sets.reshape(-1, 5), self.die.counts, exact)
            parts.append(found.reshape(sets.shape[:2]))
        return np.concatenate(parts)


def log_likelihoods(
    sessions: Sequence[ThrownSession], points: Floats, offsets: Offsets, exact: bool
) -> Floats:
    """(n, dice) logarithms of the mean likelihood over equally likely sessions (k, 4), each die
    thrown in one of its own, at points (n, 5) of the prior."""
    means = [
        logsumexp(session.by_session(points, offsets, exact), axis=1) - np.log(len(offsets))
        for session in sessions
    ]
    return np.stack(means, axis=1)
