"""`target` of a recipe: a distribution and its labels."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Annotated, Any, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from dicedesign.optimize.targets import Target, binomial, custom, fair, relabel, sum_of_dice

MAX_LABEL: Final = 24
"""Characters of a label."""


def _parse_fraction(value: object) -> object:
    if not isinstance(value, str):
        return value
    above, slash, below = value.partition("/")
    with suppress(ValueError, ZeroDivisionError):
        number = float(above) / (float(below) if slash else 1.0)
        if math.isfinite(number):
            return number
    raise ValueError(f"expected a number or a fraction such as 1/36, got {value!r}; correct it")


def _parse_label(value: object) -> object:
    if value is None or isinstance(value, bool):
        raise ValueError(
            f"expected a text, got {value}, which is how YAML reads words such as yes, no, on, off "
            "and null; put it in quotes"
        )
    is_number = isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))
    text = str(value) if is_number else value
    if isinstance(text, str) and not 1 <= len(text) <= MAX_LABEL:
        raise ValueError(
            f"expected 1 to {MAX_LABEL} characters, as no face can be blank, got {text!r}; "
            "rewrite it"
        )
    if isinstance(text, str) and "\n" in text:
        raise ValueError(
            "expected a label in one line, which is broken at spaces if needed, got "
            f"{text!r}; write spaces"
        )
    return text


Label = Annotated[str, BeforeValidator(_parse_label)]

Probability = Annotated[float, BeforeValidator(_parse_fraction)]


class Strict(BaseModel):
    """Part of a recipe that refuses unknown keys and conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    def one_of(self, *names: str) -> str:
        """Name of the only given entry. Raises ValueError unless exactly one is given."""
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            got = " and ".join(given) if given else "none of them"
            raise ValueError(f"expected exactly one of {', '.join(names)}, got {got}; keep one")
        return given[0]


TARGETS: Final = {
    "binomial": binomial,
    "sum_of_dice": sum_of_dice,
    "fair": fair,
    "probabilities": custom,
}
"""Function that makes the distribution of each key of `target`."""


class TargetRecipe(Strict):
    """`target`: a distribution, optionally with other labels.

    Attributes
    ----------
    binomial: number of heads among this number of fair coins, at least 1.
    sum_of_dice: total of fair dice with these numbers of sides, each at least 2.
    fair: number of equally probable outcomes, at least 2.
    probabilities: probabilities above 0 that sum to 1; numbers or fractions such as 1/36.
    labels: labels of 1 to 24 characters; by default those of the distribution.
    """

    binomial: int | None = None
    sum_of_dice: list[int] | None = None
    fair: int | None = None
    probabilities: list[Probability] | None = None
    labels: list[Label] | None = None

    @model_validator(mode="after")
    def _check(self) -> TargetRecipe:
        self.target()
        return self

    def target(self) -> Target:
        """Distribution with its labels."""
        name = self.one_of(*TARGETS)
        make: Any = TARGETS[name]
        return relabel(make(getattr(self, name)), self.labels)
