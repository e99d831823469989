"""A target as somebody types it, on the command line or into a page."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction
from typing import Any, Final

from dicedesign.errors import RecipeError
from dicedesign.recipe.schema.reading import loaded_yaml

__all__ = ["typed_target", "written_odds"]

LARGEST_DENOMINATOR: Final = 10_000
"""Of fractions that anybody reads."""


def typed_target(text: str, labels: str | None = None) -> dict[str, Any]:
    """The entries of a recipe's `target`, unchecked.

    Parameters
    ----------
    text: probabilities with commas between them, "1/2,1/3,1/6", or what a recipe says, "fair: 7",
        with the space or without.
    labels: with commas between them, or None for those of the target.

    Raises RecipeError for a text that is neither.
    """
    entries: dict[str, Any]
    if ":" in text:
        read = loaded_yaml(re.sub(r"^\s*(\w+):(?=\S)", r"\1: ", text), "target")
        if not isinstance(read, dict):
            raise RecipeError(
                f"target: expected probabilities or a key and a value, got {text!r}; write "
                "1/2,1/3,1/6, or fair: 7"
            )
        entries = read
    else:
        entries = {"probabilities": _listed(text)}
    if labels is not None:
        entries["labels"] = _listed(labels)
    return entries


def written_odds(odds: Iterable[float]) -> str:
    """The text that `typed_target` takes for these odds, to the last bit: fractions where they are
    short."""
    return ", ".join(map(_written, odds))


def _written(odds: float) -> str:
    short = Fraction(odds).limit_denominator(LARGEST_DENOMINATOR)
    return str(short) if short.numerator / short.denominator == odds else repr(float(odds))


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")]
