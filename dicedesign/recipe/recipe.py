"""A recipe as checked options.

The parts of the schema that are options of the method or the engraving are the option classes
themselves; only what a file adds to them is described here.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Final, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    TypeAdapter,
    create_model,
    model_validator,
)
from pydantic_core import core_schema

from dicedesign.balance.options import InsideOptions
from dicedesign.concave.options import ConcaveOptions
from dicedesign.fabricate.file_formats import with_stl
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.fabricate.printers import PrintOptions
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.starts.kinds import SearchOptions
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.recipe.target import Label, Strict, TargetRecipe
from dicedesign.rest.prior import DensityPrior, read_prior
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import LEAST_MM, MOST_MM

NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,99}$"
"""Of a die, and of the folder of its results."""

AUTO: Final = "auto"
"""A symmetry that is found once the recipe runs."""

LEAST_DEPTH: Final = 1e-6
"""Smallest depth of labels over the size of the die; files in single precision round what is not
much smaller."""

MARKED: Final = (("engraved", "shape"), ("engraved", "none"))
"""Style and balance of marks on a die that keeps the shape of a surface."""


@dataclass(frozen=True)
class StartRecipe:
    """`start`: one starting shape, or a search for some; see `STARTS`.

    Attributes
    ----------
    name: the key of the start.
    options: what is said of it.

    The key is an attribute too: `start.mesh` has the options of a mesh, or is None for another.
    """

    name: str
    options: Any

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in STARTS:
            raise AttributeError(name)
        return self.options if name == self.name else None

    @property
    def kind(self) -> StartKind:
        """Kind of the start."""
        return STARTS[self.name]

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        def read(entry: Any) -> StartRecipe:
            if isinstance(entry, cls):
                return entry
            keys = _start_keys()
            model = keys.model_validate_json(json.dumps(entry))
            name = model.one_of(*keys.model_fields)
            return cls(name, getattr(model, name))

        def written(start: StartRecipe) -> dict[str, Any]:
            options = TypeAdapter(start.kind.options).dump_python(start.options, mode="json")
            return {start.name: options}

        return core_schema.no_info_plain_validator_function(
            read, serialization=core_schema.plain_serializer_function_ser_schema(written)
        )

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        keys: dict[str, Any] = handler(_start_keys().__pydantic_core_schema__)
        return keys


def _start_keys() -> type[Strict]:
    """A model with a key for each start that is registered now."""
    return _keys_of(tuple((kind.name, kind.options) for kind in STARTS))


@cache
def _keys_of(kinds: tuple[tuple[str, Any], ...]) -> type[Strict]:
    keys: dict[str, Any] = {name: (options | None, None) for name, options in kinds}
    return create_model("StartKeys", __base__=Strict, **keys)


METHODS: Final = ("exact", "paper", "concave")
"""Keys of `method`."""


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
        self.one_of(*METHODS)
        return self

    @property
    def name(self) -> str:
        """The key of the method."""
        return self.one_of(*METHODS)

    @property
    def thrown(self) -> bool:
        """True where the target is meant for a die that is thrown onto a table."""
        return self.exact is not None and self.exact.probabilities == "thrown"

    @property
    def table(self) -> str | None:
        """Name of the table that the die is thrown onto, with the way to throw, for `load_table`;
        None for a die whose target is meant without momentum."""
        return self.exact.table_with_hand if self.exact is not None and self.thrown else None

    @property
    def tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.paper is not None:
            return self.paper.reached
        options = self.exact or self.concave
        assert options is not None
        return options.tolerance


def _known_prior(text: str | None) -> str | None:
    if text is not None and not isinstance(read_prior(text), DensityPrior):
        raise ValueError(
            f"expected a density, which has derivatives to design by, got {text!r}; `dicedesign "
            "rest` says which vmf density is nearest to samples"
        )
    return text


def _known_group(name: str | None) -> str | None:
    if name not in (None, AUTO):
        point_group(name)
    return name


def _word(word: str, meaning: object) -> BeforeValidator:
    return BeforeValidator(lambda value: meaning if value == word else value)


def _list_names(names: object) -> object:
    """A word as a list of one; a bare `off` is false in YAML."""
    listed = names if isinstance(names, list) else [names]
    return ["off" if name is False else name for name in listed]


def _switch(key: str | None = None) -> BeforeValidator:
    """`true` as all defaults, `false` as none, and a word as the value of a key."""

    def read(value: object) -> object:
        if key is not None and isinstance(value, str):
            return {key: value}
        return {True: {}, False: None}[value] if isinstance(value, bool) else value

    return BeforeValidator(read)


class Recipe(Strict):
    """A whole recipe.

    Attributes
    ----------
    name: folder name of the results.
    seed: of everything random, below 2^64.
    target: the outcomes and their probabilities.
    start: a shape to begin with; shapes are searched, unless given.
    assignment: labels in the order of the start's directions; None, "in_order" in a file, for the
        order of the target; empty, "any" in a file, for one order after the other, at random, until
        one leads there.
    numbering: of outcomes that are equally probable, where their labels are numbers: "given" as
        assigned, "standard" for opposite facets that sum to a constant where the shape allows,
        "balanced" for sums over opposite facets and around corners that are as even as possible.
    center_of_mass: (3,) fixed, in the coordinates that a given start is made or read in; None,
        "uniform" in a file, for that of the solid.
    prior: how likely each direction is to be down at first, such as "vmf:0,0,-1:5", one of
        `PRIORS`; the directions are in the coordinates that the start is made or read in, which the
        files keep; None, "uniform" in a file, for all alike.
    symmetry: name of the point group that the die has, such as C2, Cs, D3h, Td, Oh or Ih, about the
        centroid of the start, along its own axes; "auto" for the one that helps most among those
        that the target allows, as for thrown dice whose shapes are searched unless one is given;
        None, "none" in a file, if it need not have any.
    size_mm: largest vertex-to-vertex distance of the printed die.
    min_inradius_mm: radius of a circle that the facet of each outcome has room for.
    engrave: engraving options, or None for a plain die, which a concave one is unless the recipe
        says otherwise.
    edges: how edges and corners are rounded, or None for sharp ones.
    inside: what brings the center of mass of the printed die to a `center_of_mass` that is given,
        or None for a die whose maker does that.
    print: what it is printed with, or None where nobody asks how it prints.
    files: formats of the printed die; STL, by which it is judged, is always among them.
    data_sheet: whether a page to print about the die is made, as PDF and PNG.
    figures: whether pictures are drawn. report: whether the page is made.
    clock: whether run times and memory are told; without them, and where no limit of seconds is
        reached, the same recipe gives the same bytes in every file.
    """

    name: Annotated[str, Field(pattern=NAME)]
    target: TargetRecipe
    start: StartRecipe = Field(default_factory=lambda: StartRecipe("search", SearchOptions()))
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    assignment: Annotated[list[Label] | None, _word("in_order", None), _word("any", [])] = None
    numbering: Literal["given", "standard", "balanced"] = "given"
    center_of_mass: Annotated[
        tuple[float, float, float] | None,
        _word("uniform", None),
        BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
    ] = None
    prior: Annotated[str | None, AfterValidator(_known_prior), _word("uniform", None)] = None
    symmetry: Annotated[str | None, AfterValidator(_known_group), _word("none", None)] = None
    method: MethodRecipe = Field(default_factory=MethodRecipe)
    size_mm: Annotated[float, Field(ge=LEAST_MM, le=MOST_MM)] = 30.0
    min_inradius_mm: Annotated[float, Field(ge=0.0)] = 0.0
    engrave: Annotated[EngravingOptions | None, _switch()] = Field(default_factory=EngravingOptions)
    edges: Annotated[EdgeOptions | None, _switch()] = None
    inside: Annotated[InsideOptions | None, _switch("by")] = None
    print: Annotated[PrintOptions | None, _switch("printer")] = Field(default_factory=PrintOptions)
    files: Annotated[list[str], AfterValidator(with_stl), BeforeValidator(_list_names)] = Field(
        default_factory=lambda: ["stl"]
    )
    data_sheet: bool = False
    figures: bool = True
    report: bool = True
    clock: bool = True

    @model_validator(mode="before")
    @classmethod
    def _plain_if_concave(cls, given: Any) -> Any:
        if isinstance(given, dict) and "engrave" not in given:
            method = given.get("method")
            options = method.get("concave") if isinstance(method, dict) else None
            if method == "concave" or options is not None:
                return {**given, "engrave": False}
        return given

    @model_validator(mode="after")
    def _check(self) -> Recipe:
        exact = self.method.exact
        if (
            # A thrown die is right on more tables with a symmetry.
            "symmetry" not in self.model_fields_set
            and self.method.thrown
            and self.start.kind.search is not None
            and exact is not None
            and exact.coordinates == "facets"
        ):
            object.__setattr__(self, "symmetry", AUTO)
        for fault in self._faults():
            raise ValueError(fault)
        return self

    def _faults(self) -> Iterator[str]:
        """Keys that do not go together, in sentences; may raise ValueError too."""
        target, start, method, engrave = self.target.target(), self.start, self.method, self.engrave
        labels, is_searched = ", ".join(target.labels), start.kind.search is not None
        exact, center, symmetry = method.exact, self.center_of_mass, self.symmetry
        if method.concave is not None:
            yield from self._concave_faults()
        elif start.kind.make is None and not is_searched:
            yield (
                f"start.{start.name}: expected method: {{concave: {{}}}} with it, got "
                f"{method.name}; change the method, or take another start"
            )
        for label in () if engrave is None else engrave.icons:
            if label not in target.labels:
                yield (
                    f"engrave.icons: expected labels of the target, {labels}, got {label!r}; "
                    "rename or remove it"
                )
        least = LEAST_DEPTH * self.size_mm
        if engrave is not None and engrave.depth_mm < least:
            yield (
                f"engrave.depth_mm: expected at least {least:.3g}, a millionth of size_mm, got "
                f"{engrave.depth_mm:g}; enlarge it"
            )
        if self.any_order and (exact is None or is_searched or symmetry is not None):
            yield (
                "assignment: expected any with the exact method, a start that is given and no "
                "symmetry, got it with another; write in_order, or leave it out"
            )
        if self.assignment and sorted(self.assignment) != sorted(target.labels):
            yield (
                f"assignment: expected each of the labels {labels} once, got "
                f"{', '.join(self.assignment)}; write in_order for the target's order"
            )
        start.kind.check(start.options, len(target.labels))
        if is_searched and exact is None:
            yield (
                f"start.{start.name}: expected method: {{exact: {{}}}}, which can begin anywhere, "
                f"got {method.name}; change the method, or take another start"
            )
        if is_searched and center is not None:
            yield (
                "center_of_mass: expected uniform where the shape is searched, got a point in no "
                "known coordinates; leave it out, or take another start"
            )
        if self.min_inradius_mm > 0.0 and exact is None:
            yield (
                "min_inradius_mm: expected the exact method, which can keep to it, got "
                f"{method.name}; leave it out, or change the method"
            )
        if not self.min_inradius_mm < self.size_mm / 2.0:
            yield (
                f"min_inradius_mm: expected less than half of size_mm = {self.size_mm:g}, got "
                f"{self.min_inradius_mm:g}; lower it"
            )
        if self.prior is not None and (exact is None or method.thrown):
            yield (
                "prior: expected the exact method with resting probabilities, which are the ones "
                "known "
                f"under a prior, got {'thrown probabilities' if method.thrown else method.name}; "
                "leave one "
                "of them out"
            )
        if self.prior is not None and symmetry is not None:
            yield (
                "prior: expected no symmetry with it, as sides that are images of each other "
                f"differ in their probabilities, got {symmetry}; leave one of them out"
            )
        if symmetry is not None:
            if exact is None or exact.coordinates != "facets":
                yield (
                    "symmetry: expected the exact method with coordinates: facets, got another; "
                    "leave symmetry out, or change the method"
                )
            if center is not None:
                yield (
                    "center_of_mass: expected uniform with a symmetry, got a point; leave one of "
                    "them out"
                )
            if symmetry != AUTO:
                # Raises where equal probabilities do not fill whole orbits.
                OrbitLayouts(target.probabilities, point_group(symmetry))
        if center is not None and engrave is not None and engrave.balance in ("opposite", "fill"):
            yield (
                f"engrave.balance: expected shape or none where center_of_mass is given, as nobody "
                f"knows then how labels move it, got {engrave.balance}; leave one of them out"
            )
        if self.inside is not None and center is None:
            yield (
                "inside: expected a center_of_mass that is given with it, got uniform; give one, "
                "or leave inside out"
            )
        if self.edges is not None:
            core_scale(self.edges, self.size_mm)

    def _concave_faults(self) -> Iterator[str]:
        read, marks = "up", MARKED[0]
        if self.engrave is not None:
            read, marks = self.engrave.read, (self.engrave.style, self.engrave.balance)
        if self.start.kind.surface is None:
            yield (
                "start: expected a surface to keep with the concave method, got "
                f"{self.start.name}; write start: {{mesh: {{path: FILE}}}}, or start: "
                "{shape: kitten}"
            )
        faults = {
            "assignment: expected in_order with the concave method, which finds the sides for the "
            "outcomes itself, got another": self.assignment is not None,
            "center_of_mass: expected uniform with the concave method, which shapes a solid of one "
            "material, got a point": self.center_of_mass is not None,
            "edges: expected none with the concave method, which keeps a surface as it is, got a "
            "radius": self.edges is not None,
            "numbering: expected given with the concave method, whose sides are not opposite to "
            f"each other, got {self.numbering}": self.numbering != "given",
            "engrave.read: expected up with the concave method, whose labels lie in the side that "
            f"is up, got {read}": read in ("down", "both"),
            "engrave: expected style engraved and balance shape or none with the concave method, "
            f"got {' and '.join(marks)}": marks not in MARKED,
        }
        yield from (f"{fault}; leave it out" for fault, is_there in faults.items() if is_there)

    def density_prior(self) -> DensityPrior | None:
        """The prior, or None for all directions alike."""
        prior = None if self.prior is None else read_prior(self.prior)
        assert prior is None or isinstance(prior, DensityPrior)
        return prior

    def group(self) -> Floats | None:
        """(g, 3, 3) the point group that the die has; None for none, or one yet to be found."""
        return None if self.symmetry in (None, AUTO) else point_group(self.symmetry)

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
        words: dict[str, Any] = {
            "center_of_mass": "uniform",
            "prior": "uniform",
            "symmetry": "none",
        }
        words["assignment"] = "any" if self.any_order else "in_order"
        words |= dict.fromkeys(("engrave", "edges", "inside", "print"), False)
        for key, word in words.items():
            plain[key] = plain[key] or word
        for part in ("target", "start", "method"):
            plain[part] = {key: value for key, value in plain[part].items() if value is not None}
        return plain
