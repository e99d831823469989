"""Kinds of figures of bodies and designs for `dicedesign figure`.

Modules that draw are imported late, as importing matplotlib takes half a second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.figures import MAX_FLAT_TRIANGLES, draw_by_address
from dicedesign.report.paper import COLUMN_WIDTH
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    import matplotlib.figure

    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.report.renderer import RenderMesh
    from dicedesign.rest.poses import RestPoses
    from dicedesign.results.result import Result

MAX_TRIANGLES = 1_000_000
"""Most triangles of a mesh that is drawn itself; with more, its hull is drawn."""


@dataclass(frozen=True, eq=False)
class Subject:
    """Subject of a figure.

    Attributes
    ----------
    body, poses: the solid and its rests.
    upward: (3,) direction that is upward in pictures.
    make_before: makes what the body was made from, in the same place and scale; raises InputError
        if that is unknown.
    result: result of the design, or None for a mesh.
    outcome_of_rest: (k,) number of the outcome of each rest, or -1 for none; None for a mesh.
    tolerance: largest error of the design, or None for a mesh.
    down: direction that points down when the body is let go, or None to let the figure choose.
    width: of the figure, in inches.
    """

    body: Body
    poses: RestPoses
    upward: Floats
    make_before: Callable[[], RenderMesh]
    result: Result | None = None
    outcome_of_rest: Integers | None = None
    tolerance: float | None = None
    down: tuple[float, float, float] | None = None
    width: float = COLUMN_WIDTH

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Labels of the outcomes, or None for a mesh."""
        return None if self.result is None else self.result.labels

    @property
    def design(self) -> Result:
        """Result of the design. Raises InputError for a mesh."""
        if self.result is None:
            raise InputError(
                "figure: expected a folder written by `dicedesign run` or a recipe, got a mesh, "
                "which has no design; name one of these"
            )
        return self.result

    @property
    def surface(self) -> RenderMesh:
        """Mesh of the body to draw."""
        return surface_to_draw(self.body.points, self.body.triangles, self.poses.hull)


def surface_to_draw(points: Floats, triangles: Integers | None, hull: ConvexHull) -> RenderMesh:
    """Mesh to draw: smooth unless it has few triangles; the hull if it has none or too many."""
    from dicedesign.report.renderer import RenderMesh

    if triangles is None or len(triangles) > MAX_TRIANGLES:
        points, triangles = hull.vertices, hull.triangles
    return RenderMesh(points, np.asarray(triangles), smooth=len(triangles) > MAX_FLAT_TRIANGLES)


@dataclass(frozen=True, kw_only=True)
class BodyFigure(Extension):
    """Kind of figure of a body.

    Attributes
    ----------
    draw: draws the figure with matplotlib; raises InputError if the subject lacks what it shows.
    table: makes CSV text of what is drawn, or None if there is none; raises as `draw`.
    """

    draw: Callable[[Subject], matplotlib.figure.Figure]
    table: Callable[[Subject], str] | None = None


def _down(subject: Subject) -> Floats | None:
    return None if subject.down is None else np.array([subject.down])


def _body_figure(
    name: str,
    address: str,
    line: str,
    arguments: Callable[[Subject], tuple[Any, ...]],
    table: Callable[[Subject], str] | None = None,
) -> BodyFigure:
    """Kind of figure that a function of this package, "module:name", draws."""

    def draw(subject: Subject) -> matplotlib.figure.Figure:
        figure: matplotlib.figure.Figure
        figure = draw_by_address(address, *arguments(subject), width=subject.width)
        return figure

    return BodyFigure(name=name, line=line, draw=draw, table=table)


BODY_FIGURES = Registry(
    "kind of figure",
    BodyFigure,
    builtin=[
        _body_figure(
            "heights",
            "gauss_map:heights",
            "height of the center of mass over the Gauss map, by color",
            lambda it: (it.poses,),
        ),
        _body_figure(
            "paths",
            "gauss_map:paths",
            "paths of bodies that roll, over the Gauss map, from many orientations or one",
            lambda it: (it.poses, _down(it)),
        ),
        _body_figure(
            "complex",
            "gauss_map:gauss_map",
            "Morse-Smale complex over the Gauss map: basins, separatrices, rests, saddles, maxima",
            lambda it: (it.poses, it.labels, it.outcome_of_rest),
        ),
        _body_figure(
            "drop",
            "motion_pictures:drop",
            "a body that rolls to rest, step by step (from --down), and its path",
            lambda it: (it.surface, it.poses, it.down),
        ),
        _body_figure(
            "before_after",
            "surface_figures:before_after",
            "a die above the shape that its design began with, or a mesh above another (--before)",
            lambda it: (it.make_before(), it.surface, it.upward),
        ),
        _body_figure(
            "probabilities",
            "bar_charts:probabilities",
            "target and achieved probabilities of a die",
            lambda it: (it.design,),
        ),
        _body_figure(
            "history",
            "curve_charts:history",
            "error and energy of a design after each step; also as a table, --out FILE.csv",
            lambda it: (it.design, it.tolerance),
            lambda it: it.design.history_csv(),
        ),
    ],
    group="dicedesign.body_figures",
)
"""Kinds of figures of bodies."""
