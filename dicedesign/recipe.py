"""What a recipe says, as checked options.

The parts of the schema that are options of the method or the engraving are the option classes
themselves; only what a file adds to them is described here.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    model_validator,
)

from dicedesign.design.descent import DescentOptions
from dicedesign.design.exact import ExactOptions
from dicedesign.design.orbit_layouts import OrbitLayouts
from dicedesign.design.starts import FEWEST_FACETS, hendecahedron, prism
from dicedesign.design.targets import Target, binomial, fair, listed, relabelled, sum_of_dice
from dicedesign.fabricate.engraving_options import EngravingOptions
from dicedesign.geometry.point_groups import point_group

__all__ = ["MOST_MM", "MethodRecipe", "Recipe", "StartRecipe", "TargetRecipe"]

FEWEST_SIDES: Final = 3
"""A prism has at least so many sides."""


LONGEST_LABEL: Final = 12
"""Characters that a facet may bear."""

MOST_MM: Final = 1000.0
"""Largest size of a die."""


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


def _known_group(name: str | None) -> str | None:
    if name is not None:
        point_group(name)
    return name


def _word(word: str, meaning: object) -> BeforeValidator:
    return BeforeValidator(lambda value: meaning if value == word else value)


def _switch(value: object) -> object:
    return {True: {}, False: None}[value] if isinstance(value, bool) else value


Label = Annotated[str, BeforeValidator(_text)]
Probability = Annotated[float, BeforeValidator(_fraction)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def _one_of(model: BaseModel, *names: str) -> None:
    given = [name for name in names if getattr(model, name) is not None]
    if len(given) != 1:
        got = " and ".join(given) if given else "none of them"
        raise ValueError(f"expected exactly one of {', '.join(names)}, got {got}; keep one")


class TargetRecipe(_Strict):
    """`target`: one distribution, perhaps with labels of one's own."""

    binomial: int | None = None
    sum_of_dice: list[int] | None = None
    fair: int | None = None
    probabilities: list[Probability] | None = None
    labels: list[Label] | None = None

    @model_validator(mode="after")
    def _check(self) -> TargetRecipe:
        _one_of(self, "binomial", "sum_of_dice", "fair", "probabilities")
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


class PrismRecipe(_Strict):
    """`start.prism`: sides default to the number of outcomes."""

    sides: int | None = None
    height: float = 1.5
    cap: float = 1.3

    def sides_for(self, outcomes: int) -> int:
        """The number of sides for so many outcomes."""
        return outcomes if self.sides is None else self.sides


class RepulsionRecipe(_Strict):
    """`start.repulsion`: one facet for each outcome."""


class MeshRecipe(_Strict):
    """`start.mesh`: the convex hull of a file. Its path is relative to the recipe's folder, or to
    the working directory in a change from the command line."""

    path: str


class SearchRecipe(_Strict):
    """`start.search`: random shapes with odds near the target's, one after the other."""


class StartRecipe(_Strict):
    """`start`: one starting shape, or a search for some."""

    prism: PrismRecipe | None = None
    hendecahedron: Literal["bisymmetric", "circus"] | None = None
    repulsion: RepulsionRecipe | None = None
    mesh: MeshRecipe | None = None
    search: SearchRecipe | None = None

    @model_validator(mode="after")
    def _check(self) -> StartRecipe:
        _one_of(self, "prism", "hendecahedron", "repulsion", "mesh", "search")
        return self

    def check(self, outcomes: int) -> None:
        """Raise ValueError, naming the key, where the shape cannot bear so many outcomes. What a
        mesh can bear is known only once it is read."""
        if self.mesh is not None or self.search is not None:
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


class MethodRecipe(_Strict):
    """`method`: how the die is found: `exact` unless it says `descent`."""

    exact: ExactOptions | None = Field(default_factory=ExactOptions)
    descent: DescentOptions | None = None

    @model_validator(mode="before")
    @classmethod
    def _choose(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("descent") is not None:
            if given.get("exact") is not None:
                raise ValueError("method: expected exact or descent, got both; keep one")
            return {**given, "exact": None}
        return given

    @model_validator(mode="after")
    def _check(self) -> MethodRecipe:
        _one_of(self, "exact", "descent")
        return self

    @property
    def tolerance_key(self) -> str:
        """Where a recipe says it."""
        chosen = "descent.stopping" if self.exact is None else "exact"
        return f"method.{chosen}.tolerance"

    @property
    def tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.descent is not None:
            return self.descent.stopping.tolerance
        assert self.exact is not None
        return self.exact.tolerance


class Recipe(_Strict):
    """A whole recipe.

    Attributes
    ----------
    name: folder name of the results.
    seed: of everything random.
    target, start: what is wanted, and what to begin with.
    assignment: labels in the order of the start's directions; None for the order of the target.
    center_of_mass: (3,) fixed, in the start's own coordinates (see `dicedesign.design.starts`);
        None for the uniform solid.
    symmetry: name of the point group that the die has (see `dicedesign.geometry.point_groups`),
        about the origin of the start's own coordinates; None if it need not have any.
    size_mm: largest vertex-to-vertex distance of the printed die.
    engrave: engraving options, or None for a plain die.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)]
    target: TargetRecipe
    start: StartRecipe
    seed: Annotated[int, Field(ge=0)] = 0
    assignment: Annotated[list[Label] | None, _word("in_order", None)] = None
    center_of_mass: Annotated[
        tuple[float, float, float] | None,
        _word("uniform", None),
        BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
    ] = None
    symmetry: Annotated[str | None, AfterValidator(_known_group), _word("none", None)] = None
    method: MethodRecipe = Field(default_factory=MethodRecipe)
    size_mm: Annotated[float, Field(gt=0.0, le=MOST_MM)] = 30.0
    engrave: Annotated[EngravingOptions | None, BeforeValidator(_switch)] = Field(
        default_factory=EngravingOptions
    )

    @model_validator(mode="after")
    def _check(self) -> Recipe:
        labels = self.target.target().labels
        if self.assignment is not None and sorted(self.assignment) != sorted(labels):
            raise ValueError(
                f"assignment: expected each of the labels {', '.join(labels)} once, got "
                f"{', '.join(self.assignment)}; write in_order for the target's order"
            )
        self.start.check(len(labels))
        if self.start.search is not None:
            self._check_search()
        if self.symmetry is not None:
            self._check_symmetry(self.symmetry)
        return self

    def _check_search(self) -> None:
        if self.method.exact is None:
            raise ValueError(
                "start.search: expected method: {exact: {}}, which can begin anywhere, got "
                "descent; change the method, or take another start"
            )
        if self.center_of_mass is not None:
            raise ValueError(
                "center_of_mass: expected uniform where the shape is searched, got a point in no "
                "known coordinates; leave it out, or take another start"
            )

    def _check_symmetry(self, name: str) -> None:
        if self.method.exact is None or self.method.exact.coordinates != "facets":
            raise ValueError(
                "symmetry: expected the exact method with coordinates: facets, got another; leave "
                "symmetry out, or change the method"
            )
        if self.center_of_mass is not None:
            raise ValueError(
                "center_of_mass: expected uniform with a symmetry, got a point; leave one of them "
                "out"
            )
        # Raises where equal probabilities do not fill whole orbits.
        OrbitLayouts(self.target.target().probabilities, point_group(name))

    def group(self) -> NDArray[np.float64] | None:
        """(g, 3, 3) the point group that the die has."""
        return None if self.symmetry is None else point_group(self.symmetry)

    def outcome_of_direction(self) -> list[int]:
        """For each direction of the start, the index of its outcome in the target."""
        labels = self.target.target().labels
        return [labels.index(label) for label in self.assignment or labels]

    def resolved(self) -> dict[str, Any]:
        """The recipe with every default written out, as plain data."""
        plain: dict[str, Any] = TypeAdapter(Recipe).dump_python(self, mode="json")
        plain["assignment"] = plain["assignment"] or "in_order"
        plain["center_of_mass"] = plain["center_of_mass"] or "uniform"
        plain["symmetry"] = plain["symmetry"] or "none"
        plain["engrave"] = plain["engrave"] or False
        for part in ("target", "start", "method"):
            plain[part] = {key: value for key, value in plain[part].items() if value is not None}
        return plain
