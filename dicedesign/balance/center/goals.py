"""What a center of mass is to do for the odds of a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from dicedesign.errors import InputError
from dicedesign.runtime.checks import is_finite_number
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE

__all__ = ["EqualOdds", "FewestRests", "GivenOdds", "Goal", "Standing"]

MOST_POSES: Final = 100
"""That a goal is about: three coordinates do not lead many odds."""


@dataclass(frozen=True)
class EqualOdds:
    """Equal odds of the most probable poses, whichever these are then (Figure 12).

    `count`: of these poses, from 2 to `MOST_POSES`. Raises InputError for another.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count != int(self.count) or not 2 <= self.count <= MOST_POSES:
            raise InputError(
                f"equal: expected a number of poses from 2 to {MOST_POSES}, got {self.count}; take "
                "3, say"
            )


@dataclass(frozen=True)
class Standing:
    """The largest odds of one pose.

    Give one of `pose`, its number as `dicedesign rest` lists it, 1 for the most probable, and
    `down`, (x, y, z), the direction that points down then, to within 5 degrees. Raises InputError
    for neither, both, or what is none.
    """

    pose: int | None = None
    down: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if (self.pose is None) == (self.down is None):
            raise InputError(
                "stand: expected the number of a pose or the direction that points down, got "
                f"{'neither' if self.pose is None else 'both'}; give one"
            )
        if self.pose is not None and (self.pose != int(self.pose) or self.pose < 1):
            raise InputError(
                f"stand: expected the number of a pose, 1 for the most probable, got {self.pose}; "
                "dicedesign rest lists them"
            )
        if self.down is not None and (
            len(self.down) != 3
            or not all(map(is_finite_number, self.down))
            or not 0.0 < sum(abs(x) for x in self.down) < 1e100
        ):
            raise InputError(
                f"stand: expected a direction x,y,z other than 0,0,0, got {self.down}; 0,0,-1 is "
                "down as the body is in its file"
            )


@dataclass(frozen=True)
class FewestRests:
    """As few rests as can be."""


@dataclass(frozen=True)
class GivenOdds:
    """Odds of some poses; all others are left what remains.

    Attributes
    ----------
    odds: above 0, with a sum of at most 1.
    poses: as many numbers of poses, as `dicedesign rest` lists them, from 1; None for the most
        probable ones, whichever these are then, in the order of their odds.

    Raises InputError for what is none.
    """

    odds: tuple[float, ...]
    poses: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        _check_odds(self.odds)
        if self.poses is None:
            return
        if len(self.poses) != len(self.odds) or len(set(self.poses)) < len(self.poses):
            raise InputError(
                f"poses: expected {len(self.odds)} numbers of poses, each once, as there are odds, "
                f"got {self.poses}; give one for each"
            )
        if any(pose != int(pose) or pose < 1 for pose in self.poses):
            raise InputError(
                f"poses: expected numbers of poses, 1 for the most probable, got {self.poses}; "
                "dicedesign rest lists them"
            )


Goal: TypeAlias = EqualOdds | Standing | FewestRests | GivenOdds
"""What a center of mass is to do."""


def _check_odds(odds: Sequence[float]) -> None:
    if not 1 <= len(odds) <= MOST_POSES or not all(map(is_finite_number, odds)):
        raise InputError(
            f"target: expected from 1 to {MOST_POSES} probabilities, got {odds}; give some numbers"
        )
    if min(odds) <= 0.0 or sum(odds) > 1.0 + PROBABILITY_SUM_TOLERANCE:
        raise InputError(
            "target: expected probabilities above 0 with a sum of at most 1, got "
            f"{', '.join(f'{p:g}' for p in odds)} with a sum of {sum(odds):.6g}; what they leave "
            "is for all other poses"
        )
