"""The result of a run: what result.json holds, typed.

`Result` is written as it stands, a key for each attribute; an attribute that is None has none.
Odds are in the order of the labels, lengths in millimetres unless they are called relative, angles
in degrees.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from dicedesign.errors import InputError
from dicedesign.results.balance import Balance
from dicedesign.results.cavities import Cavities
from dicedesign.results.inside import Inside
from dicedesign.results.print_odds import InfillOdds, PrintTolerances
from dicedesign.results.printability import Printability
from dicedesign.results.repair import Repair
from dicedesign.results.status import Status
from dicedesign.results.throws import ThrownOdds
from dicedesign.results.trade_off import TradeOff
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import json_text

__all__ = [
    "RESULT",
    "Displacement",
    "FacetOfDie",
    "HullOfSurface",
    "HullsMade",
    "Result",
    "StageTime",
    "Step",
    "SurfaceSize",
]

RESULT: Final = "result.json"
"""Name of the file, written last: a folder that has it is complete."""

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class FacetOfDie:
    """A facet that the die can rest on.

    Attributes
    ----------
    label: of the outcome whose own facet it is, or None; outcome: label of the outcome that it
        counts for, or None. They differ where several facets nearly in one plane show one outcome.
        A die that is read from above bears the label elsewhere.
    normal: (3,) outward unit normal, down when the die rests on it.
    probability: of coming to rest on it without momentum.
    polygon_area_mm2: its area. inradius_mm: radius of the largest circle in it.
    margin_deg: angle by which the die must be tipped to leave it over the nearest saddle.
    border_deg: least angle from the normal to the border of the basin, at saddles or elsewhere.
    """

    label: str | None
    outcome: str | None
    normal: Numbers
    probability: float
    polygon_area_mm2: float
    inradius_mm: float
    margin_deg: float
    border_deg: float


@dataclass(frozen=True)
class Step:
    """One accepted step of a design.

    Attributes
    ----------
    step: its number, from 0, the start, on. seconds: since the design began; None without a clock.
    energy: what is minimised; terms: its weighted terms, by name.
    max_abs_error: largest |p - q|, or None where the step does not know.
    stage, attempt: of a concave die "hull", "fill" or "balance", each with an energy of its own,
        and the number of the attempt.
    """

    step: int
    seconds: float | None
    energy: float
    max_abs_error: float | None
    terms: dict[str, float] = dataclasses.field(default_factory=dict)
    stage: str | None = None
    attempt: int | None = None


@dataclass(frozen=True)
class HullsMade:
    """Convex hulls of a design: built from scratch, and reused with their corners moved."""

    built: int
    reused: int


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
class StageTime:
    """Wall-clock seconds of a stage, and the most memory that the process held, in units of 10^6
    bytes; None where the system does not tell."""

    name: str
    seconds: float
    peak_mb: float | None


@dataclass(frozen=True)
class Result:
    """All that a run found out about its die.

    Attributes
    ----------
    name: of the recipe.
    status: name of a `Status` in small letters; "converged" alone means success.
    message: the same in a sentence.
    labels: of the k outcomes; target: (k,) their wanted odds.
    probabilities: (k,) odds of the outcomes without momentum, by die_plain.stl as it was read back.
    elsewhere: odds of all rests that count for no outcome.
    max_abs_error: largest |p - q|; design_max_abs_error: the same as designed, before coordinates
        were rounded to those of the file, by the odds that the method is about.
    center_of_mass: (3,) in the coordinates of the file.
    facets: those that the die can rest on, the most probable first; unstable_facets: how many
        others there are.
    rest_counts: (k,) how many rests count for each outcome.
    least_angle_deg: between two outcomes' facets; 180 with one outcome.
    least_margin_deg: angle by which the die must be tipped to leave the outcome that is left most
        easily; 180 where none can be left for another.
    asymmetry: rho of eq. 20 and 21.
    engraved_probabilities, engraved_elsewhere, engraved_max_abs_error: the same odds by die.stl as
        it was read back, with what the marks take away; None where it is not engraved, or where the
        center of mass was given and there is no `inside`: then nobody knows how marks move it.
    prior: the recipe's, under which all its odds are; None where any side is down alike at first.
    reading: how the die with its labels is read, in a sentence.
    history: every accepted step; after rounds of throws those of the last design.
    energy: terms of the energy at the end, by name. starts: starting shapes that were tried;
        evaluations: dice that were tried; hulls: computed for them.
    repair: of the mesh that a concave die is made of, where it was repaired.
    probabilities_before, elsewhere_before: of the surface that a concave die was made from.
    displacement, hull, surface, quality, surface_quality, file_self_intersections: of a concave
        die, how far its points were moved, its hull, its size, defects and distortion as sentences
        and as numbers, and the pairs of triangles of its file that meet and should not.
    cavities: of a concave die that has some.
    inside: what puts the center of mass where it was given, with the recipe's `inside`.
    attempts, search_seconds, attempt: of the search for a concave die, over all sessions, the
        seconds not without a clock, and the number of the attempt that led to this one; None where
        none did. trade_off: what each led to, and what was wanted.
    thrown: what the die does on the recipe's table.
    printability: how it is printed, and what its printer will not make.
    tolerances: how far the odds of prints are from those of the file. infill: odds with the
        recipe's infill, None for a solid print.
    notes: what was repaired or assumed, one sentence each.
    extra: what stages from outside the package found, by names of their own.
    files: names of the files of the folder by what they are; sha256: the checksum of each but
        result.json, by name, in hexadecimal digits.
    stages: what the stages took, none without a clock; peak_since: "stage", or "start" where the
        system can only tell the most memory since the process started.
    folder: where the files are, or None for a die that was not written; not in result.json.
    """

    name: str
    status: str
    message: str
    labels: tuple[str, ...]
    target: Numbers
    probabilities: Numbers
    elsewhere: float
    max_abs_error: float
    design_max_abs_error: float
    center_of_mass: Numbers
    facets: tuple[FacetOfDie, ...]
    unstable_facets: int
    rest_counts: tuple[int, ...]
    least_angle_deg: float
    least_margin_deg: float
    asymmetry: float
    history: tuple[Step, ...]
    notes: tuple[str, ...] = ()
    engraved_probabilities: Numbers | None = None
    engraved_elsewhere: float | None = None
    engraved_max_abs_error: float | None = None
    balance: Balance | None = None
    prior: str | None = None
    reading: str | None = None
    energy: dict[str, float] | None = None
    starts: int | None = None
    evaluations: int | None = None
    hulls: HullsMade | None = None
    repair: Repair | None = None
    probabilities_before: Numbers | None = None
    elsewhere_before: float | None = None
    displacement: Displacement | None = None
    hull: HullOfSurface | None = None
    surface: SurfaceSize | None = None
    quality: tuple[str, ...] | None = None
    surface_quality: dict[str, Any] | None = None
    file_self_intersections: int | None = None
    cavities: Cavities | None = None
    inside: Inside | None = None
    attempts: int | None = None
    search_seconds: float | None = None
    attempt: int | None = None
    trade_off: TradeOff | None = None
    thrown: ThrownOdds | None = None
    printability: Printability | None = None
    tolerances: PrintTolerances | None = None
    infill: InfillOdds | None = None
    extra: dict[str, Any] = dataclasses.field(default_factory=dict)
    files: dict[str, str] = dataclasses.field(default_factory=dict)
    sha256: dict[str, str] = dataclasses.field(default_factory=dict)
    stages: tuple[StageTime, ...] = ()
    peak_since: str = "start"
    folder: Path | None = dataclasses.field(default=None, compare=False)

    @property
    def converged(self) -> bool:
        """Whether the die meets the recipe's tolerance."""
        return self.status == Status.CONVERGED.name.lower()

    @property
    def error_before(self) -> float:
        """Largest of |p - q| and of the odds of all other rests, of the surface that a concave die
        was made from. Raises InputError: it was not made from one."""
        if self.probabilities_before is None or self.elsewhere_before is None:
            raise InputError(
                f"{self.name}: expected a die that keeps the shape of a surface, got another; take "
                "one of method: concave"
            )
        odds = np.array(self.probabilities_before)
        return max(float(np.abs(odds - np.array(self.target)).max()), self.elsewhere_before)

    @property
    def shown(self) -> tuple[tuple[str, Floats], ...]:
        """Label of the outcome that a facet counts for, and its normal (3,), for each that does."""
        return tuple(
            (facet.outcome, np.array(facet.normal))
            for facet in self.facets
            if facet.outcome is not None
        )

    @property
    def plain_file(self) -> Path:
        """The solid without labels. Raises InputError: nothing was written."""
        if "die_plain" not in self.files:
            raise InputError(
                f"{self.name}: expected a die that was written to a folder, got one that was only "
                "designed; write it with its report(folder)"
            )
        return (self.folder or Path()) / self.files["die_plain"]

    def without_clock(self) -> Result:
        """The same without what a clock or the system's memory told: runs that found out the same
        are equal then."""
        history = tuple(dataclasses.replace(step, seconds=None) for step in self.history)
        trade_off = None if self.trade_off is None else self.trade_off.without_clock()
        return dataclasses.replace(
            self,
            history=history,
            search_seconds=None,
            trade_off=trade_off,
            stages=(),
            peak_since="start",
        )

    def json_text(self) -> str:
        """The content of result.json."""
        return json_text(_plain(self))


def _plain(result: Result) -> dict[str, Any]:
    known = {name: value for name, value in dataclasses.asdict(result).items() if value is not None}
    known.pop("folder", None)
    if not known["extra"]:
        del known["extra"]
    if "thrown" in known and known["thrown"]["simulated"] is None:
        del known["thrown"]["simulated"]
    return known
