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
from dicedesign.results.status import Status
from dicedesign.runtime.clock import Clock

if TYPE_CHECKING:
    from dicedesign.fabricate.designed_die import DesignedDie, SizedDie
    from dicedesign.fabricate.finished_die import EngravedFile
    from dicedesign.fabricate.label_reading import Reading
    from dicedesign.fabricate.verdict import Verdict
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.repair.repair import RepairedMesh
    from dicedesign.geometry.surfaces.quality import SurfaceQuality
    from dicedesign.geometry.surfaces.surface import Surface
    from dicedesign.optimize.refinement.rounds import Round
    from dicedesign.optimize.starts.start import Start
    from dicedesign.results.record import Result, Step
    from dicedesign.runtime.arrays import Floats
    from dicedesign.throws.simulation.die_on_table import ThrownDie

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
    details: fields of `Result` that stages found beside what is here; other names go into its
        `extra`, as plain data.
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
    die: DesignedDie = field(init=False)
    solid: SizedDie = field(init=False)
    plain: Verdict = field(init=False)
    engraved: EngravedFile | None = None
    reading: Reading | None = None
    quality: SurfaceQuality | None = None
    thrown: ThrownDie | None = None
    status: Status = Status.CONVERGED
    remarks: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)
    kept: str = ""
    images: dict[str, bytes] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clock = Clock(on_stage=self.listeners.on_stage)

    def copy(self) -> Work:
        """The same so far; what stages do to one from here on the other does not see."""
        twin = copy.copy(self)
        twin.clock = dataclasses.replace(self.clock, stages=list(self.clock.stages))
        for name in ("remarks", "notes", "details", "images", "files"):
            setattr(twin, name, copy.copy(getattr(self, name)))
        return twin

    @property
    def target(self) -> Target:
        """What is wanted."""
        return self.recipe.target.target()

    def result(self) -> Result:
        """What has been found out, once the die is checked; complete after the last stage."""
        from dicedesign.results.record import Result, StageTime

        verdict, die, target = self.plain, self.die, self.target
        fields = {field.name for field in dataclasses.fields(Result)}
        extra = {name: value for name, value in self.details.items() if name not in fields}
        known = {name: value for name, value in self.details.items() if name in fields}
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
            reading=self.reading.sentence if self.engraved and self.reading else None,
            history=die.steps,
            notes=tuple(self.notes),
            energy=None if die.terms is None else dict(die.terms),
            starts=die.starts,
            evaluations=die.evaluations,
            hulls=die.hulls,
            files=self._files_by_kind(),
            stages=tuple(StageTime(**stage) for stage in self.clock.stages),
            peak_since=self.clock.peak_since,
            folder=self.folder,
            extra=extra,
            **verdict.odds(),
            **known,
        )
        return result if self.recipe.clock else result.without_clock()

    def _files_by_kind(self) -> dict[str, str]:
        """Names of the files that are there or will be, by what they are."""
        from dicedesign.results.folder import PAGE, RECIPE
        from dicedesign.results.record import RESULT

        if self.folder is None:
            return {}
        page = [PAGE] if self.recipe.report else []
        names = dict.fromkeys([*sorted(self.files), RECIPE, *page, RESULT])
        # A solid is known by its STL, and other files called like it by their whole names.
        known = {Path(name).stem: name for name in sorted(names, key=_is_stl)}
        return {stem if known[stem := Path(name).stem] == name else name: name for name in names}
