"""Starting shapes: convex polyhedra with the directions of the outcomes; and their registry.

Each shape has its own coordinates, which its docstring describes. `Start` has normalized
coordinates, of half extent 1, and remembers the map between both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    from dicedesign.geometry.surfaces.repair import RepairedMesh
    from dicedesign.geometry.triangles import Surface


@dataclass(frozen=True)
class Start:
    """A starting shape.

    Attributes
    ----------
    points: (n, 3) whose convex hull is the shape, of half extent 1 about the center of its box.
    directions: (k, 3) unit normals of the facets with outcomes, in the order of an assignment.
    origin, scale: normalization, (3,) and a length in the shape's own coordinates: point =
        (own - origin) / scale.
    notes: repairs and assumptions, one sentence each.
    """

    points: Floats
    directions: Floats
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0
    notes: tuple[str, ...] = ()

    def normalize(self, own: Floats) -> Floats:
        """Convert points (..., 3) from the shape's own coordinates to those of `points`."""
        return (own - self.origin) / self.scale


def normalize_start(points: Floats, directions: Floats, notes: tuple[str, ...] = ()) -> Start:
    """`Start` of half extent 1, from points (n, 3) in any unit and directions (k, 3).

    directions: outward unit normals of the facets with outcomes, in the order of an assignment.
    notes: repairs and assumptions, one sentence each.
    """
    origin = (points.min(axis=0) + points.max(axis=0)) / 2.0
    centered = points - origin
    scale = float(np.abs(centered).max())
    return Start(centered / scale, directions, origin, scale, notes=notes)


@dataclass(frozen=True)
class StartSurface:
    """Surface of a concave start.

    Attributes
    ----------
    surface: closed surface of one solid.
    notes: changes of the surface, one sentence each.
    repair: repair of the mesh, if any.
    """

    surface: Surface
    notes: tuple[str, ...] = ()
    repair: RepairedMesh | None = None


@dataclass(frozen=True)
class Task:
    """Requirements on a start.

    Attributes
    ----------
    outcomes: number of outcomes.
    seed: random seed.
    center_of_mass: (3,) in the shape's own coordinates, or None for the uniform solid.
    """

    outcomes: int
    seed: int = 0
    center_of_mass: Floats | None = None


@dataclass(frozen=True, kw_only=True)
class StartKind(Extension):
    """A kind of starting shape.

    Attributes
    ----------
    options: type of its options in recipes: a dataclass derived from `Options`, or a
        choice of texts.
    check: raises ValueError, naming the key, if a shape with these options cannot have a number of
        outcomes.
    make: returns the `Start` for options and a task, most easily by `normalize_start`; None if
        there is no single shape.
    search: yields shapes with one rest for each outcome and no other, without end, from options,
        target probabilities (k,), a point group (g, 3, 3) or None, and a seed. It yields None for a
        turn without a shape. None if shapes are not searched.
    surface: makes the closed surface of a concave die, from options and the number of points that
        suffices; None if there is no surface.
    """

    options: Any
    check: Callable[[Any, int], None] = lambda options, outcomes: None
    make: Callable[[Any, Task], Start] | None = None
    search: Callable[[Any, Floats, Floats | None, int], Iterator[Start | None]] | None = None
    surface: Callable[[Any, int], StartSurface] | None = None


STARTS = Registry(
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
    """Make the starting shape of a kind; None if there is no single one.

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
        # These load SciPy, which reading a recipe does not need.
        from dicedesign.geometry.hulls.hull import convex_hull
        from dicedesign.rest.equilibria import classify

        # Errors have the coordinates of the recipe.
        classify(convex_hull(start.origin + start.scale * start.points), task.center_of_mass)
    return start


FEWEST_FACETS = 4
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
