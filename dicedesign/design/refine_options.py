"""Options of designing against simulated throws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dicedesign.errors import InputError
from dicedesign.options import STRICT
from dicedesign.throws.simulation import Engine

__all__ = ["MOST_DROPS", "MOST_ROUNDS", "RefineOptions"]

MOST_DROPS: Final = 10_000_000
MOST_ROUNDS: Final = 50


@dataclass(frozen=True)
class RefineOptions:
    """Options of `method.exact.refine`.

    Attributes
    ----------
    drops: simulated throws of the first round, 1 to `MOST_DROPS`; each later round has half as many
        again, but not more than those. Where the die is made robust, all rounds but the last
        two also have half as many onto each of two changed tables.
    rounds: most rounds of throwing a die and designing it anew, 1 to `MOST_ROUNDS`.
    verdict: throws that judge the last die, 1 to `MOST_DROPS`.
    within: largest total variation from the target, by the verdict, that counts as reached; above 0
        and below 1.
    engine: the simulator.
    """

    __pydantic_config__ = STRICT

    drops: int = 20_000
    rounds: int = 5
    verdict: int = 100_000
    within: float = 0.01
    engine: Engine = "native"

    def __post_init__(self) -> None:
        for name, most in (("drops", MOST_DROPS), ("rounds", MOST_ROUNDS), ("verdict", MOST_DROPS)):
            value = getattr(self, name)
            if not 1 <= value <= most:
                raise InputError(
                    f"refine.{name}: expected a whole number from 1 to {most}, got {value}; "
                    "correct it"
                )
        if not 0.0 < self.within < 1.0:
            raise InputError(
                f"refine.within: expected a number in (0, 1), got {self.within:g}; leave it out "
                "for 0.01"
            )
