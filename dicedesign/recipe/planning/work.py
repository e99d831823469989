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
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.parts import Status
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
    from dicedesign.results.parts import Concave, Printability, Search, ThrownOdds
    from dicedesign.results.result import (
        Balance,
        Engraved,
        InfillOdds,
        Inside,
        PrintTolerances,
        Result,
        Step,
    )
    from dicedesign.runtime.arrays import Floats
    from dicedesign.throws.simulation import ThrownDie

__all__ = ["Listeners", "Work"]


def _is_stl(name: str) -> bool:
    return name.endswith(".stl")


def _ignore(*_: Any) -> None:
    pass


@dataclass(frozen=True)
class Listeners:
    """Who is told of progress.

    Attributes
    ----------
    on_stage: the name of each stage as it begins.
    on_step: each accepted step of the design.
    on_round: each round of throws.
    on_attempt: how far the search for a concave die came, in words, before the first attempt and
        after each.
    on_start: how many starting shapes of a convex die have been looked for, before each.
    on_shape: the hull of a convex die and the directions (k, 3) of its outcomes, in the order of
        the target, before `on_step` is told of the step that led there.

    What a listener raises ends the run.
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
    listeners: who is told of progress.
    enlarge: where the labels do not fit at the recipe's size, take one at which they do.
    resume: go on from the checkpoint of an interrupted search.
    clock: what the stages took.
    start, surface: what the design begins with, a shape or a surface; neither where it searches.
    repaired: the mesh that the surface is of, where it was repaired.
    die: as designed; solid: the same in mm; plain: the verdict on its file. There once their stages
        have run.
    engraved: the file with labels cut in, or None.
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

    def result(self) -> Result:
        """What has been found out, once the die is checked; complete after the last stage."""
        from dicedesign.rest.asymmetry import asymmetry
        from dicedesign.results.result import Designed, Result, StageTime

        verdict, die, target = self.plain, self.die, self.target
        result = Result(
            name=self.recipe.name,
            status=self.status.name.lower(),
            message="; ".join(self.remarks),
            labels=target.labels,
            target=tuple(target.probabilities.tolist()),
            center_of_mass=tuple(verdict.poses.center_of_mass.tolist()),
            facets=verdict.facets,
            unstable_facets=len(verdict.poses.hull.normals) - len(verdict.poses.facets),
            rest_counts=tuple(verdict.outcomes.rest_counts.tolist()),
            least_angle_deg=math.degrees(verdict.outcomes.least_angle),
            least_margin_deg=math.degrees(verdict.margins.min()),
            asymmetry=asymmetry(verdict.poses),
            history=die.steps,
            design=Designed(
                max_abs_error=self.design_error,
                energy=None if die.terms is None else dict(die.terms),
                starts=die.starts,
                evaluations=die.evaluations,
                hulls=die.hulls,
            ),
            engraved=self._engraved(),
            prior=self.recipe.prior,
            inside=self.inside,
            concave=self.concave,
            search=self.search,
            thrown=self.throws,
            printability=self.printability,
            tolerances=self.tolerances,
            infill=self.infill,
            notes=tuple(self.notes),
            files=self._files_by_kind(),
            stages=tuple(StageTime(**stage) for stage in self.clock.stages),
            peak_since=self.clock.peak_since,
            folder=self.folder,
            extra=self.extra,
            **verdict.as_fields(),
        )
        return result if self.recipe.clock else result.without_clock()

    @property
    def design_error(self) -> float:
        """Largest |p - q| as designed, by the probabilities that the method is about."""
        if self.recipe.method.thrown:
            return self.die.error
        return self.solid.outcomes.max_abs_error(self.target.probabilities)

    def _engraved(self) -> Engraved | None:
        made = self.engraved
        if made is None:
            return None
        measured = {} if made.assessment is None else made.assessment.as_fields()
        reading = None if self.reading is None else self.reading.sentence
        from dicedesign.results.result import Engraved

        return Engraved(**measured, reading=reading, balance=self.balance)

    def _files_by_kind(self) -> dict[str, str]:
        """Names of the files that are there or will be, by what they are."""
        from dicedesign.results.folder import PAGE, RECIPE
        from dicedesign.results.result import RESULT

        if self.folder is None:
            return {}
        page = [PAGE] if self.recipe.report else []
        names = dict.fromkeys([*sorted(self.files), RECIPE, *page, RESULT])
        # A solid is known by its STL, and other files called like it by their whole names.
        known = {Path(name).stem: name for name in sorted(names, key=_is_stl)}
        return {stem if known[stem := Path(name).stem] == name else name: name for name in names}
