"""Tab "New die": design a die for given probabilities, and download its files."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from dicedesign.errors import DiceError, InputError
from dicedesign.fabricate.file_formats import FILE_FORMATS, file_bytes
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import body_of, make_body
from dicedesign.optimize.options import legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import FEWEST_FACETS, STARTS, StartKind
from dicedesign.palette import BASINS
from dicedesign.recipe.candidates import pick_candidate
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import format_probabilities, parse_recipe, parse_target, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.poses import analyze
from dicedesign.results.result import Result, Step
from dicedesign.runtime.arrays import Floats
from dicedesign.view.page import Job, Page, html_part
from dicedesign.view.viewed_body import Outcomes, ViewedBody, outcomes_of
from dicedesign.view.viewport import Viewport

if TYPE_CHECKING:
    from viser import ClientHandle, GuiEvent

__all__ = ["PRESETS", "NewDiePanel"]

PRESETS = {
    "Two dice in one (2d6)": ("2d6", ""),
    "Two small dice in one (2d4)": ("2d4", ""),
    "Fair, 3 sides": ("d3", ""),
    "Fair, 5 sides": ("d5", ""),
    "Fair, 7 sides": ("d7", ""),
    "Heads of 4 coins (binomial)": ("binomial: 4", ""),
    "A coin that can stand": ("1/2, 1/3, 1/6", "heads, tails, edge"),
    "Loaded: 6 twice as often": ("1:1:1:1:1:2", ""),
    "Yes, no, perhaps": ("45%, 45%, 10%", "yes, no, perhaps"),
}
"""Texts of the fields for probabilities and labels, by title; empty labels are numbers."""

OWN = "Your own"
"""Title in the menu of fields that no preset has."""

FACES = ("auto", "one an outcome", *(str(faces) for faces in range(6, 62, 2)))
"""Choices of the number of faces."""

PURPOSES = {
    "throwing and setting down": "both",
    "throwing": "throwing",
    "setting down": "setting-down",
}

COMPARED = 4
"""Dice that are compared on request."""

METHODS = {"exact": "exact", "the paper's descent": "paper"}

DEFAULT_START = "default of the method"

MIN_SLIDER_RANGE = 2.0
"""A slider reaches at least this, and four times the default of its number."""

STEP_SECONDS = 1.0 / 30.0
"""Least duration of a step, so that it can be seen."""

LAST_ORDER = 1e6
"""Place below all other elements of a tab."""


def verdict_of(result: Result) -> tuple[str, str]:
    """First line of the verdict, all of it if the die failed, and the style of its color."""
    if not result.converged:
        return result.message, "wrong"
    return result.message.splitlines()[0], "warned" if result.is_warned else "right"


class OptionControls:
    """Fields of optional settings, which the next design reads."""

    def __init__(self, page: Page) -> None:
        gui = page.gui
        starts = [kind.name for kind in STARTS if _works_without_options(kind)]
        self._faces = gui.add_dropdown(
            "Faces",
            FACES,
            hint="auto: several an outcome where that makes a better die; one an outcome with a "
            "method, start or preferences of your own",
        )
        self._purpose = gui.add_dropdown("For", tuple(PURPOSES), hint="where it shall be right")
        with gui.add_folder("More", order=LAST_ORDER, expand_by_default=False):
            self._seed = gui.add_text("Seed", "0", hint="another seed gives another shape")
            self._method = gui.add_dropdown(
                "Method",
                tuple(METHODS),
                hint="exact: solves for the probabilities, then improves the preferences below; "
                "the paper's: lowers an energy of the vertices, then solves exactly",
            )
            self._start = gui.add_dropdown("Start", (DEFAULT_START, *starts), hint="starting shape")
            self._prefer = {}
            with gui.add_folder("Preferences", expand_by_default=False):
                for name, number in Preferences.list_numbers().items():
                    value = float(getattr(legible(), name))
                    largest = max(MIN_SLIDER_RANGE, 4.0 * value)
                    self._prefer[name] = gui.add_slider(
                        name.replace("_", " "), 0.0, largest, 0.01, value, hint=number.line
                    )

    def recipe(self, target: dict[str, Any], candidates: int = 1) -> Recipe:
        """Recipe of a target with these options. Raises RecipeError: an entry cannot be used."""
        seed, method = self._seed.value.strip(), METHODS[self._method.value]
        prefer = {name: float(slider.value) for name, slider in self._prefer.items()}
        entries = {
            "name": "die",
            # The recipe refuses any other text.
            "seed": int(seed) if seed.isdecimal() else seed,
            "target": target,
            "method": {method: {"prefer": prefer}},
            "purpose": PURPOSES[self._purpose.value],
            "candidates": candidates,
        }
        faces = self._faces.value
        if faces != "auto":
            entries["faces"] = int(faces) if faces.isdecimal() else "one"
        if self._start.value != DEFAULT_START:
            entries["start"] = {self._start.value: {}}
        elif method == "paper":
            outcomes = len(
                parse_recipe({"name": "die", "target": target}).target.target().face_labels
            )
            entries["start"] = {"repulsion" if outcomes >= FEWEST_FACETS else "prism": {}}
        return parse_recipe(entries)


def _works_without_options(kind: StartKind) -> bool:
    if kind.make is None and kind.search is None:
        return False
    try:
        kind.options()
    except TypeError:
        return False
    return True


def finish_die(
    design: Work,
    *,
    size_mm: float | None = None,
    engrave: bool = True,
    on_stage: Callable[[str], None] = lambda name: None,
) -> Work:
    """Run the stages after the numbering of a design, without files on disk.

    Parameters
    ----------
    design: stays as it is.
    size_mm: largest distance between two corners; None is 30, or more if the labels need it.
    engrave: engrave the labels.
    on_stage: called with the name of each stage at its start.

    Raises InputError: the size is not allowed, or a label does not fit or has no facet.
    """
    entries = design.recipe.as_dict() | {"engrave": engrave}
    if size_mm is not None:
        entries["size_mm"] = size_mm
    work = design.copy()
    work.recipe, work.enlarge = parse_recipe(entries), size_mm is None
    work.callbacks = Callbacks(on_stage=on_stage)
    run_stages(work, after="numbering", last="throws")
    return work


def die_file(work: Work, ending: str) -> tuple[str, bytes]:
    """Name and content of a finished die in one of `FILE_FORMATS`, or of its recipe ("yaml").

    Raises InputError as the format does.
    """
    name = f"{work.recipe.name}.{ending}"
    if ending == "yaml":
        return name, recipe_text(work.recipe).encode()
    if ending == "stl":
        return name, work.files[f"{work.stem}.stl"]
    return name, file_bytes(die_contents(work), FILE_FORMATS[ending], name)


FILES = {"STL": "stl", "3MF": "3mf", "Recipe": "yaml"}
"""Endings of the files, by the titles of their buttons."""


class DownloadControls:
    """Fields and buttons for the files of a die. Use it only in the thread of changes.

    on_printable: called with the finished die once it is ready to print.
    """

    def __init__(self, page: Page, on_printable: Callable[[Work], None]) -> None:
        self._page, self._on_printable = page, on_printable
        self._design: Work | None = None
        self._finished: tuple[tuple[float | None, bool], Work] | None = None
        self._job: Job | None = None
        gui = page.gui
        with gui.add_folder("Print it"):
            self._size = gui.add_text(
                "Size in mm", "", hint="from corner to corner; empty: 30, or what the labels need"
            )
            self._labels = gui.add_checkbox("Cut the labels in", initial_value=True)
            download = gui.add_button_group(
                "Download", tuple(FILES), hint="the recipe makes this die again"
            )
            self._error, self._table = gui.add_html(""), gui.add_html("")
        download.on_click(
            lambda event: page.enqueue(lambda: self._download(event.client, event.target.value))
        )

    def offer(self, design: Work | None) -> None:
        """Offer the files of a finished design; None offers none."""
        self._design, self._finished, self._table.content = design, None, ""

    def _download(self, client: ClientHandle | None, file: str) -> None:
        if self._job is not None and self._job.is_running:
            return
        self._error.content = ""
        design, size = self._design, self._size.value.strip().removesuffix("mm").strip()
        try:
            if design is None:
                raise InputError(
                    "die: expected a design that is done, got one that runs or none; wait, or "
                    "press Design first"
                )
            size_mm = _parse_size(size)
        except InputError as error:
            self._show_error(error)
            return
        key = size_mm, bool(self._labels.value)

        def work(job: Job) -> Work:
            return finish_die(
                design,
                size_mm=size_mm,
                engrave=key[1],
                on_stage=lambda stage: job.progress(f"making the file: {stage}"),
            )

        def on_done(finished: Work) -> None:
            if self._design is design:
                self._finished = key, finished
                result = finished.result()
                self._table.content = html_part("printed", finished, result, *verdict_of(result))
                self._on_printable(finished)
            self._send(client, file, finished)

        if self._finished is not None and self._finished[0] == key:
            self._send(client, file, self._finished[1])
        else:
            self._job = self._page.start(work, on_done, self._show_error)

    def _send(self, client: ClientHandle | None, file: str, finished: Work) -> None:
        try:
            content = die_file(finished, FILES[file])
        except DiceError as error:
            self._show_error(error)
        else:
            self._page.download(client, *content)

    def _show_error(self, error: Exception) -> None:
        if not isinstance(error, DiceError):
            raise error
        self._error.content = html_part("sentence", "file-error", str(error), True)


def _parse_size(text: str) -> float | None:
    """Parse the field of the size in mm. Raises InputError."""
    try:
        return float(text) if text else None
    except ValueError as error:
        raise InputError(
            f"size: expected a number of millimeters, got {text!r}; correct it, or leave it empty"
        ) from error


class NewDiePanel:
    """Tab with the fields, buttons and tables of a design; the viewport shows its shape.

    begins: design the first die of the menu at once.
    """

    def __init__(self, viewport: Viewport, *, begins: bool = False) -> None:
        self._viewport, page = viewport, viewport.page
        self._job: Job | None = None
        self._compared: Work | None = None
        self._shape_body: ViewedBody | None = None
        self._panel_body: ViewedBody | None = None
        probabilities, labels = next(iter(PRESETS.values()))
        self._preset: Any = page.gui.add_dropdown("Die", (*PRESETS, OWN))
        self._probabilities: Any = page.gui.add_text(
            "Probabilities",
            probabilities,
            hint="1/2, 1/3, 1/6; or 50%, 30%, 20%; or d7, 2d6, 4dF, binomial: 4",
        )
        self._labels: Any = page.gui.add_text(
            "Labels", labels, hint="one for each, commas between them; empty: 1, 2, ..."
        )
        self._options = OptionControls(page)
        self._target_error = page.gui.add_html("")
        design = page.gui.add_button("Design", color="blue")
        reset = page.gui.add_button("Reset", hint="discard this die")
        self._state, self._candidates = page.gui.add_html(""), page.gui.add_html("")
        self._compare = page.gui.add_button(
            "Compare others",
            visible=False,
            hint="design dice with other numbers of faces, and list them",
        )
        self._downloads = DownloadControls(page, self._show_printable)
        self._preset.on_update(lambda event: page.enqueue(lambda: self._choose(event), "preset"))
        for text in (self._probabilities, self._labels):
            text.on_update(lambda _: page.enqueue(self._read_recipe, "target"))
        design.on_click(lambda _: page.enqueue(self._design))
        self._compare.on_click(lambda _: page.enqueue(lambda: self._design(COMPARED)))
        page.on_action("pick", self._pick)
        reset.on_click(lambda _: page.enqueue(self._reset))
        viewport.on_show.append(self._copy_target)
        if begins:
            page.enqueue(self._design)

    def _choose(self, event: GuiEvent[Any]) -> None:
        """Design the die that somebody chose in the menu."""
        if event.client is not None and self._preset.value != OWN:
            self._fill(*PRESETS[self._preset.value])
            self._design()

    def _fill(self, probabilities: str, labels: str) -> None:
        self._probabilities.value, self._labels.value = probabilities, labels
        self._read_recipe()

    def _copy_target(self, viewed: ViewedBody) -> None:
        """Fill the fields with the target of another die in view."""
        outcomes = viewed.outcomes
        if viewed is not self._panel_body and outcomes is not None and outcomes.target is not None:
            quoted = (f'"{label}"' if "," in label else label for label in outcomes.labels)
            self._fill(format_probabilities(outcomes.target.tolist()), ", ".join(quoted))

    def _read_recipe(self, candidates: int = 1) -> Recipe | None:
        """Read the fields; return None and show the error if they are not valid."""
        fields = self._probabilities.value, self._labels.value
        self._preset.value = next((name for name in PRESETS if PRESETS[name] == fields), OWN)
        try:
            labels = self._labels.value.strip()
            target = parse_target(self._probabilities.value, labels or None)
            recipe = self._options.recipe(target, candidates)
        except DiceError as error:
            self._target_error.content = html_part("sentence", "target-error", str(error), True)
            return None
        self._target_error.content = ""
        return recipe

    def _design(self, candidates: int = 1) -> None:
        """Design the die of the fields, in place of the current one."""
        recipe = self._read_recipe(candidates)
        if recipe is None:
            return

        def design(job: Job) -> Work:
            starts, steps = 1, 0
            shape: tuple[ConvexHull, Outcomes] | None = None

            def on_start(number: int) -> None:
                nonlocal starts
                job.check()
                starts = number + 1

            def on_shape(hull: ConvexHull, directions: Floats) -> None:
                nonlocal shape
                shape = hull, outcomes_of(work, directions)

            def on_step(_: Step) -> None:
                nonlocal steps
                job.check()
                steps += 1
                if shape is not None:
                    facts = ["designing", *([f"starting shape {starts}"] if starts > 1 else [])]
                    facts.append(f"step {steps}")
                    page.enqueue(partial(self._show, job, facts, *shape), "design")
                time.sleep(STEP_SECONDS)

            def on_part(done: int, whole: int, unit: str) -> None:
                job.progress(f"designing: {done} of {whole} {unit}")

            callbacks = Callbacks(
                on_start=on_start, on_shape=on_shape, on_step=on_step, on_part=on_part
            )
            work = Work(recipe, callbacks=callbacks, enlarge=True)
            run_stages(work, last="design")
            return work

        page = self._viewport.page
        self._start(design)

    def _pick(self, index: int) -> None:
        """Take another of the compared dice."""
        compared = self._compared
        if compared is None or index >= len(compared.candidates):
            return
        work = compared.copy()
        work.recipe = work.recipe.model_copy(update={"pick": index + 1})
        work.callbacks = Callbacks()
        # The note on the die taken before.
        work.notes.pop()
        work.die = pick_candidate(work, index + 1, len(work.candidates))
        self._start(lambda _: work)

    def _start(self, design: Callable[[Job], Work]) -> None:
        """Start a job that designs a die up to its numbering, in place of the current one."""
        self._reset()

        def work(job: Job) -> tuple[Work, Work, Result]:
            compared = design(job)
            numbered = compared.copy()
            run_stages(numbered, after="design", last="numbering")
            plain = numbered.copy()
            run_stages(plain, after="size", last="check")
            run_stages(plain, after="inside", last="forecast")
            return compared, numbered, plain.result()

        def on_done(done: tuple[Work, Work, Result]) -> None:
            self._compared, numbered, result = done
            # The best die may come from an earlier step.
            outcomes = outcomes_of(numbered, numbered.die.directions)
            self._show(job, [], numbered.die.hull, outcomes, result)
            pick = numbered.recipe.pick
            self._candidates.content = html_part("candidates", result.candidates, pick)
            self._compare.visible = len(result.candidates) == 1
            self._downloads.offer(numbered)

        def on_error(error: Exception) -> None:
            self._state.content = html_part("design", "failed", str(error), "wrong")
            if not isinstance(error, DiceError):
                raise error

        self._state.content = html_part("design", "running", "designing", "note")
        self._job = job = self._viewport.page.start(work, on_done, on_error)

    def _reset(self) -> None:
        if self._job is not None:
            self._job.stop()
        self._job, self._compared, self._shape_body = None, None, None
        self._state.content, self._candidates.content, self._compare.visible = "", "", False
        self._downloads.offer(None)

    def _show(
        self,
        job: Job,
        facts: list[str],
        hull: ConvexHull,
        outcomes: Outcomes,
        result: Result | None = None,
    ) -> None:
        """Show the shape and the progress of a job, or its result, unless another one has begun."""
        if job is not self._job:
            return
        body = ViewedBody.of(
            make_body(hull.vertices, name="new die"),
            outcomes=outcomes,
            poses=analyze(hull, hull.centroid, "uniform solid"),
        )
        errors = [abs(row.probability - (row.target or 0.0)) for row in body.rows]
        text = "; ".join([*facts, f"right to {html_part('accuracy', max(errors))}"])
        state, style = "running", "note"
        if result is not None:
            text, style = verdict_of(result)
            state = "done"
        self._state.content = html_part("design", state, text, style, body.rows, BASINS)
        was_in_view = self._viewport.viewed is self._shape_body
        self._shape_body = self._panel_body = body
        if was_in_view:
            self._viewport.update(body)
        else:
            self._viewport.show(body)
        assert outcomes.target is not None
        rest = body.rows[int(outcomes.target.argmax())].rest
        self._viewport.put(body.poses.transforms[max(rest, 0)])

    def _show_printable(self, work: Work) -> None:
        """Show the die with its labels."""
        self._panel_body = ViewedBody.of(
            body_of(work.finished, work.recipe.name),
            outcomes=outcomes_of(work, work.die.directions),
            poses=work.final.poses,
        )
        self._viewport.show(self._panel_body)
