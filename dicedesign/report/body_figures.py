"""Kinds of `dicedesign figure`: figures of any body, of those of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body
from dicedesign.report.render.renderer import Surface
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    from dicedesign.report.body_drawings import Ablation
    from dicedesign.report.sheet import Sheet

MOST_TRIANGLES: Final = 1_000_000
"""A mesh of more is drawn as its hull."""

MOST_FLAT: Final = 400
"""Triangles up to which a mesh is drawn with flat faces and edges."""


@dataclass(frozen=True, eq=False)
class Lain:
    """A body with its rests.

    Attributes
    ----------
    body: the solid; poses: its rests.
    labels: of these, empty texts for those without, or None.
    """

    body: Body
    poses: RestPoses
    labels: Sequence[str] | None = None


@dataclass(frozen=True, eq=False)
class Subject:
    """What a figure is about. What it does not show is not made.

    Attributes
    ----------
    upward: (3,) direction that is up in pictures.
    make: reads or designs the body.
    make_before: what the body was made from, in its place and scale.
    make_ablations: of the recipe that it is made by, all terms first.
    down: direction that points down when it is let go, or None for one of the figure's choice.

    The makers raise InputError where there is no such thing.
    """

    upward: Floats
    make: Callable[[], Lain]
    make_before: Callable[[Lain], Surface]
    make_ablations: Callable[[], Sequence[Ablation]]
    down: tuple[float, float, float] | None = None

    @cached_property
    def lain(self) -> Lain:
        """The body with its rests."""
        return self.make()

    @property
    def poses(self) -> RestPoses:
        """Of the body."""
        return self.lain.poses

    @property
    def surface(self) -> Surface:
        """The body, ready to be drawn."""
        return drawn_surface(self.lain.body.points, self.lain.body.triangles, self.poses.hull)


def drawn_surface(points: Floats, triangles: Integers | None, hull: ConvexHull) -> Surface:
    """A mesh as it is drawn: smooth unless it has few triangles; its hull where it has none, or
    too many."""
    if triangles is None or len(triangles) > MOST_TRIANGLES:
        points, triangles = hull.vertices, hull.triangles
    return Surface(points, np.asarray(triangles), smooth=len(triangles) > MOST_FLAT)


@dataclass(frozen=True, kw_only=True)
class BodyFigure(Extension):
    """A kind of figure.

    Attributes
    ----------
    draw: it; raises InputError where the subject has not what it shows.
    """

    draw: Callable[[Subject], Sheet]


def _draw_heights(subject: Subject) -> Sheet:
    from dicedesign.report.gauss_map import heights_figure

    return heights_figure(subject.poses)


def _draw_paths(subject: Subject) -> Sheet:
    from dicedesign.report.gauss_map import paths_figure

    down = subject.down
    return paths_figure(subject.poses, None if down is None else np.asarray(down)[None])


def _draw_complex(subject: Subject) -> Sheet:
    from dicedesign.report.gauss_map import gauss_map_figure

    return gauss_map_figure(subject.poses, subject.lain.labels)


def _draw_drop(subject: Subject) -> Sheet:
    from dicedesign.report.body_drawings import drop_figure

    return drop_figure(subject.surface, subject.poses, subject.down)


def _draw_before_after(subject: Subject) -> Sheet:
    from dicedesign.report.render.raster import three_cameras
    from dicedesign.report.surface_figures import before_after_figure

    before, after = subject.make_before(subject.lain), subject.surface
    points = np.concatenate([before.points, after.points])
    return before_after_figure(before, after, three_cameras(points, subject.upward))


def _draw_ablation(subject: Subject) -> Sheet:
    from dicedesign.report.body_drawings import ablation_figure

    return ablation_figure(subject.make_ablations())


HEIGHTS = BodyFigure(
    name="heights",
    line="height of the center of mass over the Gauss map, by colour",
    draw=_draw_heights,
)

PATHS = BodyFigure(
    name="paths",
    line="ways of rolling bodies over the Gauss map, from many orientations or one (--down)",
    draw=_draw_paths,
)

COMPLEX = BodyFigure(
    name="complex",
    line="Morse-Smale complex over the Gauss map: basins, separatrices, rests, saddles, maxima",
    draw=_draw_complex,
)

DROP = BodyFigure(
    name="drop",
    line="a body that rolls to rest, moment by moment (from --down), and its path",
    draw=_draw_drop,
)

BEFORE_AFTER = BodyFigure(
    name="before_after",
    line="a die above the shape that its design began with, or a mesh above another (--before)",
    draw=_draw_before_after,
)

ABLATION = BodyFigure(
    name="ablation",
    line="a recipe's die by the paper's method, and without one regularizer after the other",
    draw=_draw_ablation,
)

_HERE: Final = "dicedesign.report.body_figures"

BODY_FIGURES: Final = Registry(
    "kind of figure",
    BodyFigure,
    builtin=tuple(
        f"{_HERE}:{name}"
        for name in ("HEIGHTS", "PATHS", "COMPLEX", "DROP", "BEFORE_AFTER", "ABLATION")
    ),
    group="dicedesign.body_figures",
)
"""All kinds of figures of bodies."""
