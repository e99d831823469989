"""`target` of a recipe: a distribution and its labels."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from dicedesign.optimize.targets import (
    MOST_FACES,
    Target,
    binomial,
    custom,
    equal_faces,
    fair,
    relabel,
    several_faces,
    sum_of_dice,
)

MAX_LABEL = 24
"""Characters of a label."""


def _parse_fraction(value: object) -> object:
    if not isinstance(value, str):
        return value
    above, slash, below = value.strip().removesuffix("%").partition("/")
    with suppress(ValueError, ZeroDivisionError):
        number = float(above) / (float(below) if slash else 1.0)
        number /= 100.0 if value.strip().endswith("%") else 1.0
        if math.isfinite(number):
            return number
    raise ValueError(
        f"expected a number, a fraction such as 1/36, or a percentage such as 50%, got {value!r}; "
        "correct it"
    )


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


DICE = re.compile(r"(\d{0,3})d(\d{1,4}|F)", re.IGNORECASE)
"""A number of dice and their sides; F for Fate dice, which show -1, 0 or 1."""

WEIGHTS = re.compile(r"\s*[\d.]+(\s*:\s*[\d.]+)+\s*")


def read_shorthand(text: str) -> dict[str, Any] | None:
    """Entries of `target` for dice such as "d7", "2d6", "2d6 + d4" or "4dF", for weights such as
    "1:2:3", and for probabilities such as "1/2, 30%, 0.2"; None for any other text."""
    if "," in text and ":" not in text:
        return {"probabilities": [part.strip() for part in text.split(",")]}
    if WEIGHTS.fullmatch(text):
        with suppress(ValueError):
            weights = [Fraction(part.strip()) for part in text.split(":")]
            whole = sum(weights) or Fraction(1)
            return {"probabilities": [str(weight / whole) for weight in weights]}
    dice = [DICE.fullmatch(part.strip()) for part in text.split("+")]
    if None in dice:
        return None
    counts = [(int(one[1] or 1), one[2].upper()) for one in dice if one is not None]
    kinds = {sides for _, sides in counts}
    if kinds == {"F"}:
        number = sum(count for count, _ in counts)
        if number == 1:
            return {"probabilities": ["1/6"] * 6, "labels": ["+", "+", "0", "0", "-", "-"]}
        ways = [1]
        for _ in range(min(number, MOST_FACES)):
            ways = [sum(ways[max(k - 2, 0) : k + 1]) for k in range(len(ways) + 2)]
        probabilities = [str(Fraction(way, 3**number)) for way in ways]
        labels = [f"{total:+d}" if total else "0" for total in range(-number, number + 1)]
        return {"probabilities": probabilities, "labels": labels}
    if "F" in kinds:
        return None
    sides = [int(each) for count, each in counts for _ in range(count)]
    return {"fair": sides[0]} if len(sides) == 1 else {"sum_of_dice": sides}


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


class OutcomeRecipe(Strict):
    """One of `target.outcomes`.

    Attributes
    ----------
    label: 1 to 24 characters.
    probability: of all faces of the outcome together.
    faces: number of faces that show it, at least 1.
    """

    label: Label
    probability: Probability
    faces: int = 1


def _join_outcomes(outcomes: list[OutcomeRecipe]) -> Target:
    return several_faces(
        [one.label for one in outcomes],
        [one.probability for one in outcomes],
        [one.faces for one in outcomes],
    )


TARGETS = {
    "binomial": binomial,
    "sum_of_dice": sum_of_dice,
    "fair": fair,
    "probabilities": custom,
    "outcomes": _join_outcomes,
}
"""Function that makes the distribution of each key of `target`."""


class TargetRecipe(Strict):
    """`target`: a distribution, optionally with other labels; or a text such as 2d6, see
    `read_shorthand`.

    Attributes
    ----------
    binomial: number of heads among this number of fair coins, at least 1.
    sum_of_dice: total of fair dice with these numbers of sides, each at least 2.
    fair: number of equally probable outcomes, at least 2.
    probabilities: probabilities above 0 that sum to 1; numbers or fractions such as 1/36.
    outcomes: outcomes with a label, a probability and a number of faces each.
    labels: labels of 1 to 24 characters; by default those of the distribution. Faces with the same
        label are one outcome, whose probability is their sum.
    faces: number of faces, all equally probable whatever `share` says; each outcome gets its part.
        Of 36 faces for two dice, one shows 2 and six show 7. `labels` are one for each outcome.
        None is one face for each label.
    share: how the faces of an outcome share its probability: "free" for the shares that make the
        best shape, "equal" for equal parts, or those that `probabilities` gives.
    """

    binomial: int | None = None
    sum_of_dice: list[int] | None = None
    fair: int | None = None
    probabilities: list[Probability] | None = None
    outcomes: list[OutcomeRecipe] | None = None
    labels: list[Label] | None = None
    faces: int | None = None
    share: Literal["free", "equal"] = "free"

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        entries = read_shorthand(given)
        if entries is None:
            raise ValueError(
                f"expected keys such as fair: 7, dice such as 2d6, or weights such as 1:2:3 in "
                f"quotes, got {given!r}; correct it"
            )
        return entries

    @model_validator(mode="after")
    def _check(self) -> TargetRecipe:
        if self.outcomes is not None and self.labels is not None:
            raise ValueError(
                "labels: expected none with outcomes, which have their own, got some; leave them "
                "out"
            )
        self.target()
        return self

    def target(self) -> Target:
        """Distribution with its labels."""
        name = self.one_of(*TARGETS)
        make: Any = TARGETS[name]
        target = relabel(make(getattr(self, name)), self.labels)
        if self.faces is not None:
            return equal_faces(target, self.faces)
        return replace(target, keeps_shares=self.share == "equal")
