"""Target and start of a recipe, as checked entries."""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from dicedesign.design.starts.hendecahedron import hendecahedron
from dicedesign.design.starts.prism import prism
from dicedesign.design.starts.repulsion import FEWEST_FACETS
from dicedesign.design.targets import Target, binomial, fair, listed, relabelled, sum_of_dice

__all__ = ["Label", "SearchRecipe", "StartRecipe", "Strict", "TargetRecipe", "one_of"]

FEWEST_SIDES: Final = 3
"""A prism has at least so many sides."""

LONGEST_LABEL: Final = 12
"""Characters that a facet may bear."""


def _fraction(value: object) -> object:
    if not isinstance(value, str):
        return value
    above, slash, below = value.partition("/")
    try:
        number = float(above) / (float(below) if slash else 1.0)
    except (ValueError, ZeroDivisionError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"expected a number or a fraction such as 1/36, got {value!r}; correct it")
    return number


def _text(value: object) -> object:
    if value is None or isinstance(value, bool):
        raise ValueError(
            f"expected a text, got {value}, which is how YAML reads words such as yes, no, on, off "
            "and null; put it in quotes"
        )
    text = str(value) if isinstance(value, int | float) and math.isfinite(value) else value
    if isinstance(text, str) and not 1 <= len(text) <= LONGEST_LABEL:
        raise ValueError(f"expected 1 to {LONGEST_LABEL} characters, got {text!r}; rewrite it")
    return text


Label = Annotated[str, BeforeValidator(_text)]

Probability = Annotated[float, BeforeValidator(_fraction)]


class Strict(BaseModel):
    """A part of a recipe: no unknown keys, no conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def one_of(model: BaseModel, *names: str) -> None:
    """Raise ValueError unless exactly one of the entries is given."""
    given = [name for name in names if getattr(model, name) is not None]
    if len(given) != 1:
        got = " and ".join(given) if given else "none of them"
        raise ValueError(f"expected exactly one of {', '.join(names)}, got {got}; keep one")


class TargetRecipe(Strict):
    """`target`: one distribution, perhaps with labels of one's own."""

    binomial: int | None = None
    sum_of_dice: list[int] | None = None
    fair: int | None = None
    probabilities: list[Probability] | None = None
    labels: list[Label] | None = None

    @model_validator(mode="after")
    def _check(self) -> TargetRecipe:
        one_of(self, "binomial", "sum_of_dice", "fair", "probabilities")
        self.target()
        return self

    def target(self) -> Target:
        """The distribution with its labels."""
        if self.binomial is not None:
            bare = binomial(self.binomial)
        elif self.sum_of_dice is not None:
            bare = sum_of_dice(self.sum_of_dice)
        elif self.fair is not None:
            bare = fair(self.fair)
        else:
            bare = listed(self.probabilities or [])
        return relabelled(bare, self.labels)


class PrismRecipe(Strict):
    """`start.prism`: sides default to the number of outcomes."""

    sides: int | None = None
    height: float = 1.5
    cap: float = 1.3

    def sides_for(self, outcomes: int) -> int:
        """The number of sides for so many outcomes."""
        return outcomes if self.sides is None else self.sides


class RepulsionRecipe(Strict):
    """`start.repulsion`: one facet for each outcome."""


class MeshRecipe(Strict):
    """`start.mesh`: the convex hull of a file, or its surface where the die is concave. Its path is
    relative to the recipe's folder, or to the working directory in a change from the command
    line."""

    path: str


class SearchRecipe(Strict):
    """`start.search`: random shapes with odds near the target's, one after the other."""


class StartRecipe(Strict):
    """`start`: one starting shape, or a search for some. `shape` is one of
    `dicedesign.concave.shapes.shapes`, for a concave die."""

    prism: PrismRecipe | None = None
    hendecahedron: Literal["bisymmetric", "circus"] | None = None
    repulsion: RepulsionRecipe | None = None
    mesh: MeshRecipe | None = None
    shape: Literal["duck", "gear", "kitten", "knot"] | None = None
    search: SearchRecipe | None = None

    @model_validator(mode="after")
    def _check(self) -> StartRecipe:
        one_of(self, "prism", "hendecahedron", "repulsion", "mesh", "shape", "search")
        return self

    @property
    def name(self) -> str:
        """The key of the start."""
        return next(key for key, value in self if value is not None)

    def check(self, outcomes: int) -> None:
        """Raise ValueError, naming the key, where the shape cannot bear so many outcomes. What a
        mesh or a shape can bear is known only once it is there."""
        if self.name in ("mesh", "shape", "search"):
            return
        if outcomes < FEWEST_SIDES:
            raise ValueError(
                f"start: expected a mesh or a search for {outcomes} outcomes, as every other start "
                f"has at least {FEWEST_SIDES} rests; write start: {{search: {{}}}}, or start: "
                "{mesh: {path: FILE}}"
            )
        if self.prism is not None:
            sides = self.prism.sides_for(outcomes)
            prism(sides, self.prism.height, self.prism.cap)
            if sides != outcomes:
                raise ValueError(
                    f"start.prism.sides: expected {outcomes}, one side for each outcome of the "
                    f"target, got {sides}; leave it out"
                )
        elif self.hendecahedron is not None:
            facets = len(hendecahedron(self.hendecahedron).directions)
            if facets != outcomes:
                raise ValueError(
                    f"start.hendecahedron: expected a target of {facets} outcomes, one for each "
                    f"facet, got {outcomes}; take another start"
                )
        elif outcomes < FEWEST_FACETS:
            raise ValueError(
                f"start.repulsion: expected a target of at least {FEWEST_FACETS} outcomes, got "
                f"{outcomes}; take a prism"
            )
