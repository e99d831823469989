"""Tab "New die": design a die for given probabilities, and download its files."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.fabricate.file_formats import FILE_FORMATS, file_bytes
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import body_of, make_body
from dicedesign.optimize.options import legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import FEWEST_FACETS, STARTS, StartKind
from dicedesign.palette import BASINS
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import format_probabilities, parse_recipe, parse_target, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.poses import analyze
from dicedesign.results.parts import Status
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats
from dicedesign.view.page import Job, Page, html_part
from dicedesign.view.viewed_body import ViewedBody, outcomes_of
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

METHODS = {"exact": "exact", "the paper's descent": "paper"}

DEFAULT_START = "default of the method"

MIN_SLIDER_RANGE = 2.0
"""A slider reaches at least this, and four times the default of its number."""

STEP_SECONDS = 1.0 / 30.0
"""Least duration of a step, so that it can be seen."""


class OptionControls:
    """Fields of optional settings, which the next design reads."""

    def __init__(self, page: Page) -> None:
        gui = page.gui
        starts = [kind.name for kind in STARTS if _works_without_options(kind)]
        with gui.add_folder("More", expand_by_default=False):
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

    def recipe(self, target: dict[str, Any]) -> Recipe:
        """Recipe of a target with these options. Raises RecipeError: an entry cannot be used."""
        seed, method = self._seed.value.strip(), METHODS[self._method.value]
        prefer = {name: float(slider.value) for name, slider in self._prefer.items()}
        entries = {
            "name": "die",
            # The recipe refuses any other text.
            "seed": int(seed) if seed.isdecimal() else seed,
            "target": target,
            "method": {method: {"prefer": prefer}},
        }
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
    """Run the stages after a design, without files on disk.

    Parameters
    ----------
    size_mm: largest distance between two corners; None is 30, or more if the labels need it.
    engrave: engrave the labels.
    on_stage: called with the name of each stage at its start.

    Raises InputError: the size is not allowed, or a label does not fit or has no facet.
    """
    entries = design.recipe.as_dict() | {"engrave": engrave}
    if size_mm is not None:
        entries["size_mm"] = size_mm
    work = Work(
        parse_recipe(entries), callbacks=Callbacks(on_stage=on_stage), enlarge=size_mm is None
    )
    work.die = design.die
    run_stages(work, after="design", last="throws")
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
                self._table.content = html_part("printed", finished, finished.result())
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
        self._target_error = page.gui.add_html("")
        design = page.gui.add_button("Design", color="blue")
        reset = page.gui.add_button("Reset", hint="discard this die")
        self._state = page.gui.add_html("")
        self._downloads = DownloadControls(page, self._show_printable)
        self._options = OptionControls(page)
        self._preset.on_update(lambda event: page.enqueue(lambda: self._choose(event), "preset"))
        for text in (self._probabilities, self._labels):
            text.on_update(lambda _: page.enqueue(self._read_recipe, "target"))
        design.on_click(lambda _: page.enqueue(self._design))
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
            shares, labels = outcomes.target, outcomes.labels
            if outcomes.outcome_of is not None:
                faces = outcomes.outcome_of
                shares = (shares / np.bincount(faces))[faces]
                labels = tuple(labels[outcome] for outcome in faces.tolist())
            quoted = (f'"{label}"' if "," in label else label for label in labels)
            self._fill(format_probabilities(shares.tolist()), ", ".join(quoted))

    def _read_recipe(self) -> Recipe | None:
        """Read the fields; return None and show the error if they are not valid."""
        fields = self._probabilities.value, self._labels.value
        self._preset.value = next((name for name in PRESETS if PRESETS[name] == fields), OWN)
        try:
            labels = self._labels.value.strip()
            recipe = self._options.recipe(parse_target(self._probabilities.value, labels or None))
        except DiceError as error:
            self._target_error.content = html_part("sentence", "target-error", str(error), True)
            return None
        self._target_error.content = ""
        return recipe

    def _design(self) -> None:
        """Design the die of the fields, in place of the current one."""
        recipe = self._read_recipe()
        if recipe is None:
            return
        self._reset()
        page = self._viewport.page

        def work(job: Job) -> Work:
            starts, steps = 1, 0
            shape: tuple[ConvexHull, Floats] | None = None

            def on_start(number: int) -> None:
                nonlocal starts
                job.check()
                starts = number + 1

            def on_shape(hull: ConvexHull, directions: Floats) -> None:
                nonlocal shape
                shape = hull, directions

            def on_step(_: Step) -> None:
                nonlocal steps
                job.check()
                steps += 1
                if shape is not None:
                    facts = ["designing", *([f"starting shape {starts}"] if starts > 1 else [])]
                    facts.append(f"step {steps}")
                    show = partial(self._show, job, "running", facts, recipe, *shape)
                    page.enqueue(show, "design")
                time.sleep(STEP_SECONDS)

            callbacks = Callbacks(on_start=on_start, on_shape=on_shape, on_step=on_step)
            work = Work(recipe, callbacks=callbacks)
            run_stages(work, last="design")
            return work

        def on_done(done: Work) -> None:
            is_right = done.die.status is Status.CONVERGED
            facts = ["done" if is_right else done.die.status.value]
            # The best die may come from an earlier step.
            self._show(job, "done", facts, recipe, done.die.hull, done.die.directions)
            self._downloads.offer(done)

        def on_error(error: Exception) -> None:
            self._state.content = html_part("design", "failed", [str(error)], True)
            if not isinstance(error, DiceError):
                raise error

        self._state.content = html_part("design", "running", ["designing"], False)
        self._job = job = page.start(work, on_done, on_error)

    def _reset(self) -> None:
        if self._job is not None:
            self._job.stop()
        self._job, self._shape_body, self._state.content = None, None, ""
        self._downloads.offer(None)

    def _show(
        self,
        job: Job,
        state: str,
        facts: list[str],
        recipe: Recipe,
        hull: ConvexHull,
        directions: Floats,
    ) -> None:
        """Show the shape and the progress of a job, unless another one has begun."""
        if job is not self._job:
            return
        target = recipe.target.target()
        body = ViewedBody.of(
            make_body(hull.vertices, name="new die"),
            outcomes=outcomes_of(target, directions),
            poses=analyze(hull, hull.centroid, "uniform solid"),
        )
        errors = [abs(row.probability - (row.target or 0.0)) for row in body.rows]
        facts = [*facts, f"the probabilities are right to {html_part('accuracy', max(errors))}"]
        is_error = state == "done" and facts[0] != "done"
        self._state.content = html_part("design", state, facts, is_error, body.rows, BASINS)
        was_in_view = self._viewport.viewed is self._shape_body
        self._shape_body = self._panel_body = body
        if was_in_view:
            self._viewport.update(body)
        else:
            self._viewport.show(body)
        rest = body.rows[int(target.probabilities.argmax())].rest
        self._viewport.put(body.poses.transforms[max(rest, 0)])

    def _show_printable(self, work: Work) -> None:
        """Show the die with its labels."""
        self._panel_body = ViewedBody.of(
            body_of(work.finished, work.recipe.name),
            outcomes=outcomes_of(work.target, work.die.directions),
            poses=work.final.poses,
        )
        self._viewport.show(self._panel_body)
