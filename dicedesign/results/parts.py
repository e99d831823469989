"""The sections of a `Result`, and the status of a design.

Probabilities are in the order of the labels. Lengths are in millimeters, angles in degrees, unless
a docstring says otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, TypeAlias

from dicedesign.tolerances import FILE_ANGLE

Numbers: TypeAlias = tuple[float, ...]


class Status(Enum):
    """Why a design stopped, or what is wrong with the finished die; the value is the message."""

    CONVERGED = "reached the tolerance"
    OFF_TARGET = "the probabilities of the outcomes are off by more than the tolerance"
    STRAY = "the die also rests elsewhere, more often than the tolerance"
    CROWDED = "two outcomes are nearer than 5 degrees to each other, which is one to the eye"
    UNSTEADY = "an outcome is left at a nudge"
    TOO_NEAR = "two outcomes are nearer to each other than method.concave.apart_deg"
    TIPPY = "an outcome is left when the die is tipped by less than method.concave.margin_deg"
    LOOSE = "the surface does not fill the designed hull"
    SELF_INTERSECTING = "the surface meets itself"
    OPEN = "the surface is not closed, as rounded to the single precision of its file"
    UNPRINTABLE = "the surface cannot be cleaned for printing"
    UNBALANCED = (
        "the plain die reached the tolerance, but no shape nearby does with its labels and edges; "
        "try a smaller depth_mm or radius_mm, or another seed"
    )
    OFF_TABLE = (
        "simulated throws are off by more than the tolerance; allow more with "
        "method.exact.refine.rounds or .drops"
    )
    FILE_LEFT_OUT = (
        "a file in another format has not the probabilities of the die, and was left out"
    )
    NO_START = (
        "none of the starting shapes led there; try another seed, or allow more with "
        "method.exact.starts"
    )
    UNCHANGED = "no attempt led to a die: this is the surface as it came"
    NO_PROGRESS = "no step lowers the energy any further; try another start, assignment or seed"
    NO_GRADIENT = (
        "the energy has no finite gradient at this shape, which balances exactly; raise the "
        "method's perturbation, or try another start or seed"
    )
    TOO_SMALL = (
        "reached the probabilities, but with a facet that has no room for a circle of "
        "min_inradius_mm; "
        "raise size_mm, lower min_inradius_mm, or try another seed"
    )
    STEP_LIMIT = "reached the number of steps; allow more steps"
    TIME_LIMIT = "ran out of time"


@dataclass(frozen=True)
class Repair:
    """The surface of one solid, made of triangles that were none, against those triangles.

    Distances are those of points drawn evenly on one from the other, over the diagonal of the box
    that holds the triangles.

    Attributes
    ----------
    cells: of the grid, along the longest side.
    pieces: solids that the triangles bound; the largest is kept.
    dropped: volume of the others over that of all.
    cavities: in them, that were filled.
    handles_before, handles: of the triangles, or None where they are not closed; of the surface.
    off_mean, off_largest: from the surface to the triangles.
    missed_mean, missed_largest: from the triangles that are not inside the solids to the surface.
    thin: area of the triangles over parts thinner than a cell, which were thickened, over that of
        all.
    sheets: area of the triangles that have no solid on either side, over that of all.
    """

    cells: int
    pieces: int
    dropped: float
    cavities: int
    handles_before: int | None
    handles: int
    off_mean: float
    off_largest: float
    missed_mean: float
    missed_largest: float
    thin: float
    sheets: float


@dataclass(frozen=True)
class Cavities:
    """Cavities that bring the center of mass to where the probabilities are those of the target,
    measured in the file as it was read back.

    Attributes
    ----------
    number: of closed parts.
    wall_mm: least distance between the surface and that of a cavity.
    volume_mm3: of all; part: that over the volume of the die without them.
    shift_mm: distance that they move the center of mass.
    """

    number: int
    wall_mm: float
    volume_mm3: float
    part: float
    shift_mm: float


@dataclass(frozen=True)
class Displacement:
    """How far the points of a surface were moved, relative to its diagonal."""

    mean: float
    largest: float


@dataclass(frozen=True)
class HullOfSurface:
    """Corners of a surface's hull before and after, and the largest distance between the hull of
    the finished surface and the designed one, relative to the diagonal."""

    vertices_before: int
    vertices_after: int
    gap: float


@dataclass(frozen=True)
class SurfaceSize:
    """Numbers of vertices and triangles of the finished surface."""

    vertices: int
    triangles: int


@dataclass(frozen=True)
class Concave:
    """A die that keeps the shape of a surface.

    Attributes
    ----------
    probabilities_before, elsewhere_before: of the surface that it was made from.
    displacement: how far its points were moved; hull, surface: its hull and its size.
    quality: defects and distortion of the surface as sentences; surface_quality: as numbers.
    self_intersections: pairs of triangles of die_plain.stl that meet and should not.
    cavities: measured in that file, if there are some.
    repair: of the mesh that it was made from, if that was repaired.
    """

    probabilities_before: Numbers
    elsewhere_before: float
    displacement: Displacement
    hull: HullOfSurface
    surface: SurfaceSize
    quality: tuple[str, ...]
    surface_quality: dict[str, Any]
    self_intersections: int
    cavities: Cavities | None = None
    repair: Repair | None = None


@dataclass(frozen=True)
class Draft:
    """The best die of an attempt.

    Attributes
    ----------
    attempt: its number, from 1 on. seconds: it took; None without a clock.
    error: largest of |p - q| over the outcomes and the probabilities of all other rests together.
    displacement: mean over the points of the surface, relative to its diagonal.
    apart_deg: least angle between two outcomes' rests.
    margin_deg: least angle by which it must be tipped to leave an outcome.
    self_intersections: pairs of triangles that meet and should not.
    """

    attempt: int
    seconds: float | None
    error: float
    displacement: float
    apart_deg: float
    margin_deg: float
    self_intersections: int


@dataclass(frozen=True)
class TradeOff:
    """Displacement against probabilities, separation and margin.

    Attributes
    ----------
    tolerance: largest error wanted. apart_deg, margin_deg: least angles wanted, see `Draft`.
    drafts: of the attempts that led to any, in the order of their numbers.
    """

    tolerance: float
    apart_deg: float
    margin_deg: float
    drafts: tuple[Draft, ...]

    def flaws(self, draft: Draft) -> Iterator[Status]:
        """What a draft is not like that was wanted, the worst first."""
        if draft.error > self.tolerance:
            yield Status.OFF_TARGET
        if draft.self_intersections > 0:
            yield Status.SELF_INTERSECTING
        if draft.apart_deg < self.apart_deg - math.degrees(FILE_ANGLE):
            yield Status.TOO_NEAR
        if draft.margin_deg < self.margin_deg - math.degrees(FILE_ANGLE):
            yield Status.TIPPY


@dataclass(frozen=True)
class Search:
    """The search for a concave die.

    Attributes
    ----------
    attempts: over all sessions, which took `seconds`, None without a clock.
    attempt: the number of the one that led to this die; None where none led to any.
    trade_off: what each led to, and what was wanted.
    """

    attempts: int
    seconds: float | None
    attempt: int | None
    trade_off: TradeOff

    def without_clock(self) -> Search:
        """Copy without run times."""
        drafts = tuple(replace(draft, seconds=None) for draft in self.trade_off.drafts)
        return replace(self, seconds=None, trade_off=replace(self.trade_off, drafts=drafts))


@dataclass(frozen=True)
class RoundOfThrows:
    """One round of throws that corrected a design.

    Attributes
    ----------
    drops: throws that came to rest. deviation: total variation of the frequencies from the target;
        noise_floor: what a perfect die would show on the mean in as many throws.
    expected: total variation of the die's probabilities from the target that the throws of all
        rounds let one expect on the mean: it has what is not known of them in it.
    elsewhere_drops: throws onto what the table may be instead, all together. elsewhere: as
        `expected`, on nine of ten of these tables at most; None without any.
    is_kept: whether the die of this round was kept.
    requested: target of this round's design in the momentum model. frequencies: of
        the outcomes, with a sum of less than 1 where some throws came to rest on no outcome.
    """

    drops: int
    deviation: float
    noise_floor: float
    expected: float
    elsewhere_drops: int
    elsewhere: float | None
    is_kept: bool
    requested: Numbers
    frequencies: Numbers


@dataclass(frozen=True)
class SimulatedThrows:
    """Throws of the finished die.

    Attributes
    ----------
    engine, seed, drops: how it was thrown. unresolved: throws that came to rest nowhere in time.
    counts, frequencies: of the outcomes; intervals: of each an exact 95 % interval.
    total_variation: from the target, with its 95 % interval and what a perfect die shows.
    """

    engine: str
    seed: int
    drops: int
    unresolved: int
    counts: tuple[int, ...]
    frequencies: Numbers
    intervals: tuple[tuple[float, float], ...]
    total_variation: float
    interval: tuple[float, float]
    noise_floor: float


@dataclass(frozen=True)
class OtherTables:
    """Throws of the finished die onto what the table may be instead.

    Attributes
    ----------
    drops: onto all of them together.
    values: total variation from the target on each. often: on nine tables of ten at most; worst.
    chance_often, chance_worst: what these would be on the mean of a perfect die, judged by as many
        throws.
    """

    drops: int
    values: Numbers
    often: float
    worst: float
    chance_often: float
    chance_worst: float


@dataclass(frozen=True)
class TableResult:
    """What a die does on a table.

    Attributes
    ----------
    table: its numbers by name, with the die's own size.
    momentum: probabilities by the momentum model.
    rounds: of throws that corrected the design.
    simulated: throws of the finished die, or None.
    elsewhere: its throws onto what the table may be instead, or None.
    """

    table: dict[str, Any]
    momentum: Numbers
    rounds: tuple[RoundOfThrows, ...]
    simulated: SimulatedThrows | None = None
    elsewhere: OtherTables | None = None


@dataclass(frozen=True)
class SmallestFacet:
    """The facet of a convex die with the smallest largest circle: its area, and the radius of that
    circle."""

    area_mm2: float
    inradius_mm: float


@dataclass(frozen=True)
class PrintedLabel:
    """The finest parts of a label.

    Attributes
    ----------
    text: the label.
    stroke_mm: width of its thinnest stroke, None where no two sides of one are parallel.
    ridge_mm: least width of what stands between two strokes, or None where nothing does.
    wall_mm: least distance of the floor of its pocket from a facet beneath, or of the pocket from
        another; None where it has no pocket.
    """

    text: str
    stroke_mm: float | None
    ridge_mm: float | None
    wall_mm: float | None


@dataclass(frozen=True)
class PrintPose:
    """A die as it lies on the print bed.

    Attributes
    ----------
    label: that lies on the bed, or None.
    normal: (3,) unit direction of the body that points to the bed.
    contact_mm2: area on the bed.
    height_mm: of the die above it.
    overhang_mm2: area that looks down so nearly level that it needs supports; support_mm3: volume
        beneath it, at most that of the supports.
    spoiled: labels that touch the bed or supports.
    """

    label: str | None
    normal: Numbers
    contact_mm2: float
    height_mm: float
    overhang_mm2: float
    support_mm3: float
    spoiled: tuple[str, ...]


@dataclass(frozen=True)
class FileCheck:
    """The solid as its file holds it, in single precision.

    Attributes
    ----------
    open_edges: edges that do not lie between two triangles which run along it in opposite
        directions.
    pieces: closed parts that face outward; cavities: those that face inward.
    self_intersections: pairs of triangles that meet and should not, but for lines.
    flat_triangles: triangles without area.
    volume_mm3: without its cavities.
    """

    open_edges: int
    pieces: int
    cavities: int
    self_intersections: int
    flat_triangles: int
    volume_mm3: float

    @property
    def is_solid(self) -> bool:
        """Whether it is the surface of one solid, without a flaw."""
        flaws = self.open_edges + self.self_intersections + self.flat_triangles
        return flaws == 0 and self.pieces == 1 and self.volume_mm3 > 0.0


@dataclass(frozen=True)
class ThinParts:
    """Parts of a die that are thinner than its printer makes walls.

    Attributes
    ----------
    wall_mm: least thickness of what it makes.
    share: of the surface that bounds such parts.
    least_mm: thickness of the thinnest; place: (3,) the middle of it, in the coordinates of
        die_plain.stl.
    """

    wall_mm: float
    share: float
    least_mm: float
    place: Numbers


@dataclass(frozen=True)
class Printability:
    """How a die is printed, and what will be hard.

    Attributes
    ----------
    printer, material: names; spot_mm, layer_mm: width of its nozzle, pixel or spot, and height of
        its layers; density_g_cm3: of the material.
    weight_g: of the die, solid but for cavities, with what fills its labels.
    bounding_box_mm: (3,) extents along the axes of the file.
    file: the check of die.stl, or of die_plain.stl where there are no labels.
    smallest_facet: None of a die that is not convex.
    thin: parts of a die that keeps the shape of a surface, before labels are cut in; None where
        there are none, and of other dice.
    labels: of a die that has them on its facets.
    poses: the die on each facet that it can rest on, the most probable first.
    best: the pose to print it in; placement: 4 rows of 4, the rigid motion from the file to the bed
        z = 0, about whose origin it then lies.
    warnings: what this printer will not make, one sentence each.
    """

    printer: str
    spot_mm: float
    layer_mm: float
    material: str
    density_g_cm3: float
    weight_g: float
    bounding_box_mm: Numbers
    file: FileCheck
    smallest_facet: SmallestFacet | None
    thin: ThinParts | None
    labels: tuple[PrintedLabel, ...]
    poses: tuple[PrintPose, ...]
    best: PrintPose
    placement: tuple[Numbers, ...]
    warnings: tuple[str, ...]
