"""The result of a run: what result.json holds, typed.

`Result` is written as it stands, a key for each attribute; an optional one that is None has none.
Probabilities are in the order of the labels, lengths in millimeters unless they are called
relative, angles in degrees.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.results.parts import (
    Concave,
    Numbers,
    Printability,
    Search,
    Status,
    TableResult,
)
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import json_text, plain

RESULT: Final = "result.json"
"""Name of the file, written last: a folder that has it is complete."""


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
    energy: what is minimized; terms: its weighted terms, by name.
    max_abs_error: largest |p - q|, or None where the step does not know.
    stage, attempt: of a concave die "hull", "fill" or "balance", each with an energy of its own,
        and the number of the attempt.
    """

    step: int
    seconds: float | None
    energy: float
    max_abs_error: float | None
    terms: dict[str, float] = field(default_factory=dict)
    stage: str | None = None
    attempt: int | None = None


@dataclass(frozen=True)
class HullCounts:
    """Convex hulls of a design: built from scratch, and reused with their corners moved."""

    built: int
    reused: int


@dataclass(frozen=True)
class Designed:
    """The die as designed, before coordinates were rounded to those of a file.

    Attributes
    ----------
    max_abs_error: largest |p - q|, by the probabilities that the method is about.
    energy: terms of the energy at the end, by name.
    starts: starting shapes that were tried; evaluations: dice that were tried; hulls: computed for
        them.
    """

    max_abs_error: float
    energy: dict[str, float] | None = None
    starts: int | None = None
    evaluations: int | None = None
    hulls: HullCounts | None = None


@dataclass(frozen=True)
class Balance:
    """How the finished die, with its labels and edges, came to the probabilities of its target.

    Attributes
    ----------
    by: "shape", "opposite", "fill" or "none", as in a recipe's `engrave`.
    unbalanced: (k,) probabilities that the finished die would have if the plain shape were only
        engraved; for a die to be thrown those by the momentum model, as its target is then.
    errors: largest difference from the target in each round, before coordinates are rounded to
        those of a file; the first is that of `unbalanced`, the least that of the die.
    moved_mm: largest distance from a corner of the plain shape to the planes of its facets as they
        were moved.
    stretch: of a die that keeps the shape of a surface, the largest relative change of a length.
    """

    by: str
    unbalanced: Numbers
    errors: Numbers
    moved_mm: float
    stretch: float | None = None


@dataclass(frozen=True)
class Engraved:
    """The die with its labels cut in, its edges rounded or something inside of it.

    Attributes
    ----------
    probabilities, elsewhere, max_abs_error: by die.stl as it was read back, with what the marks
        take away, as those of `Result`; None where the center of mass was given and there is no
        `inside`: then nobody knows how marks move it.
    reading: how the labels are read, in a sentence.
    balance: how it came to the probabilities of its target.
    """

    probabilities: Numbers | None = None
    elsewhere: float | None = None
    max_abs_error: float | None = None
    reading: str | None = None
    balance: Balance | None = None


@dataclass(frozen=True)
class Inside:
    """A cavity, infill or weights, measured in the files as they were read back.

    Attributes
    ----------
    by: "cavity", "infill" or "weights", as in a recipe's `inside`.
    shift_mm: distance from the center of mass of the uniform solid to that which was given; off_mm:
        from there to that of the files.
    wall_mm: least thickness of walls; None where nothing is inside.
    details: plain data about it; notes: sentences about it.
    """

    by: str
    shift_mm: float
    off_mm: float
    wall_mm: float | None
    details: dict[str, Any]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class PrintTolerances:
    """How far the probabilities of prints are from those of the file, to first order.

    Attributes
    ----------
    answer: how well the die must be printed for a test of so many rolls not to notice, in a
        sentence.
    rolls: of that test.
    allowed_mm: standard deviation of the place of each facet at which it notices one print in ten,
        by derivatives, or where these promise too much by prints that are made one by one; 0 where
        it notices more of perfect ones, None where it never does.
    noticed: part of the prints with all errors that are assumed that it notices; a perfect die is
        noticed by the level of the test, 0.05.
    assumed: standard deviations of the errors, see `PrintErrors`.
    deviations: (k,) standard deviations of the probabilities of the outcomes among such prints.
    by_error: the same from each error alone, by the names in `assumed`.
    total_variation: of the probabilities of such prints from those of the file, on the mean.
    """

    answer: str
    rolls: int
    allowed_mm: float | None
    noticed: float
    assumed: dict[str, float]
    deviations: Numbers
    by_error: dict[str, Numbers]
    total_variation: float


@dataclass(frozen=True)
class InfillProbabilities:
    """The die with solid walls and less material inside.

    Attributes
    ----------
    infill, walls_mm: part of the inside that is material, and thickness of the walls.
    advice: what that does to the probabilities, and what to print instead, in a sentence.
    probabilities, elsewhere, max_abs_error: probabilities without momentum of such a print.
    mass: over that of the solid die.
    shift_mm: (3,) move of the center of mass.
    least_infill: least one at which a test of 1,000 rolls notices no more than one print in ten for
        its infill, with these walls; 1 where only a solid one will do.
    """

    infill: float
    walls_mm: float
    advice: str
    probabilities: Numbers
    elsewhere: float
    max_abs_error: float
    mass: float
    shift_mm: Numbers
    least_infill: float


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
    labels: of the k outcomes; target: (k,) their wanted probabilities.
    probabilities: (k,) probabilities of the outcomes without momentum, by die_plain.stl as it was
        read back.
    elsewhere: probabilities of all rests that count for no outcome.
    max_abs_error: largest |p - q|.
    center_of_mass: (3,) in the coordinates of the file.
    facets: those that the die can rest on, the most probable first; unstable_facets: how many
        others there are.
    rest_counts: (k,) how many rests count for each outcome.
    least_angle_deg: between two outcomes' facets; 180 with one outcome.
    least_margin_deg: angle by which the die must be tipped to leave the outcome that is left most
        easily; 180 where none can be left for another.
    asymmetry: rho of eq. 20 and 21.
    prior: the recipe's, under which all its probabilities are; None for uniform start orientations.
    history: every accepted step; after rounds of throws those of the last design.
    design: the die as designed. engraved: with labels, edges or something inside; None for a plain
        one. inside: what puts the center of mass where it was given, with the recipe's `inside`.
    concave: of a die that keeps the shape of a surface; search: how that was found.
    thrown: what the die does on the recipe's table.
    printability: how it is printed, and what its printer will not make.
    tolerances: how far the probabilities of prints are from those of the file. infill:
        probabilities with the recipe's infill, None for a solid print.
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
    center_of_mass: Numbers
    facets: tuple[FacetOfDie, ...]
    unstable_facets: int
    rest_counts: tuple[int, ...]
    least_angle_deg: float
    least_margin_deg: float
    asymmetry: float
    history: tuple[Step, ...]
    design: Designed
    notes: tuple[str, ...] = ()
    prior: str | None = None
    engraved: Engraved | None = None
    inside: Inside | None = None
    concave: Concave | None = None
    search: Search | None = None
    thrown: TableResult | None = None
    printability: Printability | None = None
    tolerances: PrintTolerances | None = None
    infill: InfillProbabilities | None = None
    extra: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    sha256: dict[str, str] = field(default_factory=dict)
    stages: tuple[StageTime, ...] = ()
    peak_since: str = "start"
    folder: Path | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        return f"<Result {self.name}: {self.status}, {self.message}>"

    def _repr_html_(self) -> str:
        """HTML of the printed die to turn and a table of its outcomes, for notebooks."""
        # By its address, as pictures are drawn on a higher floor.
        return str(import_module("dicedesign.report.notebook").result_html(self))

    @property
    def converged(self) -> bool:
        """Whether the die meets the recipe's tolerance."""
        return self.status == Status.CONVERGED.name.lower()

    @property
    def error_before(self) -> float:
        """Largest of |p - q| and of the probabilities of all other rests, of the surface that a
        concave die was made from. Raises InputError: it was not made from one."""
        if self.concave is None:
            raise InputError(
                f"{self.name}: expected a die that keeps the shape of a surface, got another; take "
                "one of method: concave"
            )
        before = np.array(self.concave.probabilities_before)
        off = float(np.abs(before - np.array(self.target)).max())
        return max(off, self.concave.elsewhere_before)

    @property
    def printed_probabilities(self) -> Numbers:
        """(k,) by the file that is printed: die.stl where its probabilities are known, else
        die_plain.stl."""
        return (self.engraved and self.engraved.probabilities) or self.probabilities

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
        search = None if self.search is None else self.search.without_clock()
        return dataclasses.replace(
            self,
            history=history,
            search=search,
            stages=(),
            peak_since="start",
        )

    def json_text(self) -> str:
        """The content of result.json."""
        return json_text(plain(dataclasses.replace(self, folder=None)))
