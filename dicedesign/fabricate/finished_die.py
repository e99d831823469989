"""A finished die as figures and pages draw it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dicedesign.fabricate.verdict import Verdict
from dicedesign.results.record import Result
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.concave.result import ConcaveDie
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.fabricate.label_reading import Reading
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.repair.repair import RepairedMesh
    from dicedesign.geometry.surfaces.quality import SurfaceQuality
    from dicedesign.geometry.surfaces.surface import Surface
    from dicedesign.throws.simulation.die_on_table import ThrownDie

__all__ = ["EngravedFile", "FinishedDie"]


@dataclass(frozen=True, eq=False)
class EngravedFile:
    """A die with its labels cut in and its edges rounded.

    Attributes
    ----------
    points, triangles: (n, 3) and (t, 3) of the solid in mm.
    verdict: on its file; None where the center of mass was given, as nobody knows how labels and
        edges move it.
    placements: where the labels are, of a die that has them on its facets.
    inlay: bodies of another color that fill the labels, or None.
    core: of a convex die, what is within its rounded edges, whose facets are its flat ones.
    """

    points: Floats
    triangles: Integers
    verdict: Verdict | None
    placements: tuple[Placement, ...]
    inlay: Surface | None = None
    core: ConvexHull | None = None


@dataclass(frozen=True, eq=False)
class FinishedDie:
    """All that a run knows of its die.

    Attributes
    ----------
    result: the content of result.json.
    plain: the verdict on die_plain.stl; engraved: die.stl, or None.
    tolerance: largest |p - q| that was allowed.
    upward: (3,) direction that is up in pictures.
    reshaped: the surface before and after, of a die that keeps the shape of one; quality: of the
        surface after.
    repaired: the mesh that the surface before is of, where it was repaired.
    thrown: what the die does on its table, of one that is to be thrown.
    reading: how a die with labels is read; its places are those of `engraved.placements`, in the
        same order.
    """

    result: Result
    plain: Verdict
    engraved: EngravedFile | None
    tolerance: float
    upward: Floats
    reshaped: ConcaveDie | None = None
    quality: SurfaceQuality | None = None
    repaired: RepairedMesh | None = None
    thrown: ThrownDie | None = None
    reading: Reading | None = None
