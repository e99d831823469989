"""How a die lies on the print bed, what has to be supported then, and how it lies best.

Lengths are in millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import Final

import numpy as np

from dicedesign.fabricate.printers import Printer
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.sphere import norms, rotation_between
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.results.parts import PrintPose
from dicedesign.runtime.arrays import Booleans, Floats, Integers

ON_BED: Final = 1e-3
"""Height in mm up to which a triangle lies on the bed: less than a hundredth of a layer."""

LOW: Final = 2.0
"""Layers above the bed that need no supports: the feet of rounded edges."""

LEVEL: Final = 1e-6
"""By how much the cosine of an angle is to exceed that of a limit."""

ALMOST_DEG: Final = 0.5
"""Angle by which a printer's limit may be missed: facets that were meant to be at 45 degrees are a
little off where they were moved."""

FOOTING: Final = 0.2
"""Diameter of the largest circle in a facet, over the height of the die on it, from which on the
die holds to the bed: a rule of thumb."""

AT_A_TIME: Final = 128
"""Triangles that are compared with all facets at a time."""

SURFACE: Final = 1e-3
"""Depth in mm below the plain die's hull from which on a triangle is a part of a pocket."""


@dataclass(frozen=True, eq=False)
class PrintedSolid:
    """A die to be printed.

    Attributes
    ----------
    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside.
    hull: of the die without labels where it is convex, else None: what lies deeper is a pocket.
        Pockets need no supports: their ledges are no longer than they are deep, and their floors
        are bridged.
    labels: k texts; normals: (k, 3) outward where they are.
    """

    points: Floats
    triangles: Integers
    hull: ConvexHull | None
    labels: Sequence[str]
    normals: Floats

    def poses(self, downs: Floats, printer: Printer) -> list[PrintPose]:
        """The die on the bed for each direction (d, 3), unit, that points to the bed."""
        lowest = self._heights(downs)[self.triangles]
        hangs = self.overhanging(downs, printer)
        contacts = self._areas @ (lowest.max(axis=1) < ON_BED)
        overhangs = self._areas @ hangs
        supports = self._areas @ (hangs * (self._units @ downs.T) * lowest.mean(axis=1))
        toward = self.normals @ downs.T
        spoiled = toward > min(_limit(printer), 1.0 - LEVEL)
        return [
            PrintPose(
                label=", ".join(self._named(toward[:, k] > 1.0 - LEVEL)) or None,
                normal=tuple(down.tolist()),
                contact_mm2=float(contacts[k]),
                height_mm=float(lowest[:, :, k].max()),
                overhang_mm2=float(overhangs[k]),
                support_mm3=float(supports[k]),
                spoiled=self._named(spoiled[:, k]),
            )
            for k, down in enumerate(downs)
        ]

    def _named(self, chosen: Booleans) -> tuple[str, ...]:
        """The labels that are chosen, (k,)."""
        return tuple(compress(self.labels, chosen.tolist()))

    def overhanging(self, downs: Floats, printer: Printer) -> Booleans:
        """(t, d) whether a triangle needs supports when a unit direction (d, 3) points to the bed:
        it looks down too nearly level, and is no part of a pocket nor of the lowest `LOW`
        layers."""
        above = self._heights(downs)[self.triangles].max(axis=1) >= LOW * printer.layer_mm
        level = self._units @ downs.T > _limit(printer)
        return np.asarray(level & above & self._outside[:, None])

    def _heights(self, downs: Floats) -> Floats:
        """(n, d) of the points above the bed."""
        depths = self.points @ downs.T
        return np.asarray(depths.max(axis=0) - depths)

    @cached_property
    def _areas(self) -> Floats:
        """(t,) of the triangles."""
        return norms(doubled_area_vectors(self.points, self.triangles)) / 2.0

    @cached_property
    def _units(self) -> Floats:
        """(t, 3) normals of the triangles, 0 for those without area."""
        doubled = 2.0 * self._areas
        vectors = doubled_area_vectors(self.points, self.triangles)
        return np.asarray(vectors / np.where(doubled > 0.0, doubled, 1.0)[:, None])

    @cached_property
    def _outside(self) -> Booleans:
        """(t,) whether a triangle is no part of a pocket."""
        if self.hull is None:
            return np.ones(len(self.triangles), dtype=bool)
        middles = self.points[self.triangles].mean(axis=1)
        # In parts that stay in the processor's memory: rounded dice have thousands of facets.
        parts = np.array_split(middles, len(middles) // AT_A_TIME + 1)
        return np.concatenate([self.hull.depths(part).min(axis=1) < SURFACE for part in parts])


def _limit(printer: Printer) -> float:
    """Cosine of the angle to level that a surface which looks down is not to exceed."""
    return math.cos(math.radians(max(printer.overhang_deg - ALMOST_DEG, 0.0))) + LEVEL


def beds(hull: ConvexHull, rests: Integers, is_convex: bool) -> Floats:
    """Directions (d, 3), unit, that can point to the bed: normals of the facets that are large
    enough for the die to hold on, or where there are none, of those that it rests on.

    hull: of the die; rests: (r,) facets that it rests on; is_convex: whether facets of the hull are
    facets of the die, else only its rests are tried.
    """
    facets = np.arange(len(hull.normals)) if is_convex else rests
    heights = hull.vertices @ hull.normals[facets].T
    tall = np.ptp(heights, axis=0)
    # A circle has no more area than the facet that it is in.
    wide = np.pi * (FOOTING * tall / 2.0) ** 2 <= hull.areas[facets]
    kept = [
        facet
        for facet, height in zip(facets[wide].tolist(), tall[wide].tolist(), strict=True)
        if 2.0 * facet_inradius(hull, facet) >= FOOTING * height
    ]
    return hull.normals[kept if kept else rests]


def placement_on_bed(points: Floats, down: Floats) -> Floats:
    """(4, 4) rigid motion that turns a unit direction (3,) down by the smallest rotation, and puts
    points (n, 3) onto the bed z = 0 with the middle of their box above its origin."""
    transform = np.eye(4)
    transform[:3, :3] = rotation_between(down, np.array([0.0, 0.0, -1.0]))
    turned = points @ transform[:3, :3].T
    low, high = turned.min(axis=0), turned.max(axis=0)
    transform[:2, 3] = -(low + high)[:2] / 2.0
    transform[2, 3] = -low[2]
    return transform
