"""Starting shapes: convex polyhedra with the directions on which outcomes are to be placed, and the
kinds of them that a recipe can choose.

Each is made in its own coordinates, which its docstring describes, and then moved and scaled to
half extent 1; `Start` remembers how.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    from dicedesign.geometry.surfaces.repair import RepairedMesh
    from dicedesign.geometry.triangles import Surface


@dataclass(frozen=True)
class Start:
    """A shape to begin with.

    Attributes
    ----------
    points: (n, 3) whose convex hull is the shape, of half extent 1 about the middle of its box.
    directions: (k, 3) unit normals of the facets that carry outcomes, in the order in which an
        assignment names them.
    origin, scale: how the points were normalized: (3,) and a length in the shape's own
        coordinates, with point = (own - origin) / scale.
    pinned: numbers of the directions whose facets stay in their planes; the exact method alone
        heeds it.
    notes: what was repaired or assumed on the way in, one sentence each.
    """

    points: Floats
    directions: Floats
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0
    pinned: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    def normalize(self, own: Floats) -> Floats:
        """Coordinates of points (..., 3), given in the shape's own coordinates, in those of
        `points`."""
        return (own - self.origin) / self.scale


def normalize_start(points: Floats, directions: Floats, notes: tuple[str, ...] = ()) -> Start:
    """A start in normalized coordinates from points (n, 3) and unit directions (k, 3)."""
    origin = (points.min(axis=0) + points.max(axis=0)) / 2.0
    centered = points - origin
    scale = float(np.abs(centered).max())
    return Start(centered / scale, directions, origin, scale, notes=notes)


@dataclass(frozen=True)
class StartSurface:
    """A surface to begin with.

    Attributes
    ----------
    surface: closed, of one solid.
    notes: what was done to it on the way in, one sentence each.
    repair: of the mesh that it is of, if there was one.
    """

    surface: Surface
    notes: tuple[str, ...] = ()
    repair: RepairedMesh | None = None


@dataclass(frozen=True)
class Task:
    """Purpose of a start.

    Attributes
    ----------
    outcomes: how many there are.
    seed: of everything random.
    center_of_mass: (3,) given, in the shape's own coordinates, or None for the uniform solid.
    """

    outcomes: int
    seed: int = 0
    center_of_mass: Floats | None = None


@dataclass(frozen=True, kw_only=True)
class StartKind(Extension):
    """A kind of starting shape.

    Attributes
    ----------
    options: type of what a recipe says of it: a dataclass with `STRICT`, or a choice of texts.
    check: raises ValueError, naming the key, where a shape of such options cannot bear so many
        outcomes.
    make: the shape, from options and task, or None if there is no single one.
    search: shapes with one rest for each outcome and no other, without end, from options, for
        target probabilities (k,), a point group (g, 3, 3) or None, and a seed; None where a turn
        found nothing. Or None if shapes are not searched.
    surface: the closed surface to make a concave die of, from options and the most points that it
        needs to have; or None if there is none.
    """

    options: Any
    check: Callable[[Any, int], None] = lambda options, outcomes: None
    make: Callable[[Any, Task], Start] | None = None
    search: Callable[[Any, Floats, Floats | None, int], Iterator[Start | None]] | None = None
    surface: Callable[[Any, int], StartSurface] | None = None


STARTS: Final = Registry(
    "start",
    StartKind,
    builtin=(
        "dicedesign.optimize.starts.kinds:PRISM",
        "dicedesign.optimize.starts.kinds:HENDECAHEDRON",
        "dicedesign.optimize.starts.kinds:REPULSION",
        "dicedesign.optimize.starts.kinds:MESH",
        "dicedesign.concave.options:SHAPE",
        "dicedesign.optimize.starts.kinds:SEARCH",
    ),
    group="dicedesign.starts",
)


def build_start(name: str, options: Any, task: Task) -> Start | None:
    """The starting shape of a kind, or None where there is no single one.

    Raises
    ------
    InputError: it cannot be made.
    OutsideHullError: the given center of mass is not inside.
    """
    make = STARTS[name].make
    if make is None:
        return None
    start = make(options, task)
    if task.center_of_mass is not None:
        # They load SciPy, without which a recipe is read.
        from dicedesign.geometry.hulls.hull import convex_hull
        from dicedesign.rest.equilibria import classify

        # An error speaks of the coordinates that the recipe uses.
        classify(convex_hull(start.origin + start.scale * start.points), task.center_of_mass)
    return start


FEWEST_FACETS: Final = 4
"""Least number of facets of a polyhedron."""


def check_prism(sides: int, height: float, cap: float) -> None:
    """Raise InputError for proportions out of range, see `PrismOptions`."""
    if not 3 <= sides <= 12:
        raise InputError(
            f"start.prism.sides: expected 3 to 12, got {sides}; start from repulsion or a mesh"
        )
    if not 0.0 < height < np.inf:
        raise InputError(
            f"start.prism.height: expected a positive number, got {height:g}; leave it out for 1.5"
        )
    if not 0.0 <= cap < np.inf:
        raise InputError(
            f"start.prism.cap: expected a number not below 0, got {cap:g}; leave it out for 1.3"
        )
