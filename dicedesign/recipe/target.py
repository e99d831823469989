"""`target` of a recipe: a distribution and its labels."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from dicedesign.errors import InputError
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
            f"expected 1 to {MAX_LABEL} characters, as no face can be blank, got "
            f"{text[: 2 * MAX_LABEL]!r}; rewrite it"
        )
    if isinstance(text, str) and "\n" in text:
        raise ValueError(
            "expected a label in one line, which is broken at spaces if needed, got "
            f"{text!r}; write spaces"
        )
    return text


Label = Annotated[str, BeforeValidator(_parse_label)]

Probability = Annotated[float, BeforeValidator(_parse_fraction)]


TERM = re.compile(
    r"\s*(?:(\d{0,3})d(\d{1,4}|F|%)(?:k([hl])(\d{0,3}))?|(\d{1,3}))\s*", re.IGNORECASE
)
"""A number of dice, their sides, and how many of the highest or lowest are kept; or a constant. F
is for Fate dice, which show -1, 0 or 1, % and 00 for tens from 00 to 90."""

WEIGHTS = re.compile(r"\s*[\d.]+(\s*:\s*[\d.]+)+\s*")

MOST_ROLLED = 20
"""Largest number of dice of which some are kept."""

MOST_DICE = 1000
"""Largest number of dice."""

MOST_CHARACTERS = 10_000
"""Largest length of a text for a target."""


def read_shorthand(text: str) -> dict[str, Any] | None:
    """Entries of `target` for dice such as "d7", "2d6 + d4 - 1", "4d6kh3" (the highest three),
    "d%" or "4dF", for weights such as "1:2:3", and for probabilities such as "1/2, 30%, 0.2"; None
    for any other text.

    Raises InputError for dice that cannot be kept, too many outcomes, and a text that is too long.
    """
    if len(text) > MOST_CHARACTERS:
        raise InputError(
            f"expected at most {MOST_CHARACTERS} characters, got {len(text)}; write less"
        )
    if "," in text and ":" not in text:
        return {"probabilities": [part.strip() for part in text.split(",")]}
    if WEIGHTS.fullmatch(text):
        with suppress(ValueError):
            weights = [Fraction(part.strip()) for part in text.split(":")]
            whole = sum(weights) or Fraction(1)
            return {"probabilities": [str(weight / whole) for weight in weights]}
    pieces, shift, kinds = re.split("([+-])", f"+{text}"), 0, set[str]()
    # Sign, values with the best first, number of dice and of those that are kept.
    rolls: list[tuple[int, Sequence[int], int, int]] = []
    for plus, piece in zip(pieces[1::2], pieces[2::2], strict=True):
        term, sign = TERM.fullmatch(piece), 1 if plus == "+" else -1
        if term is None:
            return None
        count, kind, end, kept, constant = term.groups()
        if constant is not None:
            shift += sign * int(constant)
            continue
        number, kind = int(count or 1), "%" if kind == "00" else kind.upper()
        special: dict[str, Sequence[int]] = {"F": range(-1, 2), "%": range(0, 100, 10)}
        values = special.get(kind) or range(1, int(kind) + 1)
        if end is None:
            if len(rolls) + number > MOST_DICE:
                raise InputError(f"expected at most {MOST_DICE} dice, got more; take fewer")
            rolls += [(sign, values, 1, 1)] * number
            kinds.add(kind if kind in "F%" else "plain" if sign > 0 else "less")
            continue
        keep = int(kept or 1)
        if not 1 <= keep <= number <= MOST_ROLLED:
            raise InputError(
                f"expected to keep 1 to all of at most {MOST_ROLLED} dice, got {piece.strip()!r}; "
                "write such as 4d6kh3, the highest three of four"
            )
        rolls.append((sign, values[::-1] if end in "hH" else values, number, keep))
        kinds.add("kept")
    if not kinds:
        return None
    if kinds == {"F"} and len(rolls) == 1 and not shift:
        return {"probabilities": ["1/6"] * 6, "labels": ["+", "+", "0", "0", "-", "-"]}
    if kinds == {"plain"}:
        sides = [len(values) for _, values, _, _ in rolls]
        entries: dict[str, Any] = {"fair": sides[0]} if len(sides) == 1 else {"sum_of_dice": sides}
        # The distribution refuses more.
        totals = range(len(sides), sum(sides) + 1)[: MOST_FACES + 1]
        return entries | ({"labels": [str(total + shift) for total in totals]} if shift else {})
    ways = Counter({shift: 1})
    for sign, values, number, keep in rolls:
        before, ways = ways, Counter()
        for value, many in _count_ways(values, number, keep).items():
            for total, others in before.items():
                ways[total + sign * value] += many * others
        if len(ways) > MOST_FACES:
            raise InputError(f"expected at most {MOST_FACES} outcomes, got more; take fewer dice")
    form = {"F": "+d", "%": "02d"}.get("".join(kinds), "d")
    return {
        "probabilities": [str(Fraction(ways[total], ways.total())) for total in sorted(ways)],
        "labels": [format(total, form).replace("+0", "0") for total in sorted(ways)],
    }


def _count_ways(values: Sequence[int], number: int, keep: int) -> Counter[int]:
    """Numbers of ways in which the first `keep` of a number of dice, in the order of their values,
    give each sum."""
    found, open_ways = Counter[int](), Counter({(number, keep, 0): 1})
    for worse, value in zip(reversed(range(len(values))), values, strict=True):
        before, open_ways = open_ways, Counter()
        for (left, missing, total), many in before.items():
            # As many of the dice that are left show this value; those after the kept ones are free.
            for shown in range(left + 1):
                ways = many * math.comb(left, shown)
                if shown < missing:
                    after = (left - shown, missing - shown, total + shown * value)
                    open_ways[after] += ways
                else:
                    found[total + missing * value] += ways * worse ** (left - shown)
        if len(found) > MOST_FACES:
            break
    return found


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
                "expected keys such as fair: 7, dice such as 2d6 or 4d6kh3, or weights such as "
                f"1:2:3 in quotes, got {given!r}; correct it"
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
