"""The way from a recipe to a folder of results: the stages of a run, in order, and what they hand
on to each other."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, Context
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import InputError
from dicedesign.optimize.targets import Target
from dicedesign.recipe.reading import parse_recipe, read_recipe, recipe_text
from dicedesign.recipe.recipe import AUTO, Recipe
from dicedesign.results.folder import PAGE, RECIPE, open_results_folder, write_results
from dicedesign.results.parts import (
    Concave,
    Printability,
    Search,
    Status,
    ThrowProbabilities,
)
from dicedesign.results.result import (
    RESULT,
    Balance,
    Designed,
    Engraved,
    InfillProbabilities,
    Inside,
    PrintTolerances,
    Result,
    StageTime,
    Step,
)
from dicedesign.runtime.clock import Clock
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.runtime.workers import one_tensor_thread

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Assessment, Design, Solid
    from dicedesign.fabricate.label_layout import Reading
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.surfaces.quality import SurfaceQuality
    from dicedesign.geometry.surfaces.repair import RepairedMesh
    from dicedesign.geometry.triangles import Surface
    from dicedesign.optimize.starts.start import Start
    from dicedesign.results.parts import RoundOfThrows
    from dicedesign.runtime.arrays import Floats
    from dicedesign.throws.simulation import ThrownDie


def _ignore(*_: Any) -> None:
    pass


@dataclass(frozen=True)
class Callbacks:
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
    on_round: Callable[[RoundOfThrows], None] = _ignore
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
    callbacks: Callbacks = field(default_factory=Callbacks)
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
    throws: ThrowProbabilities | None = None
    printability: Printability | None = None
    tolerances: PrintTolerances | None = None
    infill: InfillProbabilities | None = None
    extra: dict[str, Any] = field(default_factory=dict)
    kept: str = ""
    images: dict[str, bytes] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clock = Clock(on_stage=self.callbacks.on_stage)

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

    @property
    def message(self) -> str:
        """Verdict in one sentence, followed by status and remarks."""
        thrown = self.recipe.method.thrown
        subject = "By the momentum model the die" if thrown else "The file"
        error = self.design_error if thrown else self.printed.max_abs_error
        # In percent, rounded up to one digit, without an exponent.
        percent = Context(prec=1, rounding=ROUND_CEILING).create_decimal(100.0 * error)
        flaw, _, _ = self.status.value.partition(";")
        if self.status is Status.CONVERGED:
            verdict = f"{subject} has your probabilities: off by at most {percent:f} %."
        elif error <= self.recipe.method.tolerance:
            verdict = f"{subject} has your probabilities, but {flaw}."
        else:
            verdict = f"{subject} does not have your probabilities: off by up to {percent:f} %."
        return f"{verdict} ({self.status.name.lower()}: {'; '.join(self.remarks)})"

    def fail(self, status: Status) -> None:
        """Replace the status of a converged die."""
        if self.status is Status.CONVERGED:
            self.status = status
            self.remarks.insert(0, status.value)

    def result(self) -> Result:
        """What has been found out, once the die is checked; complete after the last stage."""
        plain, die, target, engraved = self.plain, self.die, self.target, None
        if self.engraved is not None:
            verdict = self.engraved.assessment
            engraved = Engraved(
                **({} if verdict is None else verdict.as_fields()),
                reading=None if self.reading is None else self.reading.sentence,
                balance=self.balance,
            )
        result = Result(
            name=self.recipe.name,
            status=self.status.name.lower(),
            message=self.message,
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
            engraved=engraved,
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

    def _files_by_kind(self) -> dict[str, str]:
        """Names of the files that are there or will be, by what they are."""
        if self.folder is None:
            return {}
        page = [PAGE] if self.recipe.report else []
        names = dict.fromkeys([*sorted(self.files), RECIPE, *page, RESULT])
        # A solid is known by its STL, and other files called like it by their whole names.
        known = {Path(name).stem: name for name in sorted(names, key=lambda n: n.endswith(".stl"))}
        return {stem if known[stem := Path(name).stem] == name else name: name for name in names}


@dataclass(frozen=True)
class Stage(Extension):
    """One stage of a run.

    Attributes
    ----------
    run: does its work, or the address "module:function" of what does, imported when it is wanted.
    wanted: whether a run needs it, asked when its turn comes.
    after: name of the stage that it follows; None for the built-in ones, whose order is that of
        their list, and for one that comes last.
    """

    run: Callable[[Work], Any] | str
    wanted: Callable[[Work], bool] = lambda work: True
    after: str | None = None


METHODS: Final = {
    "exact": "dicedesign.recipe.convex:design_exact",
    "thrown": "dicedesign.recipe.thrown:design_for_table",
    "paper": "dicedesign.recipe.convex:design_paper",
    "concave": "dicedesign.recipe.concave:design_concave",
}
"""Addresses of the functions that make a `Design` of a `Work`."""


def _load_method(work: Work) -> Callable[[Work], Any]:
    """The function of the recipe's method; its module brings torch along."""
    # Searches meet bodies whose hulls need it, and the time of a design is not that of loading.
    import_module("dicedesign.geometry.hulls.numpy_hull")
    method = work.recipe.method
    return _load(METHODS["thrown" if method.thrown else method.name])


def _run_method(work: Work) -> None:
    with one_tensor_thread():
        work.die = _load_method(work)(work)


STAGES: Final[Registry[Stage]] = Registry(
    "stage",
    Stage,
    (
        Stage(
            "start",
            "makes or reads the starting shape, and checks that it suits the target",
            "dicedesign.recipe.solid:make_start",
        ),
        Stage(
            "load",
            "loads the solver of the recipe's method, and torch with it, if that is not there yet",
            _load_method,
        ),
        Stage(
            "symmetry",
            "finds the symmetry of a die whose recipe leaves it open",
            "dicedesign.recipe.convex:choose_symmetry",
            lambda work: work.recipe.symmetry == AUTO,
        ),
        Stage(
            "design",
            "runs the recipe's method: exact, paper, concave, or exact for thrown dice",
            _run_method,
        ),
        Stage(
            "numbering",
            "lets equally probable outcomes change places, so that the numbers suit the shape",
            "dicedesign.recipe.solid:number",
            lambda work: work.recipe.numbering != "given",
        ),
        Stage(
            "size",
            "enlarges a die whose labels do not fit, where no size was given",
            "dicedesign.recipe.solid:enlarge",
            lambda work: (
                work.enlarge and work.recipe.engrave is not None and work.die.reshaped is None
            ),
        ),
        Stage(
            "export",
            "brings the die to its size and makes die_plain.stl",
            "dicedesign.recipe.solid:export",
        ),
        Stage(
            "check",
            "reads die_plain.stl back: its rests, their outcomes, and the verdict",
            "dicedesign.recipe.solid:check",
        ),
        Stage(
            "engrave",
            "rounds the edges, cuts the labels in, leads the die to its target with both, "
            "makes die.stl and reads it back",
            "dicedesign.recipe.engrave:engrave",
            lambda work: work.recipe.engrave is not None or work.recipe.edges is not None,
        ),
        Stage(
            "inside",
            "puts the center of mass where it was given, by a cavity or infill, and reads "
            "die.stl back",
            "dicedesign.recipe.engrave:fill_inside",
            lambda work: work.recipe.inside is not None,
        ),
        Stage(
            "throws",
            "throws the printed die onto its table, with fresh random numbers",
            "dicedesign.recipe.thrown:throw",
            lambda work: work.recipe.method.thrown,
        ),
        Stage(
            "printing",
            "says what the printer will not make and how the die lies best on its bed; makes "
            "die_oriented.stl",
            "dicedesign.recipe.output:prepare_print",
            lambda work: work.recipe.print is not None,
        ),
        Stage(
            "tolerances",
            "finds what errors of printing, and infill, do to the probabilities",
            "dicedesign.recipe.output:find_tolerances",
            # Of a file that meets itself slicers decide what is inside.
            lambda work: (
                work.printability is not None and work.printability.file.self_intersections == 0
            ),
        ),
        Stage(
            "files",
            "writes the die in the other formats that are asked for, and reads each back",
            "dicedesign.recipe.output:write_files",
            lambda work: len(work.recipe.files) > 1 and work.folder is not None,
        ),
        Stage(
            "figures",
            "draws the pictures of the report, each a file of its own",
            "dicedesign.recipe.output:draw_figures",
            lambda work: work.recipe.figures and work.folder is not None,
        ),
        Stage(
            "data sheet",
            "makes data_sheet.pdf and data_sheet.png, one page to print",
            "dicedesign.recipe.output:write_data_sheet",
            lambda work: work.recipe.data_sheet and work.folder is not None,
        ),
        Stage(
            "report",
            "makes report.html, which needs no other file",
            "dicedesign.recipe.output:write_page",
            lambda work: work.recipe.report and work.folder is not None,
        ),
    ),
    "dicedesign.stages",
)


def run_stages(work: Work, *, after: str | None = None, last: str | None = None) -> None:
    """Run the stages that a recipe needs.

    after: the stage that ran last, None to begin; last: the one that ends it, None for all. Raises
    what stages raise: `DiceError`s, and KeyboardInterrupt.
    """
    stages: list[Stage] = []
    for stage in STAGES:
        place = len(stages)
        if stage.after is not None:
            place = stages.index(STAGES[stage.after]) + 1
            # Of several that follow the same one the first registered comes first.
            while place < len(stages) and stages[place].after == stage.after:
                place += 1
        stages.insert(place, stage)
    first = 0 if after is None else stages.index(STAGES[after]) + 1
    end = len(stages) if last is None else stages.index(STAGES[last]) + 1
    for stage in stages[first:end]:
        if stage.wanted(work):
            with work.clock.stage(stage.name):
                (_load(stage.run) if isinstance(stage.run, str) else stage.run)(work)


def _load(address: str) -> Callable[[Work], Any]:
    module, _, name = address.partition(":")
    function: Callable[[Work], Any] = getattr(import_module(module), name)
    return function


def run(
    recipe: Recipe | Mapping[str, Any] | Path | str,
    out: Path | str | None = None,
    *,
    changes: Sequence[str] = (),
    enlarge: bool = False,
    resume: bool = False,
    callbacks: Callbacks | None = None,
) -> Result:
    """Design, check, engrave and report one die, and write what came of it.

    Files are written once the die is finished, each whole or not at all, and result.json last: a
    folder that has it is complete. A concave die alone keeps a checkpoint after each attempt. A die
    that did not converge and cannot be labeled is reported without die.stl.

    Parameters
    ----------
    recipe: a checked one, plain data as in a recipe file, or the path of one.
    out: folder of the results, made if missing; None for outputs/NAME.
    changes: texts "dotted.key=value" that change a file's entries.
    enlarge: where the labels do not fit at the recipe's size, take the smallest whole number of
        millimeters at which they do; the recipe that is written says so.
    resume: go on from the checkpoint of a concave die in the folder.
    listeners: progress callbacks.

    Raises
    ------
    InputError: the recipe cannot be used, the start does not suit the target, there is nothing to
        resume, or the design converged and a label does not fit.
    OutputError: the folder cannot be written. InputError too: another run is writing into it.
    KeyboardInterrupt: with a message about the checkpoint, if there is one, or that the results
        were complete.
    """
    if isinstance(recipe, str | Path):
        recipe = read_recipe(Path(recipe), changes)
    elif isinstance(recipe, Mapping):
        recipe = parse_recipe(recipe)
    if resume and recipe.method.concave is None:
        raise InputError(
            f"--resume: expected a recipe of method: {{concave: {{}}}}, got {recipe.method.name}, "
            "which keeps no checkpoint; leave it out"
        )
    folder = Path("outputs") / recipe.name if out is None else Path(out)
    work = Work(recipe, folder, callbacks or Callbacks(), enlarge, resume)
    with open_results_folder(folder):
        try:
            run_stages(work)
            return finish(work)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(str(interrupt) or work.kept) from interrupt


def finish(work: Work) -> Result:
    """Write the files of a run whose stages are done. Raises OutputError."""
    from dicedesign.fabricate.file_formats import FILE_FORMATS
    from dicedesign.report.figures import FIGURES

    assert work.folder is not None
    work.files[RECIPE] = recipe_text(work.recipe).encode("utf-8")
    checksums = {name: hashlib.sha256(data).hexdigest() for name, data in work.files.items()}
    result = dataclasses.replace(work.result(), sha256=checksums)
    names = [f"{figure.name}{figure.suffix}" for figure in FIGURES]
    names += [f"{stem}.{kind}" for stem in ("die", "die_plain") for kind in FILE_FORMATS.names]
    write_results(work.folder, work.files, result, names)
    return result
