"""Pipeline from a recipe to a folder of results: stages in order, and their shared state."""

from __future__ import annotations

import copy
import math
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from dicedesign.errors import CheckpointError
from dicedesign.optimize.targets import Target
from dicedesign.recipe.callbacks import Callbacks
from dicedesign.recipe.reading import parse_recipe, read_recipe, recipe_text
from dicedesign.recipe.recipe import AUTO, Recipe
from dicedesign.recipe.recipe_files import input_files, output_names
from dicedesign.results.folder import (
    CHECKPOINT,
    PAGE,
    RECIPE,
    open_results_folder,
    write_results,
)
from dicedesign.results.parts import Candidate, Concave, Search, Status, TableResult, ThrowForecast
from dicedesign.results.print_parts import Printability
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
)
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.runtime.workers import one_tensor_thread
from dicedesign.throws.engines import CONTACT_LAW

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Assessment, Design, Solid
    from dicedesign.fabricate.label_reading import Reading
    from dicedesign.geometry.surfaces.quality import SurfaceQuality
    from dicedesign.geometry.surfaces.repair import RepairedMesh
    from dicedesign.geometry.triangles import Surface
    from dicedesign.optimize.starts.start import Start
    from dicedesign.throws.simulation import ThrownDie


@dataclass(eq=False)
class Work:
    """State of one run. Each stage reads results of earlier stages and adds its own.

    Attributes
    ----------
    recipe: checked recipe; folder: results folder, None to write nothing.
    target: labels and target probabilities; with the faces that a stage has chosen, if so.
    callbacks: progress callbacks.
    enlarge: if the labels do not fit at the recipe's size, enlarge the die.
    resume: resume an interrupted search from its checkpoint.
    checkpoint: throws of a die for a table that are finished.
    stages: run times of the stages.
    start, surface: initial shape or surface; None for both if shapes are searched.
    repaired: repaired mesh of the surface, if it needed repair.
    die: designed die; solid: the die in mm; plain: assessment of its file. Set by their stages.
    engraved: solid with labels, edges or something inside, or None.
    reading: way to read the labels, None without labels.
    quality: surface quality of a concave die.
    thrown: the die on its table.
    status: status of the die; remarks: phrases of the message; notes: repairs and assumptions.
    concave, search, balance, inside, throws, printability, tolerances, infill: parts of `Result`.
    forecast: expected frequencies when thrown, None if unknown. candidates: dice with different
        numbers of faces that were compared, the best first; candidate_designs: targets with their
        faces, and designs.
    extra: plain data by name, from stages outside the package.
    resume_note: sentence on how to resume after an interrupt; empty without a checkpoint.
    images: PNG or GIF figures by name; files: contents by file name.
    """

    recipe: Recipe
    folder: Path | None = None
    target: Target = field(init=False)
    callbacks: Callbacks = field(default_factory=Callbacks)
    enlarge: bool = False
    resume: bool = False
    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    stages: list[StageTime] = field(default_factory=list)
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
    throws: TableResult | None = None
    printability: Printability | None = None
    tolerances: PrintTolerances | None = None
    infill: InfillProbabilities | None = None
    forecast: ThrowForecast | None = None
    candidates: tuple[Candidate, ...] = ()
    candidate_designs: tuple[tuple[Target, Design], ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)
    resume_note: str = ""
    images: dict[str, bytes] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.target = self.recipe.target.target()

    def copy(self) -> Work:
        """Independent copy for further stages."""
        twin = copy.copy(self)
        for name in ("stages", "remarks", "notes", "extra", "images", "files"):
            setattr(twin, name, copy.copy(getattr(self, name)))
        return twin

    @property
    def has_free_labels(self) -> bool:
        """Whether faces of a convex die show repeated labels that the recipe has not assigned."""
        is_convex, repeats = self.die.reshaped is None, self.target.has_repeated_labels
        return repeats and is_convex and self.recipe.assignment is None

    @property
    def final(self) -> Assessment:
        """Assessment of die.stl if its probabilities are known, else of die_plain.stl."""
        return (self.engraved and self.engraved.assessment) or self.plain

    @property
    def finished(self) -> Solid:
        """Solid of die.stl if there is one, else of die_plain.stl."""
        return self.engraved or self.solid

    @property
    def stem(self) -> str:
        """File name of the finished die without its ending."""
        return "die_plain" if self.engraved is None else "die"

    @property
    def design_error(self) -> float:
        """Largest |p - q| as designed, by the method's own probability model."""
        if self.recipe.method.is_thrown:
            return self.die.error
        return self.solid.outcomes.max_abs_error(self.target.probabilities)

    @property
    def message(self) -> str:
        """See `describe_verdict`."""
        describe: Callable[[Work], str] = resolve_name("dicedesign.recipe.verdict:describe_verdict")
        return describe(self)

    def fail(self, status: Status) -> None:
        """Replace the status of a converged die."""
        if self.status is Status.CONVERGED:
            self.status = status
            self.remarks.insert(0, status.value)

    def result(self) -> Result:
        """Result of the stages so far, available after the check."""
        plain, die, target, engraved = self.plain, self.die, self.target, None
        facets = plain.facets
        if self.engraved is not None:
            is_read_below = self.reading is not None and self.reading.way == "down"
            facets = self.engraved.mark_facets(facets, -1.0 if is_read_below else 1.0)
            verdict = self.engraved.assessment
            engraved = Engraved(
                **({} if verdict is None else verdict.as_fields()),
                reading=None if self.reading is None else self.reading.sentence,
                balance=self.balance,
            )
        files: dict[str, str] = {}
        if self.folder is not None:
            # All files, including those yet to be written.
            page = [PAGE] if self.recipe.report else []
            names = dict.fromkeys([*sorted(self.files), RECIPE, *page, RESULT])
            # The stem stands for the STL file; other formats go by their whole names.
            ordered = sorted(names, key=lambda name: name.endswith(".stl"))
            by_stem = {Path(name).stem: name for name in ordered}
            kinds = {name: stem for stem, name in by_stem.items()}
            files = {kinds.get(name, name): name for name in names}
        result = Result(
            name=self.recipe.name,
            status=self.status.name.lower(),
            message=self.message,
            labels=target.labels,
            target=tuple(target.probabilities.tolist()),
            center_of_mass=tuple(plain.poses.center_of_mass.tolist()),
            facets=facets,
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
            forecast=self.forecast,
            candidates=self.candidates,
            thrown=self.throws,
            printability=self.printability,
            tolerances=self.tolerances,
            infill=self.infill,
            extra=self.extra,
            files=files,
            stages=tuple(self.stages),
            folder=self.folder,
            **plain.as_fields(),
        )
        return result if self.recipe.clock else result.without_clock()


@dataclass(frozen=True)
class Stage(Extension):
    """One stage of a run.

    Attributes
    ----------
    run: function of the work, or its address "module:function", imported on demand.
    wanted: whether a run needs the stage; called just before it.
    after: name of the preceding stage; None for built-in stages, which run in the order of their
        list, and for a stage that comes last.
    """

    run: Callable[[Work], Any] | str
    wanted: Callable[[Work], bool] = lambda work: True
    after: str | None = None


METHODS = {
    "exact": "dicedesign.recipe.convex:design_exact",
    "candidates": "dicedesign.recipe.candidates:design_candidates",
    "handsome": "dicedesign.recipe.handsome:design_handsome",
    "thrown": "dicedesign.recipe.thrown:design_for_table",
    "paper": "dicedesign.recipe.convex:design_paper",
    "concave": "dicedesign.recipe.concave:design_concave",
}
"""Addresses of the functions that return the `Design` of a `Work`."""


def _load_method(work: Work) -> Callable[[Work], Any]:
    """Import the function of the recipe's method, and torch with it."""
    # Some hulls need it; import it outside the time of the design.
    import_module("dicedesign.geometry.hulls.numpy_hull")
    if work.folder is not None:
        # What later stages need is missed before the design, not after it.
        if work.recipe.engrave is not None:
            import_module("dicedesign.recipe.engrave")
        if work.recipe.figures or work.recipe.engrave is not None:
            import_module("matplotlib.figure")
        if len(work.recipe.files) > 1:
            tempfile.gettempdir()
    method = work.recipe.method
    name = "thrown" if method.is_thrown else method.name
    if work.recipe.is_chosen_by_looks:
        name = "candidates" if work.recipe.compares_faces else "handsome"
    solve: Callable[[Work], Any] = resolve_name(METHODS[name])
    return solve


def _run_method(work: Work) -> None:
    with one_tensor_thread():
        work.die = _load_method(work)(work)


STAGES: Registry[Stage] = Registry(
    "stage",
    Stage,
    (
        Stage(
            "start",
            "makes or reads the starting shape, and checks it against the target",
            "dicedesign.recipe.solid:make_start",
        ),
        Stage("load", "loads the solver of the recipe's method, and torch", _load_method),
        Stage(
            "symmetry",
            "finds the symmetry of a die with symmetry: auto",
            "dicedesign.recipe.convex:choose_symmetry",
            lambda work: work.recipe.symmetry == AUTO and not work.recipe.is_chosen_by_looks,
        ),
        Stage(
            "design",
            "runs the recipe's method: exact, paper, concave, or exact for thrown dice",
            _run_method,
        ),
        Stage(
            "numbering",
            "moves labels between equally probable facets: numbers even, equal labels spread",
            "dicedesign.recipe.solid:assign_numbers",
            lambda work: work.recipe.chosen_numbering != "given" or work.has_free_labels,
        ),
        Stage(
            "size",
            "enlarges a die whose labels do not fit, if no size was given",
            "dicedesign.recipe.solid:enlarge",
            lambda work: (
                work.enlarge and work.recipe.engrave is not None and work.die.reshaped is None
            ),
        ),
        Stage(
            "export",
            "scales the die to its size and makes die_plain.stl",
            "dicedesign.recipe.solid:export",
        ),
        Stage(
            "check",
            "reads die_plain.stl back and computes rests, outcomes and the status",
            "dicedesign.recipe.solid:check",
        ),
        Stage(
            "engrave",
            "rounds the edges, cuts the labels in, moves facets until the target is met, makes "
            "die.stl and reads it back",
            "dicedesign.recipe.engrave:engrave",
            lambda work: work.recipe.engrave is not None or work.recipe.edges is not None,
        ),
        Stage(
            "inside",
            "moves the center of mass to the given place by a cavity or infill, and reads "
            "die.stl back",
            "dicedesign.recipe.engrave:fill_inside",
            lambda work: work.recipe.inside is not None,
        ),
        Stage(
            "forecast",
            "computes by the momentum model how the finished die comes up when thrown",
            "dicedesign.recipe.thrown:forecast",
            lambda work: work.recipe.prior is None,
        ),
        Stage(
            "throws",
            "throws the finished die onto its table, with new random numbers",
            "dicedesign.recipe.thrown:throw",
            lambda work: work.recipe.method.is_thrown,
        ),
        Stage(
            "printing",
            "checks printability, finds the best orientation on the print bed and makes "
            "die_oriented.stl",
            "dicedesign.recipe.output:prepare_print",
            lambda work: work.recipe.print is not None,
        ),
        Stage(
            "tolerances",
            "computes how printing errors and infill change the probabilities",
            "dicedesign.recipe.output:find_tolerances",
            # The inside of a self-intersecting surface depends on the slicer.
            lambda work: (
                work.printability is not None and work.printability.file.self_intersections == 0
            ),
        ),
        Stage(
            "files",
            "writes the die in further formats, and reads each back",
            "dicedesign.recipe.output:write_files",
            lambda work: len(work.recipe.files) > 1 and work.folder is not None,
        ),
        Stage(
            "figures",
            "draws the figures of the report, one file each",
            "dicedesign.recipe.output:draw_figures",
            lambda work: work.recipe.figures and work.folder is not None,
        ),
        Stage(
            "report",
            "makes report.html, a single file",
            "dicedesign.recipe.output:write_page",
            lambda work: work.recipe.report and work.folder is not None,
        ),
    ),
    "dicedesign.stages",
)


def run_stages(work: Work, *, after: str | None = None, last: str | None = None) -> None:
    """Run the stages that a recipe needs.

    after: last stage that has run, None for none; last: final stage to run, None for all. Raises
    errors of the stages: `DiceError`s, and KeyboardInterrupt.
    """
    stages: list[Stage] = []
    for stage in STAGES:
        place = len(stages)
        if stage.after is not None:
            # Behind stages that were registered earlier for this place.
            name = STAGES[stage.after].name
            place = 1 + max(k for k, one in enumerate(stages) if name in (one.name, one.after))
        stages.insert(place, stage)
    first = 0 if after is None else stages.index(STAGES[after]) + 1
    end = len(stages) if last is None else stages.index(STAGES[last]) + 1
    for stage in stages[first:end]:
        if stage.wanted(work):
            work.callbacks.on_stage(stage.name)
            started = time.perf_counter()
            (resolve_name(stage.run) if isinstance(stage.run, str) else stage.run)(work)
            work.stages.append(StageTime(stage.name, round(time.perf_counter() - started, 4)))


def run(
    recipe: Recipe | Mapping[str, Any] | Path | str,
    out: Path | str | None = None,
    *,
    changes: Sequence[str] = (),
    enlarge: bool = False,
    resume: bool = False,
    callbacks: Callbacks | None = None,
    inputs: Sequence[Path] = (),
) -> Result:
    """Design, check, engrave and report one die, and write the results.

    Files are written when the die is finished, each whole or not at all, and result.json last: a
    folder with it is complete. Before that, a concave die writes a checkpoint after each attempt,
    and a die with `refine` its throws. A die that did not converge and cannot be labeled has no
    die.stl.

    Parameters
    ----------
    recipe: checked recipe, plain data as in a recipe file, or path of a recipe file.
    out: results folder, made if missing; None for outputs/NAME.
    changes: texts "dotted.key=value" that change entries of a file.
    enlarge: if the labels do not fit at the recipe's size, take the smallest whole number of
        millimeters at which they do, and write it into the recipe.
    resume: resume from the checkpoint in the folder.
    callbacks: progress callbacks.
    inputs: files that must stay, besides those that the recipe names.

    Raises
    ------
    InputError: the recipe is invalid, the start does not suit the target, there is nothing to
        resume, a label does not fit a converged die, another run writes into the folder, or it has
        files of the same names that no earlier run has written.
    OutputError: the folder cannot be written.
    KeyboardInterrupt: its message says how to resume, or that the results were complete.
    """
    if isinstance(recipe, str | Path):
        inputs = [*inputs, Path(recipe)]
        recipe = read_recipe(Path(recipe), changes)
    elif isinstance(recipe, Mapping):
        recipe = parse_recipe(recipe)
    is_refined = getattr(recipe.method.exact, "refine", None) is not None
    if resume and recipe.method.concave is None and not is_refined:
        raise CheckpointError(
            "--resume: expected a recipe of method: {concave: {}} or with method.exact.refine, got "
            f"{recipe.method.name}, which keeps no checkpoint; leave it out"
        )
    folder = Path("outputs") / recipe.folder_name if out is None else Path(out)
    work = Work(recipe, folder, callbacks or Callbacks(), enlarge, resume)
    path = folder / CHECKPOINT if is_refined else None
    about = {"recipe": recipe_text(recipe), "contact law": CONTACT_LAW}
    with (
        open_results_folder(folder, output_names(recipe, folder), [*inputs, *input_files(recipe)]),
        Checkpoint(path, about, resume=resume) as work.checkpoint,
    ):
        try:
            run_stages(work)
            work.checkpoint.save()
            return finish(work)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(str(interrupt) or work.resume_note) from interrupt


def finish(work: Work) -> Result:
    """Write the files of a run after its last stage. Raises InputError and OutputError."""
    assert work.folder is not None
    work.files[RECIPE] = recipe_text(work.recipe).encode("utf-8")
    return write_results(work.folder, work.files, work.result())
