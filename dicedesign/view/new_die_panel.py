"""Tab "New die": design a die for given probabilities, and download its files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.meshes.body import body_of, make_body
from dicedesign.optimize.options import PaperWeights, legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.palette import BASINS
from dicedesign.recipe.reading import format_probabilities, parse_target
from dicedesign.results.parts import Status
from dicedesign.runtime.registry import Number
from dicedesign.view.design_session import DesignedShape, DesignSession, DieRequest
from dicedesign.view.page import Job, Page, html_part
from dicedesign.view.printable_die import PrintableDie, make_printable
from dicedesign.view.viewed_body import ViewedBody, outcomes_of
from dicedesign.view.viewport import Viewport

if TYPE_CHECKING:
    from viser import ClientHandle, GuiEvent

__all__ = ["PRESETS", "NewDiePanel"]

PRESETS: Final = {
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

OWN: Final = "Your own"
"""Title in the menu of fields that no preset has."""

METHODS: Final = {"exact": "exact", "the paper's descent": "paper"}

DEFAULT_START: Final = "default of the method"

MIN_SLIDER_RANGE: Final = 2.0
"""A slider reaches at least this, and four times the default of its number."""

STEP_SECONDS: Final = 1.0 / 30.0
"""Least duration of a step, so that it can be seen."""


class OptionControls:
    """Fields of optional settings.

    on_change: called in the thread of changes after a change of a weight or the method.
    """

    def __init__(self, page: Page, on_change: Callable[[], None]) -> None:
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
            with gui.add_folder("Preferences", expand_by_default=False):
                self._prefer = _sliders(page, Preferences.list_numbers(), legible(), on_change)
            self._energy = gui.add_folder(
                "Weights of the paper's energy", expand_by_default=False, visible=False
            )
            with self._energy:
                self._weights = _sliders(
                    page, PaperWeights.list_numbers(), PaperWeights(), on_change
                )

        def on_method() -> None:
            self._energy.visible = METHODS[self._method.value] == "paper"
            on_change()

        self._method.on_update(lambda _: page.enqueue(on_method, "method"))

    def request(self, target: Mapping[str, Any]) -> DieRequest:
        """Read the fields. Raises InputError: a number is not allowed."""
        seed, start = self._seed.value.strip(), self._start.value
        return DieRequest(
            target=target,
            # The recipe refuses any other text.
            seed=int(seed) if seed.isdecimal() else seed,  # type: ignore[arg-type]
            method=METHODS[self._method.value],
            start=None if start == DEFAULT_START else {start: {}},
            prefer=Preferences(**{name: float(s.value) for name, s in self._prefer.items()}),
            weights=PaperWeights(**{name: float(s.value) for name, s in self._weights.items()}),
        )


def _works_without_options(kind: StartKind) -> bool:
    if kind.make is None and kind.search is None:
        return False
    try:
        kind.options()
    except TypeError:
        return False
    return True


def _sliders(
    page: Page, numbers: Mapping[str, Number], defaults: Any, on_change: Callable[[], None]
) -> dict[str, Any]:
    """Add a slider for each number."""
    sliders = {}
    for name, number in numbers.items():
        value = float(getattr(defaults, name))
        largest = max(MIN_SLIDER_RANGE, 4.0 * value)
        while not number.allows(largest):
            largest /= 2.0
        least = 0.0 if number.allows(0.0) else largest / 100.0
        slider = page.gui.add_slider(
            name.replace("_", " "), least, largest, largest / 200.0, value, hint=number.line
        )
        slider.on_update(lambda _: page.enqueue(on_change, "weights"))
        sliders[name] = slider
    return sliders


def session_html(session: DesignSession, selected: int | None) -> str:
    """Progress of a design, and a table with a row for each outcome.

    selected: outcome whose label will be swapped with the label that is clicked next.
    """
    shape, state = session.shape, session.state
    texts = {"running": "designing", "new": "nothing designed yet"}
    is_done = session.status is Status.CONVERGED
    facts = [texts.get(state, ""), "done" if is_done else session.message]
    longest = 1.0
    if state == "running" and session.starts > 1:
        facts.append(f"starting shape {session.starts}")
    if shape is not None:
        facts.append(f"step {session.steps}")
        facts.append(f"the probabilities are right to {html_part('accuracy', shape.error)}")
        longest = float(max(shape.outcomes.probabilities.max(), shape.target.probabilities.max()))
    is_error = state == "failed" or not (is_done or session.status is None)
    return html_part(
        "session", session, list(filter(None, facts)), is_error, BASINS, longest, selected
    )


class DownloadControls:
    """Fields and buttons for the files of a die. Use it only in the thread of changes.

    session: returns the current session, or None; on_printable: called with the die once it is
    ready to print.
    """

    def __init__(
        self,
        page: Page,
        session: Callable[[], DesignSession | None],
        on_printable: Callable[[PrintableDie], None],
    ) -> None:
        self._page, self._session, self._on_printable = page, session, on_printable
        self._cache: tuple[tuple[Any, ...], PrintableDie] | None = None
        self._job: Job | None = None
        gui = page.gui
        with gui.add_folder("Print it"):
            self._size = gui.add_text(
                "Size in mm", "", hint="from corner to corner; empty: 30, or what the labels need"
            )
            self._labels = gui.add_checkbox("Cut the labels in", initial_value=True)
            download = gui.add_button_group(
                "Download", ("STL", "3MF", "Recipe"), hint="the recipe makes this die again"
            )
            self._error, self._table = gui.add_html(""), gui.add_html("")
        download.on_click(
            lambda event: page.enqueue(lambda: self._download(event.client, event.target.value))
        )

    def refresh(self, session: DesignSession | None) -> None:
        """Discard the die of another shape."""
        if self._cache is not None and (session is None or session.shape is not self._cache[0][0]):
            self._cache = None
            self._table.content = ""

    def _download(self, client: ClientHandle | None, file: str) -> None:
        if self._job is not None and self._job.is_running:
            return
        self._error.content = ""
        session, size = self._session(), self._size.value.strip().removesuffix("mm").strip()
        try:
            if session is None or session.shape is None or session.state == "running":
                raise InputError(
                    "die: expected a design that is done, got one that runs or none; wait, or "
                    "press Design first"
                )
            size_mm = _parse_size(size)
        except InputError as error:
            self._show_error(error)
            return
        engrave = bool(self._labels.value)
        key = session.shape, session.final_design, size_mm, engrave

        def work(job: Job) -> PrintableDie:
            return make_printable(
                session,
                size_mm=size_mm,
                engrave=engrave,
                on_stage=lambda stage: job.progress(f"making the file: {stage}"),
            )

        def on_done(die: PrintableDie) -> None:
            self._cache = key, die
            self._table.content = html_part("printed", die)
            self._on_printable(die)
            self._send(client, file, die)

        if self._cache is not None and self._cache[0] == key:
            self._send(client, file, self._cache[1])
        else:
            self._job = self._page.start(work, on_done, self._show_error)

    def _send(self, client: ClientHandle | None, file: str, die: PrintableDie) -> None:
        try:
            content = die.recipe_file() if file == "Recipe" else die.file(file.lower())
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
        self._session: DesignSession | None = None
        self._shape: DesignedShape | None = None
        self._shape_body: ViewedBody | None = None
        self._panel_body: ViewedBody | None = None
        self._selected: int | None = None
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
        self._state, self._change_error = page.gui.add_html(""), page.gui.add_html("")
        self._downloads = DownloadControls(page, lambda: self._session, self._show_printable)
        self._options = OptionControls(page, self._apply_options)
        self._preset.on_update(lambda event: page.enqueue(lambda: self._choose(event), "preset"))
        for text in (self._probabilities, self._labels):
            text.on_update(lambda _: page.enqueue(self._read_request, "target"))
        design.on_click(lambda _: page.enqueue(self._advance))
        reset.on_click(lambda _: page.enqueue(self._reset))
        viewport.on_show.append(self._copy_target)
        page.on_action("label", self._click_label)
        page.on_close.append(self._close_session)
        if begins:
            page.enqueue(self._advance)

    def _choose(self, event: GuiEvent[Any]) -> None:
        """Design the die that somebody chose in the menu."""
        if event.client is not None and self._preset.value != OWN:
            self._fill(*PRESETS[self._preset.value])
            self._advance()

    def _fill(self, probabilities: str, labels: str) -> None:
        self._probabilities.value, self._labels.value = probabilities, labels
        self._read_request()

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

    def _read_request(self) -> DieRequest | None:
        """Read the fields; return None and show the error if they are not valid."""
        fields = self._probabilities.value, self._labels.value
        self._preset.value = next((name for name in PRESETS if PRESETS[name] == fields), OWN)
        try:
            labels = self._labels.value.strip()
            target = parse_target(self._probabilities.value, labels or None)
            request = self._options.request(target)
            request.recipe()
        except DiceError as error:
            self._target_error.content = html_part("sentence", "target-error", str(error), True)
            return None
        self._target_error.content = ""
        return request

    def _advance(self) -> None:
        """Start a session, or continue the current one if it designs the requested die."""
        request, session = self._read_request(), self._session
        if request is None:
            return
        if session is None or not _is_same_die(request, session.request):
            self._close_session()
            session = self._session = DesignSession(
                request,
                lambda: self._viewport.page.enqueue(self._refresh, "design"),
                STEP_SECONDS,
            )
            self._selected, self._change_error.content = None, ""
        elif not self._change(session, request):
            return
        session.run()

    def _change(self, session: DesignSession, request: DieRequest) -> bool:
        """Change the request; return False and show the error if that is not possible."""
        try:
            session.change(request)
        except DiceError as error:
            self._change_error.content = html_part("sentence", "change-error", str(error), True)
            return False
        self._change_error.content = ""
        return True

    def _close_session(self) -> None:
        if self._session is not None:
            self._session.close()

    def _reset(self) -> None:
        self._close_session()
        self._session, self._selected = None, None
        self._change_error.content = ""
        self._refresh()

    def _apply_options(self) -> None:
        """Apply other options from the next step; a finished design continues."""
        session, request = self._session, self._read_request()
        if session is None or request is None or not _is_same_die(request, session.request):
            return
        if self._change(session, request):
            session.run()

    def _click_label(self, outcome: int) -> None:
        """Select a label, or swap it with the selected one."""
        session, selected = self._session, self._selected
        if session is None or outcome >= len(session.labels):
            return
        self._selected = outcome if selected is None else None
        if selected is None or selected == outcome:
            self._refresh()
        else:
            session.swap(session.labels[selected], session.labels[outcome])
            session.run()

    def _refresh(self) -> None:
        """Show the progress of the design, and its shape if that is new."""
        session = self._session
        self._state.content = "" if session is None else session_html(session, self._selected)
        self._downloads.refresh(session)
        if session is None or session.shape is None or session.shape is self._shape:
            return
        self._shape = shape = session.shape
        body = ViewedBody.of(
            make_body(shape.hull.vertices, name="new die"),
            outcomes=outcomes_of(shape.target, shape.directions),
            poses=shape.poses,
        )
        was_in_view = self._viewport.viewed is self._shape_body
        self._shape_body = self._panel_body = body
        if was_in_view:
            self._viewport.update(body)
        else:
            self._viewport.show(body)
        rest = body.rows[int(shape.target.probabilities.argmax())].rest
        self._viewport.put(body.poses.transforms[max(rest, 0)])

    def _show_printable(self, die: PrintableDie) -> None:
        """Show the die with its labels."""
        work = die.work
        self._panel_body = ViewedBody.of(
            body_of(work.finished, work.recipe.name),
            outcomes=outcomes_of(work.target, work.die.directions),
            poses=work.final.poses,
        )
        self._viewport.show(self._panel_body)


def _is_same_die(first: DieRequest, second: DieRequest) -> bool:
    """Whether two requests differ only in weights and method."""
    return (first.target, first.seed, first.start) == (second.target, second.seed, second.start)
