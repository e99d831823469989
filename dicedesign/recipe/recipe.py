"""Recipe schema. Its parts for methods, engraving and so on are the option dataclasses."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, Literal, cast

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
from dicedesign.fabricate.file_formats import with_stl
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.fabricate.printers import PrintOptions
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.starts.kinds import SearchOptions
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.optimize.targets import MOST_FACES
from dicedesign.recipe.method import MethodRecipe
from dicedesign.recipe.target import Label, Strict, TargetRecipe
from dicedesign.rest.prior import DensityPrior, read_prior
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import LEAST_MM, MOST_MM

NAME = r"^[A-Za-z0-9]([A-Za-z0-9_. -]{0,98}[A-Za-z0-9_.-])?$"
"""Pattern of the name of a die and its results folder."""

AUTO = "auto"
"""Value of `symmetry` that is resolved during the run."""

FEWEST_FACES = 4
"""Least number of faces of a die."""

MOST_CANDIDATES = 12
"""Most dice that are compared."""

MIN_RELATIVE_DEPTH = 1e-6
"""Minimum label depth over die size; STL files round coordinates to about a tenth of it."""


@dataclass(frozen=True)
class StartRecipe:
    """`start`: a starting shape, or a search for shapes; see `STARTS`.

    Attributes
    ----------
    name: key of the start.
    options: its options.
    """

    name: str
    options: Any

    @property
    def mesh(self) -> Any:
        """Options of a start from a mesh file; None for another start."""
        return self.options if self.name == "mesh" else None

    @property
    def kind(self) -> StartKind:
        """Extension of the start."""
        return STARTS[self.name]

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        def read(entry: Any) -> StartRecipe:
            if isinstance(entry, cls):
                return entry
            keys = _start_keys(tuple(STARTS))
            model = keys.model_validate_json(json.dumps(entry))
            name = model.one_of(*keys.model_fields)
            return cls(name, getattr(model, name))

        def dump(start: StartRecipe) -> dict[str, Any]:
            options = TypeAdapter(start.kind.options).dump_python(start.options, mode="json")
            return {start.name: options}

        return core_schema.no_info_plain_validator_function(
            read, serialization=core_schema.plain_serializer_function_ser_schema(dump)
        )

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        keys: dict[str, Any] = handler(_start_keys(tuple(STARTS)).__pydantic_core_schema__)
        return keys


@cache
def _start_keys(kinds: tuple[StartKind, ...]) -> type[Strict]:
    """Model with a key for each start."""
    keys: dict[str, Any] = {kind.name: (kind.options | None, None) for kind in kinds}
    return create_model("StartKeys", __base__=Strict, **keys)


def _check_prior(text: str | None) -> str | None:
    if text is not None and not isinstance(read_prior(text), DensityPrior):
        raise ValueError(
            f"expected a density, which is differentiable, got {text!r}; `dicedesign rest` prints "
            "the vmf density nearest to samples"
        )
    return text


def _check_faces(value: object) -> object:
    is_number = isinstance(value, int) and FEWEST_FACES <= value <= MOST_FACES
    if not is_number and value not in ("one", AUTO):
        raise ValueError(
            f"expected one, auto, or an even number from {FEWEST_FACES} to {MOST_FACES}, got "
            f"{value!r}; change it"
        )
    return value


def _check_group(name: str | None) -> str | None:
    if name not in (None, AUTO):
        point_group(name)
    return name


def _word(word: str, meaning: object) -> BeforeValidator:
    return BeforeValidator(lambda value: meaning if value == word else value)


def _list_names(names: object) -> object:
    """Wrap a single name in a list."""
    return names if isinstance(names, list) else [names]


def _switch(key: str | None = None) -> BeforeValidator:
    """Read `true` as all defaults, `false` as None, and a word as the value of `key`."""

    def read(value: object) -> object:
        if key is not None and isinstance(value, str):
            return {key: value}
        return {True: {}, False: None}[value] if isinstance(value, bool) else value

    return BeforeValidator(read)


class Recipe(Strict):
    """A whole recipe.

    Attributes
    ----------
    name: name of the die and of its results folder, which gets dashes for spaces.
    seed: random seed, below 2^64.
    target: outcomes and their probabilities.
    start: initial shape; by default shapes are searched.
    assignment: labels in the order of the start's directions; None, "in_order" in a file, for the
        order of the target.
    numbering: assignment of equally probable outcomes with numbers as labels: "given" as assigned,
        "standard" for opposite facets with a constant sum if the shape allows, "balanced" for sums
        of opposite facets and around corners as even as possible, "auto" for opposite facets with a
        constant sum and then even sums around corners, on a die whose shape is searched and with
        consecutive numbers on equally many, equally probable faces; else "given".
    center_of_mass: (3,) fixed center of mass in the start's own coordinates; None, "uniform" in a
        file, for the uniform solid.
    prior: distribution of the direction that points down at release, such as "vmf:0,0,-1:5", one of
        `PRIORS`, in the start's own coordinates, which the files keep; None, "uniform" in a file,
        for the uniform distribution.
    symmetry: point group of the die, such as C2, Cs, D3h, Td, Oh or Ih, about the centroid of the
        start and along its axes; "auto", the default if shapes are searched, for the most helpful
        group that the target allows, or for dice that are set down for the most handsome of many
        shapes with and without symmetry; None, "none" in a file, for any shape.
    faces: "auto" to compare dice with different numbers of faces and take the best, the default if
        shapes are searched without further wishes; "one" for one face an outcome, or those that the
        target lists; or an even number of faces, at least 4 and as many as outcomes.
    purpose: what the die is for: "both", right when set down and when thrown; "setting-down" or
        "throwing" for one of these.
    candidates: number of dice to compare and to describe in the result, 1 to 12.
    pick: number of the one to make, 1 for the best.
    size_mm: largest distance between two vertices of the die.
    min_inradius_mm: minimum radius of the largest circle in the facet of each outcome.
    engrave: engraving options, or None for a plain die, the default with the concave method.
    edges: rounding of edges and corners, or None for sharp ones.
    inside: cavity or infill that moves the center of mass to the given `center_of_mass`, or None to
        leave that to the maker.
    print: printer and material, or None to skip the check of printability.
    files: file formats of the die; STL is always included.
    figures: whether to draw figures. report: whether to make the report page.
    clock: whether to record run times; without them, and unless a time limit is reached,
        the files of a recipe are always identical byte for byte.
    """

    name: Annotated[str, Field(pattern=NAME)]
    target: TargetRecipe
    start: StartRecipe = Field(default_factory=lambda: StartRecipe("search", SearchOptions()))
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    assignment: Annotated[list[Label] | None, _word("in_order", None)] = None
    numbering: Literal["auto", "given", "standard", "balanced"] = "auto"
    center_of_mass: Annotated[
        tuple[float, float, float] | None,
        _word("uniform", None),
        BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
    ] = None
    prior: Annotated[str | None, AfterValidator(_check_prior), _word("uniform", None)] = None
    symmetry: Annotated[str | None, AfterValidator(_check_group), _word("none", None)] = None
    method: MethodRecipe = Field(default_factory=MethodRecipe)
    faces: Annotated[Literal["one", "auto"] | int, BeforeValidator(_check_faces)] = "one"
    purpose: Literal["both", "throwing", "setting-down"] = "both"
    candidates: Annotated[int, Field(ge=1, le=MOST_CANDIDATES)] = 1
    pick: Annotated[int, Field(ge=1, le=MOST_CANDIDATES)] = 1
    size_mm: Annotated[float, Field(ge=LEAST_MM, le=MOST_MM)] = 30.0
    min_inradius_mm: Annotated[float, Field(ge=0.0)] = 0.0
    engrave: Annotated[EngravingOptions | None, _switch()] = Field(default_factory=EngravingOptions)
    edges: Annotated[EdgeOptions | None, _switch()] = None
    inside: Annotated[InsideOptions | None, _switch("by")] = None
    print: Annotated[PrintOptions | None, _switch("printer")] = Field(default_factory=PrintOptions)
    files: Annotated[list[str], AfterValidator(with_stl), BeforeValidator(_list_names)] = Field(
        default_factory=lambda: ["stl"]
    )
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
        is_free = not {"faces", "start", "symmetry"} & self.model_fields_set
        if is_free and next(self._list_faces_conflicts(), None) is None:
            object.__setattr__(self, "faces", AUTO)
        if (
            # With a symmetry a thrown die is right on more tables, and others are more handsome.
            "symmetry" not in self.model_fields_set
            and self.method.exact is not None
            and self.start.kind.search is not None
            and self.method.exact.coordinates == "facets"
            and self.prior is None
            and self.center_of_mass is None
        ):
            object.__setattr__(self, "symmetry", AUTO)
        for conflict in self._list_conflicts():
            raise ValueError(conflict)
        if self.faces != "one":
            for conflict in self._list_faces_conflicts():
                raise ValueError(conflict)
        elif max(self.candidates, self.pick) > 1:
            raise ValueError(
                f"{'pick' if self.pick > 1 else 'candidates'}: expected 1 with faces: one, which "
                "compares no dice with other numbers of faces, got more; write faces: auto"
            )
        return self

    def _list_faces_conflicts(self) -> Iterator[str]:
        """Yield messages about keys with which the number of faces cannot be chosen."""
        exact, target = self.method.exact, self.target
        others = {"table", "hand", "tolerance"}
        conflicts = {
            "start: expected none, so that shapes are searched": self.start.kind.search is None,
            "method: expected none, or exact with table and hand": exact is None
            or any(
                getattr(exact, one.name) != getattr(ExactOptions(), one.name)
                for one in fields(ExactOptions)
                if one.name not in others
            ),
            "prior: expected none": self.prior is not None,
            "center_of_mass: expected uniform": self.center_of_mass is not None,
            "min_inradius_mm: expected 0": self.min_inradius_mm > 0.0,
            "assignment: expected in_order": self.assignment is not None,
            "target: expected no number of faces": target.faces is not None
            or any(one.faces > 1 for one in target.outcomes or ()),
            "symmetry: expected none or auto": self.symmetry not in (None, AUTO),
        }
        for text, applies in conflicts.items():
            if applies:
                yield f"{text} with faces: {self.faces}, got another; leave it out"
        if isinstance(self.faces, int):
            outcomes = len(target.target().labels)
            if self.faces % 2 or self.faces < outcomes:
                yield (
                    f"faces: expected an even number of at least {outcomes}, the number of "
                    f"outcomes, so that opposite faces are parallel, got {self.faces}; change it, "
                    "or write auto or one"
                )

    def _list_conflicts(self) -> Iterator[str]:
        """Yield messages about conflicting keys; may also raise ValueError."""
        target, start, method, engrave = self.target.target(), self.start, self.method, self.engrave
        labels, is_searched = ", ".join(target.labels), start.kind.search is not None
        exact, center, symmetry = method.exact, self.center_of_mass, self.symmetry
        if method.concave is not None:
            yield from self._list_concave_conflicts()
        elif start.kind.make is None and not is_searched:
            yield (
                f"start.{start.name}: expected method: {{concave: {{}}}} with it, got "
                f"{method.name}; change the method, or take another start"
            )
        for key in () if engrave is None else ("icons", "blank"):
            for label in getattr(engrave, key):
                if label not in target.labels:
                    yield (
                        f"engrave.{key}: expected labels of the target, {labels}, got {label!r}; "
                        "rename or remove it"
                    )
        if engrave is not None and set(target.labels) <= set(engrave.blank):
            yield "engrave.blank: expected a label to cut, got all of them; write engrave: false"
        least = MIN_RELATIVE_DEPTH * self.size_mm
        if engrave is not None and engrave.depth_mm < least:
            yield (
                f"engrave.depth_mm: expected at least {least:.3g}, a millionth of size_mm, got "
                f"{engrave.depth_mm:g}; enlarge it"
            )
        if self.assignment is not None and sorted(self.assignment) != sorted(target.face_labels):
            each = ", ".join(target.face_labels)
            yield (
                f"assignment: expected each of the labels {each} once, got "
                f"{', '.join(self.assignment)}; write in_order for the target's order"
            )
        start.kind.check(start.options, len(target.face_labels))
        if is_searched and exact is None:
            yield (
                f"start.{start.name}: expected method: {{exact: {{}}}}, which can search, got "
                f"{method.name}; change the method, or take another start"
            )
        if is_searched and center is not None:
            yield (
                "center_of_mass: expected uniform if the shape is searched, got a point in unknown "
                "coordinates; leave it out, or take another start"
            )
        if self.min_inradius_mm > 0.0 and exact is None:
            yield (
                "min_inradius_mm: expected the exact method, which supports it, got "
                f"{method.name}; leave it out, or change the method"
            )
        if not self.min_inradius_mm < self.size_mm / 2.0:
            yield (
                f"min_inradius_mm: expected less than half of size_mm = {self.size_mm:g}, got "
                f"{self.min_inradius_mm:g}; lower it"
            )
        if self.prior is not None and (exact is None or method.is_thrown):
            yield (
                "prior: expected the exact method with resting probabilities, got "
                f"{'thrown probabilities' if method.is_thrown else method.name}; leave one of them "
                "out"
            )
        if self.prior is not None and symmetry is not None:
            yield (
                "prior: expected no symmetry with it, which a prior breaks, got "
                f"{symmetry}; leave one of them out"
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
                # Raises unless equal probabilities fill whole orbits.
                OrbitLayouts(target.face_probabilities, point_group(symmetry))
        if center is not None and engrave is not None and engrave.balance in ("opposite", "fill"):
            yield (
                "engrave.balance: expected shape or none if center_of_mass is given, as the effect "
                f"of labels on it is unknown, got {engrave.balance}; leave one of them out"
            )
        if self.inside is not None and center is None:
            yield (
                "inside: expected a center_of_mass with it, got uniform; give one, "
                "or leave inside out"
            )
        if self.edges is not None:
            core_scale(self.edges, self.size_mm)

    def _list_concave_conflicts(self) -> Iterator[str]:
        engrave = self.engrave or EngravingOptions()
        style, balance = engrave.style, engrave.balance
        if self.start.kind.surface is None:
            yield (
                "start: expected a surface to keep with the concave method, got "
                f"{self.start.name}; write start: {{mesh: {{path: FILE}}}}, or start: "
                "{shape: kitten}"
            )
        conflicts = {
            "assignment: expected in_order with the concave method, which assigns outcomes itself, "
            "got another": self.assignment is not None,
            "center_of_mass: expected uniform with the concave method, which shapes a uniform "
            "solid, got a point": self.center_of_mass is not None,
            "edges: expected none with the concave method, which keeps the surface, got a "
            "radius": self.edges is not None,
            "numbering: expected given with the concave method, which has no opposite facets, got "
            f"{self.numbering}": self.numbering not in ("auto", "given"),
            "engrave.read: expected up with the concave method, whose labels are on top, got "
            f"{engrave.read}": engrave.read in ("down", "both"),
            "engrave: expected style engraved and balance shape or none with the concave method, "
            f"got {style} and {balance}": style != "engraved" or balance not in ("shape", "none"),
        }
        yield from (f"{text}; leave it out" for text, applies in conflicts.items() if applies)

    @property
    def folder_name(self) -> str:
        """Name with dashes for spaces."""
        return self.name.replace(" ", "-")

    @property
    def is_chosen_by_looks(self) -> bool:
        """Whether the die is the most handsome of many shapes."""
        is_searched = self.start.kind.search is not None
        return self.symmetry == AUTO and is_searched and not self.method.is_thrown

    @property
    def compares_faces(self) -> bool:
        """Whether dice with different numbers of faces are compared."""
        return self.faces != "one"

    @property
    def chosen_numbering(self) -> str:
        """The numbering, where "auto" is "given" for dice with other labels or a given start."""
        is_free = self.start.kind.search is not None and self.assignment is None
        if self.numbering == "auto" and not (is_free and self.target.target().is_numbered):
            return "given"
        return self.numbering

    def density_prior(self) -> DensityPrior | None:
        """Prior density; None for the uniform one."""
        return None if self.prior is None else cast(DensityPrior, read_prior(self.prior))

    def group(self) -> Floats | None:
        """(g, 3, 3) point group; None for none, or if it is not resolved yet."""
        return None if self.symmetry in (None, AUTO) else point_group(self.symmetry)

    def face_of_direction(self) -> list[int]:
        """Index of the target's face of each direction of the start; faces with the same label in
        order."""
        labels = self.target.target().face_labels
        places = {label: [k for k, one in enumerate(labels) if one == label] for label in labels}
        return [places[label].pop(0) for label in self.assignment or labels]

    def warnings(self) -> Iterator[str]:
        """Yield warnings about a valid recipe."""
        smallest = float(self.target.target().probabilities.min())
        if self.method.tolerance >= smallest:
            yield (
                f"the tolerance is not below the smallest outcome, {smallest:.3g}: set "
                f"method.{self.method.name}.tolerance lower"
            )

    def as_dict(self) -> dict[str, Any]:
        """Plain data of the recipe with every default."""
        plain: dict[str, Any] = self.model_dump(mode="json")
        words: dict[str, Any] = {
            "assignment": "in_order",
            "center_of_mass": "uniform",
            "prior": "uniform",
            "symmetry": "none",
        }
        words |= dict.fromkeys(("engrave", "edges", "inside", "print"), False)
        for key, word in words.items():
            plain[key] = plain[key] or word
        for part in ("target", "start", "method"):
            plain[part] = {key: value for key, value in plain[part].items() if value is not None}
        return plain
