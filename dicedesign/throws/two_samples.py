"""Total variation between two sets of counts, beside what chance makes of equal odds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.throws.distances import total_variation
from dicedesign.throws.goodness_of_fit import drawn_counts

LEVEL: Final = 0.99
"""Of the limit of chance."""

DRAWS: Final = 4_000

SEED: Final = 0


@dataclass(frozen=True)
class SampledVariation:
    """The total variation between the frequencies of two samples.

    Attributes
    ----------
    value: 0 to 1.
    noise_floor: its mean for samples of these sizes out of the same odds.
    limit: not exceeded by a part `LEVEL` of those.
    """

    value: float
    noise_floor: float
    limit: float

    @property
    def beyond_chance(self) -> bool:
        """Whether it is above the limit."""
        return self.value > self.limit


def sampled_variation(first: ArrayLike, second: ArrayLike) -> SampledVariation:
    """Compare two sets of counts (k,), whole numbers of at least 0 and not all 0 in either.

    What chance makes is seen in pairs of samples, drawn with a fixed seed with the odds of both
    together.
    """
    one, other = np.asarray(first, dtype=np.int64), np.asarray(second, dtype=np.int64)
    sizes = int(one.sum()), int(other.sum())
    odds = (one + other) / sum(sizes)
    drawn = (drawn_counts(odds, size, DRAWS, SEED + i) for i, size in enumerate(sizes))
    distances = np.concatenate(
        [np.abs(a / sizes[0] - b / sizes[1]).sum(axis=1) / 2.0 for a, b in zip(*drawn, strict=True)]
    )
    return SampledVariation(
        total_variation(one / sizes[0], other / sizes[1]),
        float(distances.mean()),
        float(np.quantile(distances, LEVEL)),
    )
