"""Built-in kinds of starting shapes and their options. The modules that make shapes are imported
late, as reading a recipe does not need them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import (
    FEWEST_FACETS,
    Start,
    StartKind,
    StartSurface,
    Task,
    check_prism,
)
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import Options

if TYPE_CHECKING:
    from dicedesign.geometry.meshes.body import Body


MOST_HELPERS = 60


@dataclass(frozen=True)
class PrismOptions(Options):
    """`start.prism`; see `prism`.

    Attributes
    ----------
    sides: 3 to 12; by default the number of outcomes.
    height: height of the side faces over the base's circumscribed radius, positive.
    cap: height of each pointed cap over that radius, not negative; steep caps are unstable.
    """

    sides: int | None = None
    height: float = 1.5
    cap: float = 1.3


@dataclass(frozen=True)
class RepulsionOptions(Options):
    """`start.repulsion`, without options."""


@dataclass(frozen=True)
class MeshOptions(Options):
    """`start.mesh`.

    Attributes
    ----------
    path: path of the file, relative to the recipe's folder; on the command line, to the working
        directory.
    repair: repair an open, non-manifold, multi-body or self-intersecting mesh: take the closed
        surface of the largest solid it encloses; for method concave.
    item: of a 3MF file: the body of this number on its plate.
    """

    path: str
    repair: bool = False
    item: int | None = None


@dataclass(frozen=True)
class SearchOptions(Options):
    """`start.search`.

    Attributes
    ----------
    helpers: least number of facets without an outcome, 0 to `MOST_HELPERS`: they give more
        dice with the target's probabilities to choose from.
    """

    helpers: Annotated[int, Field(ge=0, le=MOST_HELPERS)] = 0


def _shapes() -> ModuleType:
    from dicedesign.optimize.starts import shapes

    return shapes


FEWEST_SIDES = 3
"""Least number of rests of shapes that do not depend on the target."""

HENDECAHEDRON_FACETS = 11


def _check_sides(outcomes: int) -> None:
    if outcomes < FEWEST_SIDES:
        raise ValueError(
            f"start: expected a mesh or a search for {outcomes} outcomes, as every other start "
            f"has at least {FEWEST_SIDES} rests; write start: {{search: {{}}}}, or start: "
            "{mesh: {path: FILE}}"
        )


def _check_prism(options: PrismOptions, outcomes: int) -> None:
    _check_sides(outcomes)
    sides = outcomes if options.sides is None else options.sides
    check_prism(sides, options.height, options.cap)
    if sides != outcomes:
        raise InputError(
            f"start.prism.sides: expected {outcomes}, one side for each outcome of the target, got "
            f"{sides}; leave it out"
        )


def _check_hendecahedron(kind: str, outcomes: int) -> None:
    _check_sides(outcomes)
    if outcomes != HENDECAHEDRON_FACETS:
        raise InputError(
            f"start.hendecahedron: expected a target of {HENDECAHEDRON_FACETS} outcomes, one for "
            f"each facet, got {outcomes}; take another start"
        )


def _check_repulsion(options: RepulsionOptions, outcomes: int) -> None:
    _check_sides(outcomes)
    if outcomes < FEWEST_FACETS:
        raise InputError(
            f"start.repulsion: expected a target of at least {FEWEST_FACETS} outcomes, got "
            f"{outcomes}; take a prism"
        )


def _make_mesh(options: MeshOptions, task: Task) -> Start:
    if options.repair:
        raise InputError(
            "start.mesh.repair: expected method concave, which keeps the mesh, got one that takes "
            "its convex hull, with nothing to repair; leave it out"
        )
    return _shapes().mesh_start(_read_mesh(options), task.outcomes, task.center_of_mass)


def _mesh_surface(options: MeshOptions, points: int) -> StartSurface:
    from dicedesign.geometry.surfaces.repair import input_surface

    return StartSurface(*input_surface(_read_mesh(options), points, repair=options.repair))


def _read_mesh(options: MeshOptions) -> Body:
    from dicedesign.geometry.meshes.reading import read_body

    return read_body(Path(options.path), options.item)


def _search(
    options: SearchOptions, target: Floats, group: Floats | None, seed: int
) -> Iterator[Start | None]:
    from dicedesign.optimize.starts.search import shapes_near

    return shapes_near(target, seed, options.helpers, group)


PRISM = StartKind(
    name="prism",
    line="a prism with pointed caps, one side for each outcome in order around the axis",
    options=PrismOptions,
    check=_check_prism,
    make=lambda prism, task: _shapes().prism(task.outcomes, prism.height, prism.cap),
)

HENDECAHEDRON = StartKind(
    name="hendecahedron",
    line="a body of eleven facets, `bisymmetric` or `circus`, for the total of two dice",
    options=Literal["bisymmetric", "circus"],
    check=_check_hendecahedron,
    make=lambda kind, task: _shapes().hendecahedron(kind),
)

REPULSION = StartKind(
    name="repulsion",
    line="facets tangent to a sphere at points that repel each other, one for each outcome",
    options=RepulsionOptions,
    check=_check_repulsion,
    make=lambda options, task: _shapes().repulsion(task.outcomes, task.seed),
)

MESH = StartKind(
    name="mesh",
    line="the convex hull of a mesh file, with outcomes on its most probable rests; "
    "`method: concave` uses the surface itself",
    options=MeshOptions,
    make=_make_mesh,
    surface=_mesh_surface,
)

SEARCH = StartKind(
    name="search",
    line="random shapes with probabilities near the target's, until one reaches it",
    options=SearchOptions,
    search=_search,
)
