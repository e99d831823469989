"""Options of designing against simulated throws."""

from __future__ import annotations

from dataclasses import dataclass

from dicedesign.errors import InputError
from dicedesign.options import STRICT
from dicedesign.throws.simulation import Engine

__all__ = ["RefineOptions"]


@dataclass(frozen=True)
class RefineOptions:
    """Options of `method.exact.refine`.

    Attributes
    ----------
    drops: simulated throws of the first round, above 0; each later round has half as many again.
    rounds: most rounds of throwing a die and designing it anew, above 0.
    verdict: throws that judge the last die, above 0.
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
        for name in ("drops", "rounds", "verdict"):
            value = getattr(self, name)
            if value < 1:
                raise InputError(
                    f"refine.{name}: expected a whole number above 0, got {value}; raise it"
                )
        if not 0.0 < self.within < 1.0:
            raise InputError(
                f"refine.within: expected a number in (0, 1), got {self.within:g}; leave it out "
                "for 0.01"
            )
