"""A recipe as checked options.

The parts of the schema that are options of the method or the engraving are the option classes
themselves; only what a file adds to them is described here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from dicedesign.concave.options import ConcaveOptions
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.fabricate.printing.options import PrintOptions
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.paper_options import PaperOptions
from dicedesign.optimize.starts.kinds.search import SearchOptions
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.recipe.schema.entries import Label, StartRecipe, Strict, TargetRecipe, one_of
from dicedesign.runtime.arrays import Floats

__all__ = ["MOST_MM", "NAME", "Recipe"]

NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,99}$"
"""Of a die, and of the folder of its results."""

LEAST_MM: Final = 1e-3

MOST_MM: Final = 1000.0
"""Smallest and largest size of a die."""

METHODS: Final = ("exact", "paper", "concave")
"""Keys of `method`."""


def _known_group(name: str | None) -> str | None:
    if name is not None:
        point_group(name)
    return name


def _word(word: str, meaning: object) -> BeforeValidator:
    return BeforeValidator(lambda value: meaning if value == word else value)


def _switch(value: object) -> object:
    return {True: {}, False: None}[value] if isinstance(value, bool) else value


class MethodRecipe(Strict):
    """`method`: how the die is found: `exact` unless it says `paper`, or `concave` for a die that
    keeps the shape of its start. A word alone is the method with all its defaults."""

    exact: ExactOptions | None = Field(default_factory=ExactOptions)
    paper: PaperOptions | None = None
    concave: ConcaveOptions | None = None

    @model_validator(mode="before")
    @classmethod
    def _choose(cls, given: Any) -> Any:
        if given in METHODS:
            given = {given: {}}
        if isinstance(given, dict) and any(given.get(name) is not None for name in METHODS):
            return {"exact": None, **given}
        return given

    @model_validator(mode="after")
    def _check(self) -> MethodRecipe:
        one_of(self, *METHODS)
        return self

    @property
    def name(self) -> str:
        """The key of the method."""
        return next(key for key, value in self if value is not None)

    @property
    def thrown(self) -> bool:
        """True where the target is meant for a die that is thrown onto a table."""
        return self.exact is not None and self.exact.odds == "thrown"

    @property
    def tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.paper is not None:
            return self.paper.reached
        options = self.exact or self.concave
        assert options is not None
        return options.tolerance


class Recipe(Strict):
    """A whole recipe.

    Attributes
    ----------
    name: folder name of the results.
    seed: of everything random, below 2^64.
    target: the outcomes and their odds.
    start: a shape to begin with; shapes are searched, unless given.
    assignment: labels in the order of the start's directions; None, "in_order" in a file, for the
        order of the target; empty, "any" in a file, for one order after the other, at random, until
        one leads there.
    center_of_mass: (3,) fixed, in the coordinates that a given start is made or read in; None,
        "uniform" in a file, for that of the solid.
    symmetry: name of the point group that the die has, such as C2, Cs, D3h, Td, Oh or Ih, about the
        centroid of the start, along its own axes; None, "none" in a file, if it need not have any.
    size_mm: largest vertex-to-vertex distance of the printed die.
    min_inradius_mm: radius of a circle that the facet of each outcome has room for.
    engrave: engraving options, or None for a plain die, which a concave one is unless the recipe
        says otherwise.
    print: how the die will be printed.
    figures: whether pictures are drawn. report: whether the page is made.
    clock: whether run times and memory are told; without them, and where no limit of seconds is
        reached, the same recipe gives the same bytes in every file.
    """

    name: Annotated[str, Field(pattern=NAME)]
    target: TargetRecipe
    start: StartRecipe = Field(default_factory=lambda: StartRecipe("search", SearchOptions()))
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    assignment: Annotated[list[Label] | None, _word("in_order", None), _word("any", [])] = None
    center_of_mass: Annotated[
        tuple[float, float, float] | None,
        _word("uniform", None),
        BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
    ] = None
    symmetry: Annotated[str | None, AfterValidator(_known_group), _word("none", None)] = None
    method: MethodRecipe = Field(default_factory=MethodRecipe)
    size_mm: Annotated[float, Field(ge=LEAST_MM, le=MOST_MM)] = 30.0
    min_inradius_mm: Annotated[float, Field(ge=0.0)] = 0.0
    engrave: Annotated[EngravingOptions | None, BeforeValidator(_switch)] = Field(
        default_factory=EngravingOptions
    )
    print: PrintOptions = Field(default_factory=PrintOptions)
    figures: bool = True
    report: bool = True
    clock: bool = True

    @model_validator(mode="before")
    @classmethod
    def _plain_if_concave(cls, given: Any) -> Any:
        if isinstance(given, dict) and "engrave" not in given:
            method = given.get("method")
            if method == "concave" or (
                isinstance(method, dict) and method.get("concave") is not None
            ):
                return {**given, "engrave": False}
        return given

    @model_validator(mode="after")
    def _check(self) -> Recipe:
        labels = self.target.target().labels
        if self.method.concave is not None:
            self._check_concave()
        elif self.start.kind.make is None and self.start.kind.search is None:
            raise ValueError(
                f"start.{self.start.name}: expected method: {{concave: {{}}}} with it, got "
                f"{self.method.name}; change the method, or take another start"
            )
        if self.any_order:
            self._check_any_order()
        elif self.assignment is not None and sorted(self.assignment) != sorted(labels):
            raise ValueError(
                f"assignment: expected each of the labels {', '.join(labels)} once, got "
                f"{', '.join(self.assignment)}; write in_order for the target's order"
            )
        self.start.check(len(labels))
        if self.start.kind.search is not None:
            self._check_search()
        if self.min_inradius_mm > 0.0 and self.method.exact is None:
            raise ValueError(
                "min_inradius_mm: expected the exact method, which can keep to it, got "
                f"{self.method.name}; leave it out, or change the method"
            )
        if not self.min_inradius_mm < self.size_mm / 2.0:
            raise ValueError(
                f"min_inradius_mm: expected less than half of size_mm = {self.size_mm:g}, got "
                f"{self.min_inradius_mm:g}; lower it"
            )
        if self.symmetry is not None:
            self._check_symmetry(self.symmetry)
        return self

    def _check_concave(self) -> None:
        if self.start.kind.surface is None:
            raise ValueError(
                "start: expected a surface to keep with the concave method, got "
                f"{self.start.name}; write start: {{mesh: {{path: FILE}}}}, or start: "
                "{shape: kitten}"
            )
        if self.assignment is not None:
            raise ValueError(
                "assignment: expected in_order with the concave method, which finds the sides for "
                "the outcomes itself, got another; leave it out"
            )
        if self.center_of_mass is not None:
            raise ValueError(
                "center_of_mass: expected uniform with the concave method, which shapes a solid of "
                "one material, got a point; leave it out"
            )

    def _check_any_order(self) -> None:
        searched = self.start.kind.search is not None
        if self.method.exact is None or searched or self.symmetry is not None:
            raise ValueError(
                "assignment: expected any with the exact method, a start that is given and no "
                "symmetry, got it with another; write in_order, or leave it out"
            )

    def _check_search(self) -> None:
        if self.method.exact is None:
            raise ValueError(
                f"start.{self.start.name}: expected method: {{exact: {{}}}}, which can begin "
                f"anywhere, got {self.method.name}; change the method, or take another start"
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

    def group(self) -> Floats | None:
        """(g, 3, 3) the point group that the die has."""
        return None if self.symmetry is None else point_group(self.symmetry)

    def outcome_of_direction(self) -> list[int]:
        """For each direction of the start, the index of its outcome in the target."""
        labels = self.target.target().labels
        return [labels.index(label) for label in self.assignment or labels]

    @property
    def any_order(self) -> bool:
        """True where the labels may come in any order."""
        return self.assignment == []

    def doubts(self) -> Iterator[str]:
        """Oddities of a recipe that can be run all the same, in words."""
        smallest = float(self.target.target().probabilities.min())
        if self.method.tolerance >= smallest:
            yield (
                f"the tolerance is not below the smallest outcome, {smallest:.3g}: set "
                f"method.{self.method.name}.tolerance lower"
            )

    def resolved(self) -> dict[str, Any]:
        """The recipe with every default written out, as plain data."""
        plain: dict[str, Any] = self.model_dump(mode="json")
        plain["assignment"] = plain["assignment"] or ("any" if self.any_order else "in_order")
        plain["center_of_mass"] = plain["center_of_mass"] or "uniform"
        plain["symmetry"] = plain["symmetry"] or "none"
        plain["engrave"] = plain["engrave"] or False
        for part in ("target", "start", "method"):
            plain[part] = {key: value for key, value in plain[part].items() if value is not None}
        return plain
