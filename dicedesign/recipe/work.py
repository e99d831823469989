"""What the stages of a run hand on to each other."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.optimize.targets import Target
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.folder import PAGE, RECIPE
from dicedesign.results.parts import (
    Concave,
    Printability,
    Search,
    Status,
    ThrownOdds,
)
from dicedesign.results.result import (
    RESULT,
    Balance,
    Designed,
    Engraved,
    InfillOdds,
    Inside,
    PrintTolerances,
    Result,
    StageTime,
    Step,
)
from dicedesign.runtime.clock import Clock

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Assessment, Design, Solid
    from dicedesign.fabricate.label_reading import Reading
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.repair.repair import RepairedMesh
    from dicedesign.geometry.surfaces.quality import SurfaceQuality
    from dicedesign.geometry.surfaces.surface import Surface
    from dicedesign.optimize.refinement.rounds import Round
    from dicedesign.optimize.starts.start import Start
    from dicedesign.runtime.arrays import Floats
    from dicedesign.throws.simulation import ThrownDie


def _ignore(*_: Any) -> None:
    pass


@dataclass(frozen=True)
class Listeners:
    """Progress callbacks. What one raises ends the run.

    Attributes
    ----------
    on_stage: takes the name of each stage as it begins.
    on_step: takes each accepted step of the design.
    on_round: takes each round of throws.
    on_attempt: takes how far the search for a concave die came, in words, before the first attempt
        and after each.
    on_start: takes how many starting shapes of a convex die have been looked for, before each.
    on_shape: takes the hull of a convex die and the directions (k, 3) of its outcomes, in the order
        of the target, before `on_step` takes the step that led there.
    """

    on_stage: Callable[[str], None] = _ignore
    on_step: Callable[[Step], None] = _ignore
    on_round: Callable[[Round], None] = _ignore
    on_attempt: Callable[[str], None] = _ignore
    on_start: Callable[[int], None] = _ignore
    on_shape: Callable[[ConvexHull, Floats], None] = _ignore


@dataclass(eq=False)
class Work:
    """One run. A stage reads what stages before it left, and fills in its own.

    Attributes
    ----------
    recipe: the checked recipe; folder: where results go, or None where nothing is written.
    listeners: progress callbacks.
    enlarge: where the labels do not fit at the recipe's size, take one at which they do.
    resume: go on from the checkpoint of an interrupted search.
    clock: what the stages took.
    start, surface: what the design begins with, a shape or a surface; neither where it searches.
    repaired: the mesh that the surface is of, where it was repaired.
    die: as designed; solid: the same in mm; plain: what its file does. There once their stages have
        run.
    engraved: the solid with labels, edges or something inside, or None.
    reading: how its labels are read, or None for no labels.
    quality: of the surface of a die that keeps the shape of one.
    thrown: what the die does on its table.
    status: of the die; remarks: about it, phrases of the message; notes: what was repaired or
        assumed, sentences.
    concave, search, balance, inside, throws, printability, tolerances, infill: sections of `Result`
        that stages found; extra: what stages from outside the package found, plain data by name.
    kept: what an interrupt leaves to go on from, in a sentence; empty for nothing.
    images: figures by name, PNG or GIF; files: contents by the name of the file.
    """

    recipe: Recipe
    folder: Path | None = None
    listeners: Listeners = field(default_factory=Listeners)
    enlarge: bool = False
    resume: bool = False
    clock: Clock = field(init=False)
    start: Start | None = None
    surface: Surface | None = None
    repaired: RepairedMesh | None = None
    die: Design = field(init=False)
    solid: Solid = field(init=False)
    plain: Assessment = field(init=False)
    engraved: Solid | None = None
    reading: Reading | None = None
    quality: SurfaceQuality | None = None
    thrown: ThrownDie | None = None
    status: Status = Status.CONVERGED
    remarks: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    concave: Concave | None = None
    search: Search | None = None
    balance: Balance | None = None
    inside: Inside | None = None
    throws: ThrownOdds | None = None
    printability: Printability | None = None
    tolerances: PrintTolerances | None = None
    infill: InfillOdds | None = None
    extra: dict[str, Any] = field(default_factory=dict)
    kept: str = ""
    images: dict[str, bytes] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clock = Clock(on_stage=self.listeners.on_stage)

    def copy(self) -> Work:
        """The same so far; what stages do to one from here on the other does not see."""
        twin = copy.copy(self)
        twin.clock = dataclasses.replace(self.clock, stages=list(self.clock.stages))
        for name in ("remarks", "notes", "extra", "images", "files"):
            setattr(twin, name, copy.copy(getattr(self, name)))
        return twin

    @property
    def target(self) -> Target:
        """What is wanted."""
        return self.recipe.target.target()

    @property
    def printed(self) -> Assessment:
        """What the file that is printed does: die.stl, where that is known, else die_plain.stl."""
        return (self.engraved and self.engraved.assessment) or self.plain

    @property
    def design_error(self) -> float:
        """Largest |p - q| as designed, by the probabilities that the method is about."""
        if self.recipe.method.thrown:
            return self.die.error
        return self.solid.outcomes.max_abs_error(self.target.probabilities)

    def fail(self, status: Status) -> None:
        """Take back that the die converged, if it did."""
        if self.status is Status.CONVERGED:
            self.status = status
            self.remarks.insert(0, status.value)

    def result(self) -> Result:
        """What has been found out, once the die is checked; complete after the last stage."""
        plain, die, target = self.plain, self.die, self.target
        result = Result(
            name=self.recipe.name,
            status=self.status.name.lower(),
            message="; ".join(self.remarks),
            labels=target.labels,
            target=tuple(target.probabilities.tolist()),
            center_of_mass=tuple(plain.poses.center_of_mass.tolist()),
            facets=plain.facets,
            unstable_facets=len(plain.poses.hull.normals) - len(plain.poses.facets),
            rest_counts=tuple(plain.outcomes.rest_counts.tolist()),
            least_angle_deg=math.degrees(plain.outcomes.least_angle),
            least_margin_deg=math.degrees(plain.margins.min()),
            asymmetry=plain.asymmetry,
            history=die.steps,
            design=Designed(
                max_abs_error=self.design_error,
                energy=None if die.terms is None else dict(die.terms),
                starts=die.starts,
                evaluations=die.evaluations,
                hulls=die.hulls,
            ),
            notes=tuple(self.notes),
            prior=self.recipe.prior,
            engraved=None if self.engraved is None else self._engraved(self.engraved),
            inside=self.inside,
            concave=self.concave,
            search=self.search,
            thrown=self.throws,
            printability=self.printability,
            tolerances=self.tolerances,
            infill=self.infill,
            extra=self.extra,
            files=self._files_by_kind(),
            stages=tuple(StageTime(**stage) for stage in self.clock.stages),
            peak_since=self.clock.peak_since,
            folder=self.folder,
            **plain.as_fields(),
        )
        return result if self.recipe.clock else result.without_clock()

    def _engraved(self, solid: Solid) -> Engraved:
        measured = {} if solid.assessment is None else solid.assessment.as_fields()
        reading = None if self.reading is None else self.reading.sentence
        return Engraved(**measured, reading=reading, balance=self.balance)

    def _files_by_kind(self) -> dict[str, str]:
        """Names of the files that are there or will be, by what they are."""
        if self.folder is None:
            return {}
        page = [PAGE] if self.recipe.report else []
        names = dict.fromkeys([*sorted(self.files), RECIPE, *page, RESULT])
        # A solid is known by its STL, and other files called like it by their whole names.
        known = {Path(name).stem: name for name in sorted(names, key=lambda n: n.endswith(".stl"))}
        return {stem if known[stem := Path(name).stem] == name else name: name for name in names}
