"""Result of a run, the content of result.json.

Each attribute of `Result` is a key; optional ones that are None are omitted.
Probabilities are in the order of the labels, lengths in millimeters unless they are called
relative, angles in degrees.
"""

from __future__ import annotations

import csv
import dataclasses
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import InputError
from dicedesign.results.parts import (
    READINGS,
    Candidate,
    Concave,
    Numbers,
    Search,
    Status,
    TableResult,
    ThrowForecast,
)
from dicedesign.results.print_parts import Printability
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.csv_cells import guard_cell
from dicedesign.runtime.files import json_text, plain
from dicedesign.runtime.outputs import file_checksum

if TYPE_CHECKING:
    from dicedesign.notebook import Solid

RESULT = "result.json"
"""Name of the file, written last: a folder with it is complete."""


@dataclass(frozen=True)
class FacetOfDie:
    """Facet on which the die can rest.

    Attributes
    ----------
    label: label of the outcome whose main facet it is, or None; outcome: label of the outcome that
        it counts for, or None. They differ if several nearly coplanar facets share an outcome.
    normal: (3,) outward unit normal, which points down in the rest.
    probability: probability of the rest without momentum.
    polygon_area_mm2: area. inradius_mm: radius of the largest circle in the facet.
    margin_deg: tilt that leaves the rest over the nearest saddle.
    border_deg: smallest angle from the normal to the border of the basin.
    upright: (3,) direction in which the label that is read at this rest is upright; None if it has
        none on a flat face.
    """

    label: str | None
    outcome: str | None
    normal: Numbers
    probability: float
    polygon_area_mm2: float
    inradius_mm: float
    margin_deg: float
    border_deg: float
    upright: Numbers | None = None


@dataclass(frozen=True)
class Step:
    """Accepted step of a design.

    Attributes
    ----------
    step: number of the step; 0 is the start. seconds: time since the start; None without a clock.
    energy: minimized energy; terms: its terms by name, each times its weight. For convex dice they
        are in the unit of eq. 12, so weights of a recipe are divided by (4 pi)^2 first. The exact
        method has "dice", and "preferences" while it improves the die.
    max_abs_error: largest |p - q|, or None if unknown.
    stage, attempt: of a concave die: "hull", "fill" or "balance", each with its own energy, and the
        number of the attempt.
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
    """Numbers of convex hulls of a design: built from scratch, and reused with moved vertices."""

    built: int
    reused: int


@dataclass(frozen=True)
class Designed:
    """Die as designed, before its coordinates are rounded to single precision.

    Attributes
    ----------
    max_abs_error: largest |p - q|, by the method's own probability model.
    energy: terms of the final energy, by name.
    starts: number of starting shapes; evaluations: number of evaluated dice; hulls: their hulls.
    """

    max_abs_error: float
    energy: dict[str, float] | None = None
    starts: int | None = None
    evaluations: int | None = None
    hulls: HullCounts | None = None


@dataclass(frozen=True)
class Balance:
    """Adjustment of the finished die, with its labels and edges, to its target.

    Attributes
    ----------
    by: "shape", "opposite", "fill" or "none", as in a recipe's `engrave`.
    unbalanced: (k,) probabilities with labels and edges before the adjustment; for a thrown die by
        the momentum model.
    errors: largest |p - q| in each round, in double precision; the first belongs to `unbalanced`,
        the smallest to the die.
    moved_mm: largest distance from a corner of the plain shape to its moved facet planes.
    stretch: largest relative change of a length, if the die was stretched.
    """

    by: str
    unbalanced: Numbers
    errors: Numbers
    moved_mm: float
    stretch: float | None = None


@dataclass(frozen=True)
class Engraved:
    """Die with labels, rounded edges, or something inside.

    Attributes
    ----------
    probabilities, elsewhere, max_abs_error: as in `Result`, of die.stl; None if the center of mass
        was given without `inside`, as the effect of marks on it is then unknown.
    reading: how to read the labels, in a sentence.
    balance: adjustment to the target.
    """

    probabilities: Numbers | None = None
    elsewhere: float | None = None
    max_abs_error: float | None = None
    reading: str | None = None
    balance: Balance | None = None


@dataclass(frozen=True)
class Inside:
    """Cavity or infill, measured in the files.

    Attributes
    ----------
    by: "cavity" or "infill", as in a recipe's `inside`.
    shift_mm: distance from the center of mass of the uniform solid to the given one; off_mm: from
        the given one to the center of mass of the files.
    wall_mm: minimum wall thickness; None if nothing is inside.
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
    """Deviations of printed dice from the target.

    Attributes
    ----------
    answer: required print accuracy for a test of `rolls` rolls, or what comes up, in a sentence.
    rolls: number of rolls of the test.
    allowed_mm: standard deviation of the positions of facets, or of the surface, at which the test
        rejects one print in ten; 0 if it rejects more even for perfect prints, None if it never
        does.
    noticed: share of prints with the assumed errors that the test rejects; 0.05 for perfect prints.
    assumed: standard deviations of the errors, see `PrintErrors`.
    deviations: (k,) standard deviations of the outcomes' probabilities over prints.
    by_error: deviations from each error alone, by the names in `assumed`, and from "layers".
    mean: (k,) mean probabilities over prints; elsewhere: mean probability of other rests.
    total_variation: mean total variation of prints from the target; nine_in_ten: that which nine in
        ten prints do not exceed.
    """

    answer: str
    rolls: int
    allowed_mm: float | None
    noticed: float
    assumed: dict[str, float]
    deviations: Numbers
    by_error: dict[str, Numbers]
    mean: Numbers
    elsewhere: float
    total_variation: float
    nine_in_ten: float


@dataclass(frozen=True)
class InfillProbabilities:
    """Die with solid walls and sparse infill.

    Attributes
    ----------
    infill, walls_mm: infill density from 0 to 1, and wall thickness.
    advice: effect on the probabilities and recommended infill, in a sentence.
    probabilities, elsewhere, max_abs_error: probabilities of the print without momentum.
    mass: mass relative to the solid die.
    shift_mm: (3,) shift of the center of mass.
    least_infill: smallest infill that a test of 1,000 rolls rejects in at most one print of ten; 1
        if only a solid die passes.
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
    """Wall-clock seconds of a stage."""

    name: str
    seconds: float


@dataclass(frozen=True)
class Result:
    """Result of a run.

    Attributes
    ----------
    name: name of the recipe.
    status: name of a `Status` in small letters; only "converged" means success.
    message: verdict in one sentence, and a second line with status and remarks.
    labels: labels of the k outcomes; target: (k,) target probabilities.
    probabilities: (k,) probabilities of the outcomes without momentum, of die_plain.stl.
    elsewhere: total probability of all rests without an outcome.
    max_abs_error: largest |p - q|.
    center_of_mass: (3,) in the coordinates of the file.
    facets: resting facets, the most probable first; unstable_facets: number of other facets.
    rest_counts: (k,) number of rests of each outcome.
    least_angle_deg: smallest angle between two outcomes' facets; 180 with one outcome.
    least_margin_deg: smallest tilt that leaves an outcome; 180 if none can be left.
    asymmetry: rho of eq. 20 and 21.
    prior: prior of the recipe, which holds for all its probabilities; None for the uniform one.
    history: accepted steps; after rounds of throws, steps of the last design.
    design: die as designed. engraved: die with labels, edges or something inside, or None. inside:
        cavity or infill of the recipe's `inside`.
    concave: section of a concave die; search: its search.
    forecast: expected frequencies when thrown, by the momentum model; None under a prior.
    candidates: dice with different numbers of faces that were compared, the best first.
    thrown: of a die for thrown probabilities, these on its table.
    printability: printability and best orientation.
    tolerances: deviations of printed dice. infill: probabilities with the recipe's infill, None for
        a solid print.
    notes: repairs and assumptions, one sentence each.
    extra: plain data by name, from stages outside the package.
    files: file names by kind; sha256: hexadecimal checksum of each file but result.json, by name.
    stages: run times, empty without a clock.
    folder: folder of the files, None if nothing was written; not in result.json.
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
    forecast: ThrowForecast | None = None
    candidates: tuple[Candidate, ...] = ()
    thrown: TableResult | None = None
    printability: Printability | None = None
    tolerances: PrintTolerances | None = None
    infill: InfillProbabilities | None = None
    extra: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    sha256: dict[str, str] = field(default_factory=dict)
    stages: tuple[StageTime, ...] = ()
    folder: Path | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        return f"<Result {self.name}: {self.status}, {self.message}>"

    def _repr_html_(self) -> str:
        """HTML of the printed die to turn and a table of its outcomes, for notebooks."""
        name = self.files.get("die", self.files.get("die_plain", ""))
        path = (self.folder or Path()) / name
        return self.html_of(path if path.is_file() else None)

    def html_of(self, solid: Solid | None) -> str:
        """HTML of a solid, the die, beside a table of its outcomes."""
        from dicedesign.notebook import solid_and_table

        # A facet has the color of the label on it.
        is_read_on_top = self.engraved is not None and self.engraved.reading == READINGS["up"]
        normals = np.array([facet.normal for facet in self.facets])
        percents = [map("{:.4%}".format, values) for values in (self.probabilities, self.target)]
        return solid_and_table(
            solid,
            -normals if is_read_on_top else normals,
            [[*self.labels, facet.outcome].index(facet.outcome) for facet in self.facets],
            self.message,
            ("outcome", "probability", "target"),
            list(zip(self.labels, *percents, strict=True)),
        )

    @property
    def converged(self) -> bool:
        """Whether the die meets the recipe's tolerance."""
        return self.status == Status.CONVERGED.name.lower()

    @property
    def is_warned(self) -> bool:
        """Whether the die meets its target when set down, but not when thrown."""
        if not self.converged or self.thrown is not None or self.forecast is None:
            return False
        return self.forecast.is_off(self.target)

    @property
    def error_before(self) -> float:
        """Error of the original surface of a concave die: largest |p - q|, or the total
        probability of other rests. Raises InputError for another die."""
        if self.concave is None:
            raise InputError(
                f"{self.name}: expected a concave die, got a convex one; take a result of "
                "method: concave"
            )
        before = np.array(self.concave.probabilities_before)
        off = float(np.abs(before - np.array(self.target)).max())
        return max(off, self.concave.elsewhere_before)

    @property
    def printed_probabilities(self) -> Numbers:
        """(k,) probabilities of die.stl if they are known, else of die_plain.stl."""
        return (self.engraved and self.engraved.probabilities) or self.probabilities

    @property
    def outcome_normals(self) -> tuple[tuple[str, Floats], ...]:
        """Outcome label and normal (3,) of each facet with an outcome."""
        return tuple(
            (facet.outcome, np.array(facet.normal))
            for facet in self.facets
            if facet.outcome is not None
        )

    def changes(self) -> list[str]:
        """Files of the folder that are missing, or not as the run has written them, a sentence
        each."""
        if self.folder is None:
            return []
        paths = {self.folder / name: listed for name, listed in self.sha256.items()}
        return [
            f"{path}: expected the file that the run has written, got "
            f"{'another' if path.exists() else 'none'}; run the recipe again"
            for path, listed in paths.items()
            if file_checksum(path) != listed
        ]

    @property
    def plain_file(self) -> Path:
        """Path of the solid without labels. Raises InputError if nothing was written."""
        if "die_plain" not in self.files:
            raise InputError(
                f"{self.name}: expected a die that was written to a folder, got one that was only "
                "designed; write it with its report(folder)"
            )
        return (self.folder or Path()) / self.files["die_plain"]

    def history_csv(self) -> str:
        """CSV of the history: a row for each accepted step, with columns step, seconds, stage,
        attempt, energy and max_abs_error, and one for each term of the energy. What is unknown is
        empty; numbers are exact."""
        names = dict.fromkeys(name for step in self.history for name in step.terms)
        columns = ("step", "seconds", "stage", "attempt", "energy", "max_abs_error")
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([*columns, *map(guard_cell, names)])
        for step in self.history:
            terms = (step.terms.get(name) for name in names)
            known = (guard_cell(getattr(step, name)) for name in columns)
            writer.writerow([*known, *terms])
        return text.getvalue()

    def without_clock(self) -> Result:
        """Copy without run times, so that equal runs compare equal."""
        history = tuple(dataclasses.replace(step, seconds=None) for step in self.history)
        search = None if self.search is None else self.search.without_clock()
        return dataclasses.replace(
            self,
            history=history,
            search=search,
            stages=(),
        )

    def json_text(self) -> str:
        """Content of result.json."""
        return json_text(plain(dataclasses.replace(self, folder=None)))
