"""Figures of any body, of those of the paper: one file each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body
from dicedesign.report.charts.paper import Paper
from dicedesign.report.render.renderer import Surface
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension

__all__ = ["BODY_FIGURES", "Ablation", "BodyFigure", "Lain", "Subject", "drawn_surface"]

MOST_TRIANGLES: Final = 1_000_000
"""A mesh of more is drawn as its hull."""

MOST_FLAT: Final = 400
"""Triangles up to which a mesh is drawn with flat faces and edges."""


@dataclass(frozen=True, eq=False)
class Ablation:
    """A die that was designed without some terms of the energy.

    Attributes
    ----------
    name: what was left out.
    error: largest |p - q| of the outcomes.
    poses: its rests; outcomes: (k,) which outcome each counts for.
    """

    name: str
    error: float
    poses: RestPoses
    outcomes: Integers


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

    draw: Callable[[Subject], Paper]


BODY_FIGURES: Final = FolderRegistry[BodyFigure](
    "kind of figure", "dicedesign.report.body_figures", BodyFigure
)
"""All figures of bodies."""
