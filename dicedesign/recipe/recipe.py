"""A recipe as checked options.

The parts of the schema that are options of the method or the engraving are the option classes
themselves; only what a file adds to them is described here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from dicedesign.balance.options import InsideOptions
from dicedesign.fabricate.file_formats import with_stl
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.fabricate.print_options import PrintOptions
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.starts.built_in import SearchOptions
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.recipe.entries import Label, MethodRecipe, StartRecipe, Strict, TargetRecipe
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


def _listed(names: object) -> object:
    """A word as a list of one; a bare `off` is false in YAML."""
    listed = names if isinstance(names, list) else [names]
    return ["off" if name is False else name for name in listed]


def _switch(value: object) -> object:
    return {True: {}, False: None}[value] if isinstance(value, bool) else value


def _printer(value: object) -> object:
    return {"printer": value} if isinstance(value, str) else _switch(value)


def _way(value: object) -> object:
    return {"by": value} if isinstance(value, str) else _switch(value)


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
    engrave: Annotated[EngravingOptions | None, BeforeValidator(_switch)] = Field(
        default_factory=EngravingOptions
    )
    edges: Annotated[EdgeOptions | None, BeforeValidator(_switch)] = None
    inside: Annotated[InsideOptions | None, BeforeValidator(_way)] = None
    print: Annotated[PrintOptions | None, BeforeValidator(_printer)] = Field(
        default_factory=PrintOptions
    )
    files: Annotated[
        list[str],
        AfterValidator(with_stl),
        BeforeValidator(_listed),
    ] = Field(default_factory=lambda: ["stl"])
    data_sheet: bool = False
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
        if self.engrave is not None:
            self._check_labels(self.engrave)
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
        if self.prior is not None:
            self._check_prior()
        if self._may_choose_symmetry():
            object.__setattr__(self, "symmetry", AUTO)
        if self.symmetry is not None:
            self._check_symmetry(self.symmetry)
        balance = None if self.engrave is None else self.engrave.balance
        if self.center_of_mass is not None and balance in ("opposite", "fill"):
            raise ValueError(
                f"engrave.balance: expected shape or none where center_of_mass is given, as nobody "
                f"knows then how labels move it, got {balance}; leave one of them out"
            )
        if self.inside is not None and self.center_of_mass is None:
            raise ValueError(
                "inside: expected a center_of_mass that is given with it, got uniform; give one, "
                "or leave inside out"
            )
        if self.edges is not None:
            core_scale(self.edges, self.size_mm)
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
        if self.edges is not None:
            raise ValueError(
                "edges: expected none with the concave method, which keeps a surface as it is, got "
                "a radius; leave them out"
            )
        if self.numbering != "given":
            raise ValueError(
                "numbering: expected given with the concave method, whose sides are not opposite "
                f"to each other, got {self.numbering}; leave it out"
            )
        engrave = self.engrave
        if engrave is not None and engrave.read in ("down", "both"):
            raise ValueError(
                "engrave.read: expected up with the concave method, whose labels lie in the side "
                f"that is up, got {engrave.read}; leave it out"
            )
        if engrave is not None and (engrave.style, engrave.balance) not in MARKED:
            raise ValueError(
                "engrave: expected style engraved and balance shape or none with the concave "
                f"method, got {engrave.style} and {engrave.balance}; leave them out"
            )

    def _check_labels(self, engrave: EngravingOptions) -> None:
        labels = self.target.target().labels
        for label in engrave.icons:
            if label not in labels:
                raise ValueError(
                    f"engrave.icons: expected labels of the target, {', '.join(labels)}, got "
                    f"{label!r}; rename or remove it"
                )
        least = LEAST_DEPTH * self.size_mm
        if engrave.depth_mm < least:
            raise ValueError(
                f"engrave.depth_mm: expected at least {least:.3g}, a millionth of size_mm, got "
                f"{engrave.depth_mm:g}; enlarge it"
            )

    def _check_symmetry(self, name: str) -> None:
        exact = self.method.exact
        if exact is None or exact.coordinates != "facets":
            raise ValueError(
                "symmetry: expected the exact method with coordinates: facets, got another; leave "
                "symmetry out, or change the method"
            )
        if self.center_of_mass is not None:
            raise ValueError(
                "center_of_mass: expected uniform with a symmetry, got a point; leave one of them "
                "out"
            )
        if name != AUTO:
            # Raises where equal probabilities do not fill whole orbits.
            OrbitLayouts(self.target.target().probabilities, point_group(name))

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

    def _check_prior(self) -> None:
        if self.method.exact is None or self.method.thrown:
            got = "thrown odds" if self.method.thrown else self.method.name
            raise ValueError(
                "prior: expected the exact method with resting odds, which are the ones known "
                f"under a prior, got {got}; leave one of them out"
            )
        if self.symmetry is not None:
            raise ValueError(
                "prior: expected no symmetry with it, as sides that are images of each other "
                f"differ in their odds, got {self.symmetry}; leave one of them out"
            )

    def prior_read(self) -> DensityPrior | None:
        """The prior, or None for all directions alike."""
        prior = None if self.prior is None else read_prior(self.prior)
        assert prior is None or isinstance(prior, DensityPrior)
        return prior

    def _may_choose_symmetry(self) -> bool:
        """True where none is given to a thrown die, which is right on more tables with one."""
        searched, exact = self.start.kind.search is not None, self.method.exact
        is_open = "symmetry" not in self.model_fields_set and self.method.thrown and searched
        return is_open and exact is not None and exact.coordinates == "facets"

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

    def ignored_weights(self) -> str | None:
        """What is said of weights that differ from the defaults though an exact finish follows."""
        paper = self.method.paper
        if paper is None or paper.finish == "none":
            return None
        usual, given = type(paper.weights)().as_dict(), paper.weights.as_dict()
        changed = [name for name, value in given.items() if value != usual[name]]
        if not changed:
            return None
        return (
            f"method.paper.weights: {', '.join(changed)}: the exact finish goes on from where the "
            "terms led, and knows nothing of them; write finish: none to end there, or give "
            "method.paper.prefer what the finish shall care about"
        )

    def resolved(self) -> dict[str, Any]:
        """The recipe with every default written out, as plain data."""
        plain: dict[str, Any] = self.model_dump(mode="json")
        plain["assignment"] = plain["assignment"] or ("any" if self.any_order else "in_order")
        plain["center_of_mass"] = plain["center_of_mass"] or "uniform"
        plain["prior"] = plain["prior"] or "uniform"
        plain["symmetry"] = plain["symmetry"] or "none"
        for part in ("engrave", "edges", "inside", "print"):
            plain[part] = plain[part] or False
        for part in ("target", "start", "method"):
            plain[part] = {key: value for key, value in plain[part].items() if value is not None}
        return plain
