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
    """Reason why a design stopped, or flaw of the finished die; the value is the message."""

    CONVERGED = "reached the tolerance"
    OFF_TARGET = "the probabilities of the outcomes are off by more than the tolerance"
    STRAY = "the die also rests elsewhere, more often than the tolerance"
    CROWDED = "two outcomes are nearer than 5 degrees to each other, too near to tell apart"
    UNSTEADY = "an outcome tips over at less than 0.1 degrees"
    TOO_NEAR = "two outcomes are nearer to each other than method.concave.apart_deg"
    TIPPY = "an outcome tips over at less than method.concave.margin_deg"
    FRAGILE = (
        "its prints are off by more than method.concave.prints_within on average; print it larger "
        "or on a finer printer, or take another seed or surface"
    )
    LOOSE = "the surface does not fill the designed hull"
    SELF_INTERSECTING = "the surface intersects itself"
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
        "a file in another format does not have the probabilities of the die and was discarded"
    )
    NO_START = (
        "no starting shape led to the target; try another seed, or allow more with "
        "method.exact.starts"
    )
    UNCHANGED = "no attempt led to a die: this is the original surface"
    NO_PROGRESS = "no step lowers the energy any further; try another start, assignment or seed"
    NO_GRADIENT = (
        "the energy has no finite gradient at this shape, which is exactly balanced; raise the "
        "method's perturbation, or try another start or seed"
    )
    TOO_SMALL = (
        "reached the probabilities, but with a facet that has no room for a circle of "
        "min_inradius_mm; raise size_mm, lower min_inradius_mm, or try another seed"
    )
    STEP_LIMIT = "reached the number of steps; allow more steps"
    TIME_LIMIT = "ran out of time"


READINGS = {
    "down": "Lift the die and read the label on the face that was on the table.",
    "up": "Read the label on top.",
    "both": "Read the label on top; the face on the table has this label too.",
    "corner": "Read the label that stands upright around the top corner.",
    "edge": "Read the label on top, or upright beside the edge on top.",
    "marks": "Read the label on the side that is up.",
}
"""Instructions for the reader of a die, by the way to read it."""


@dataclass(frozen=True)
class Repair:
    """Repaired surface of one solid, compared with the original triangles.

    Distances are from uniformly sampled points, relative to the diagonal of the triangles' bounding
    box.

    Attributes
    ----------
    cells: grid steps along the longest side.
    pieces: solids enclosed by the triangles, of which the largest is repaired.
    dropped: volume share of the other solids.
    cavities: number of filled cavities.
    handles_before, handles: handles of the triangles, None if they are not closed, and of the
        surface.
    off_mean, off_largest: distances from the surface to the triangles.
    missed_mean, missed_largest: distances from outer triangles to the surface.
    thin: area share of triangles over parts thinner than a cell, which were thickened.
    sheets: area share of triangles without a solid on either side.
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
    """Cavities that move the center of mass, measured in the file.

    Attributes
    ----------
    number: number of cavities.
    wall_mm: minimum distance between the outer surface and a cavity.
    volume_mm3: total volume; part: its share of the volume of the die without cavities.
    shift_mm: distance by which the center of mass moves.
    marked_wall_mm: minimum distance between the surface with its marks, in die.stl, and a cavity;
        None without marks.
    """

    number: int
    wall_mm: float
    volume_mm3: float
    part: float
    shift_mm: float
    marked_wall_mm: float | None = None


@dataclass(frozen=True)
class Displacement:
    """Distances by which the points of a surface moved, relative to its diagonal."""

    mean: float
    largest: float


@dataclass(frozen=True)
class HullOfSurface:
    """Hull vertices of a surface before and after, and the largest distance between the final and
    the designed hull, relative to the diagonal."""

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
    """Die by the concave method, which keeps the shape of a surface.

    Attributes
    ----------
    probabilities_before, elsewhere_before: probabilities of the original surface.
    displacement: moves of its points; hull, surface: its hull and its size.
    quality: defects and distortion of the surface as sentences; surface_quality: as numbers.
    self_intersections: pairs of intersecting triangles of die_plain.stl.
    cavities: cavities in that file, if any.
    repair: repair of the original mesh, if it needed one.
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
    """Best die of an attempt.

    Attributes
    ----------
    attempt: number of the attempt, from 1 on. seconds: its time; None without a clock.
    error: largest of |p - q| over the outcomes and the total probability of all other rests.
    displacement: mean over the points of the surface, relative to its diagonal.
    apart_deg: smallest angle between two outcomes' rests.
    margin_deg: smallest tilt that leaves an outcome.
    self_intersections: pairs of intersecting triangles.
    prints: mean total variation of prints from the target, for the worst of three orientations in
        print; None if they were not judged.
    """

    attempt: int
    seconds: float | None
    error: float
    displacement: float
    apart_deg: float
    margin_deg: float
    self_intersections: int
    prints: float | None = None

    def is_fragile(self, within: float) -> bool:
        """Whether prints were judged and are off by more than a limit."""
        return self.prints is not None and self.prints > within


@dataclass(frozen=True)
class TradeOff:
    """Trade-off of displacement against probabilities, separation and margin.

    Attributes
    ----------
    tolerance: error limit. apart_deg, margin_deg: minimum angles, see `Draft`. prints_within: limit
        of `Draft.prints`.
    drafts: best dice of the attempts that have one, by number.
    """

    tolerance: float
    apart_deg: float
    margin_deg: float
    prints_within: float
    drafts: tuple[Draft, ...]

    def flaws(self, draft: Draft) -> Iterator[Status]:
        """Yield the flaws of a draft, the worst first."""
        if draft.error > self.tolerance:
            yield Status.OFF_TARGET
        if draft.self_intersections > 0:
            yield Status.SELF_INTERSECTING
        if draft.apart_deg < self.apart_deg - math.degrees(FILE_ANGLE):
            yield Status.TOO_NEAR
        if draft.margin_deg < self.margin_deg - math.degrees(FILE_ANGLE):
            yield Status.TIPPY
        if draft.is_fragile(self.prints_within):
            yield Status.FRAGILE


@dataclass(frozen=True)
class Search:
    """Search for a concave die.

    Attributes
    ----------
    attempts: number of attempts over all sessions; seconds: their time, None without a clock.
    attempt: number of the attempt that made this die; None if all failed.
    trade_off: best dice of the attempts, and the limits.
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
        noise_floor: its mean for a perfect die in as many throws.
    expected: expected total variation of the die's probabilities from the target, given the throws
        of all rounds, including their uncertainty.
    is_kept: whether the design continued with this die.
    requested: target of this round's design in the momentum model. frequencies: of
        the outcomes; they sum to less than 1 if some throws came to rest on no outcome.
    """

    drops: int
    deviation: float
    noise_floor: float
    expected: float
    is_kept: bool
    requested: Numbers
    frequencies: Numbers


@dataclass(frozen=True)
class SimulatedThrows:
    """Simulated throws of the finished die.

    Attributes
    ----------
    engine, seed, drops: settings. unresolved: throws that did not come to rest in time.
    counts, frequencies: of the outcomes; intervals: exact 95 % intervals.
    total_variation: from the target, with its 95 % interval and the mean of a perfect die.
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
class ByTable:
    """Probabilities of the finished die on each table of a mixture, from its simulated throws.

    Attributes
    ----------
    probabilities: of the outcomes on each table.
    values: total variation from the target on each table. often: their 90 % quantile; worst: their
        maximum.
    chance_often, chance_worst: mean quantile and maximum of a perfect die in as many throws.
    noticed: share of the tables' 1,000 rolls in which a chi-square test finds the die wrong at 1 %;
        0.01 for a perfect die.
    """

    probabilities: tuple[Numbers, ...]
    values: Numbers
    often: float
    worst: float
    chance_often: float
    chance_worst: float
    noticed: float


@dataclass(frozen=True)
class TableResult:
    """Probabilities of a die on a table.

    Attributes
    ----------
    table: parameters by name, with the die's own size.
    momentum: probabilities by the momentum model.
    rounds: of throws that corrected the design.
    simulated: throws of the finished die, or None.
    by_table: the same throws by tables, if there are several.
    """

    table: dict[str, Any]
    momentum: Numbers
    rounds: tuple[RoundOfThrows, ...]
    simulated: SimulatedThrows | None = None
    by_table: ByTable | None = None


MAX_THROWN_OFF = 0.02
"""Total variation from the target beyond which a thrown die gets a warning."""

MAX_OUTCOME_OFF = 0.25
"""The same for an outcome's error over its probability."""


@dataclass(frozen=True)
class ThrowForecast:
    """Expected frequencies of the finished die when thrown, by the momentum model.

    Attributes
    ----------
    table: name of the table, which stands for several hands.
    probabilities: of the outcomes, the mean over the hands.
    total_variation: of these from the target. nine_in_ten: total variation of single hands that
        nine in ten do not exceed.
    """

    table: str
    probabilities: Numbers
    total_variation: float
    nine_in_ten: float

    def is_off(self, target: Numbers) -> bool:
        """Whether the die does not have its target when thrown."""
        pairs = zip(self.probabilities, target, strict=True)
        error = max(abs(p / q - 1.0) for p, q in pairs)
        return self.total_variation > MAX_THROWN_OFF or error > MAX_OUTCOME_OFF


@dataclass(frozen=True)
class Candidate:
    """One of several dice with the target's probabilities and different numbers of faces.

    Attributes
    ----------
    name: of its shape. faces: number of labeled faces.
    thrown, nine_in_ten: as `ThrowForecast.total_variation` and `nine_in_ten`.
    looks: measure of `Looks`, 0 to 1; quotient: isoperimetric quotient, 1 for a ball.
    is_read_on_top: whether a label is on top when it has come to rest.
    label_mm: diameter of the circle in the smallest labeled face, at `size_mm`.
    size_mm: largest distance between two corners; weight_g: as a solid print, or None.
    prints: mean total variation of prints whose faces are off by 0.1 mm in 30 mm.
    lacks: what it lacks, in words; shortfall: by how much, 0 if nothing.
    """

    name: str
    faces: int
    thrown: float
    nine_in_ten: float
    looks: float
    quotient: float
    is_read_on_top: bool
    label_mm: float
    size_mm: float
    weight_g: float | None
    prints: float
    lacks: tuple[str, ...] = ()
    shortfall: float = 0.0
