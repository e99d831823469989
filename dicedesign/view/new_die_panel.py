"""The tab "New die": probabilities become a die, step by step, and files to print it from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import DiceError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.optimize.options import PaperWeights, legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.recipe.reading import format_probabilities, parse_target
from dicedesign.report.palette import BASINS
from dicedesign.results.parts import Status
from dicedesign.runtime.registry import Number
from dicedesign.view.design_session import DesignedShape, DesignSession, DieRequest
from dicedesign.view.exhibit import Exhibit
from dicedesign.view.page import Job, Page, Stopped, html_part
from dicedesign.view.printable_die import PrintableDie, printable_die
from dicedesign.view.viewed_body import Outcomes, ViewedBody

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["PRESETS", "NewDiePanel"]

PRESETS: Final = {
    "Two dice in one (2d6)": ("sum_of_dice: [6, 6]", ""),
    "Two small dice in one (2d4)": ("sum_of_dice: [4, 4]", ""),
    "Fair, 3 sides": ("fair: 3", ""),
    "Fair, 5 sides": ("fair: 5", ""),
    "Fair, 7 sides": ("fair: 7", ""),
    "Heads of 4 coins (binomial)": ("binomial: 4", ""),
    "A coin that can stand": ("1/2, 1/3, 1/6", "heads, tails, edge"),
    "Loaded: 6 twice as often": ("1/7, 1/7, 1/7, 1/7, 1/7, 2/7", ""),
    "Yes, no, perhaps": ("0.45, 0.45, 0.1", "yes, no, perhaps"),
}
"""What goes into the fields of probabilities and of labels, which are those of the probabilities
where it is empty, by what the page calls it."""

METHODS: Final = {"exact": "exact", "the paper's descent": "paper"}

BY_METHOD: Final = "as the method likes"
"""The start of who does not care."""

LEAST_LARGEST: Final = 2.0
"""A slider goes at least so far, and to four times its number's default."""

FASTEST: Final = 200
"""Steps a second, from which on none is held back."""

OFTEN: Final = 0.1
"""Seconds between two looks at whether a design was told to stop."""

FORMATS: Final = ("stl", "3mf")


class DieOptions:
    """Fields of what a hobbyist need not know.

    on_weights: called when a weight or the method has changed, in the page's thread.
    """

    def __init__(self, page: Page, on_weights: Callable[[], None], on_speed: Callable[[], None]):
        gui = page.gui
        self._starts: dict[str, Mapping[str, Any] | None] = {BY_METHOD: None} | {
            kind.name: {kind.name: {}} for kind in STARTS if _is_plain(kind)
        }
        with gui.add_folder("More", expand_by_default=False):
            self._seed = gui.add_text("Seed", "0", hint="another seed gives another shape")
            self._method = gui.add_dropdown(
                "Method",
                tuple(METHODS),
                hint="exact: probabilities to rounding, then the preferences below; the paper's: "
                "vertices "
                "go down an energy, then an exact finish",
            )
            self._start = gui.add_dropdown(
                "Start", tuple(self._starts), hint="the shape to begin with"
            )
            self._speed = gui.add_slider(
                "Steps a second", 1, FASTEST, 1, 30, hint=f"{FASTEST}: as fast as they come"
            )
            with gui.add_folder("Preferences", expand_by_default=False):
                self._prefer = _sliders(page, Preferences.list_numbers(), legible(), on_weights)
            self._energy = gui.add_folder(
                "Weights of the paper's energy", expand_by_default=False, visible=False
            )
            with self._energy:
                self._weights = _sliders(
                    page, PaperWeights.list_numbers(), PaperWeights(), on_weights
                )
        self._on_weights = on_weights
        self._method.on_update(lambda _: page.soon(self._take_method, "method"))
        self._speed.on_update(lambda _: page.soon(on_speed, "speed"))

    def _take_method(self) -> None:
        self._energy.visible = METHODS[self._method.value] == "paper"
        self._on_weights()

    @property
    def least_seconds(self) -> float:
        """That a step takes."""
        return 0.0 if self._speed.value >= FASTEST else 1.0 / self._speed.value

    def request(self, target: Mapping[str, Any]) -> DieRequest:
        """What the fields say. Raises InputError where a number cannot be."""
        seed = self._seed.value.strip()
        return DieRequest(
            target=target,
            # The recipe says what is wrong with another text.
            seed=int(seed) if seed.isdecimal() else seed,  # type: ignore[arg-type]
            method=METHODS[self._method.value],
            start=self._starts[self._start.value],
            prefer=Preferences(**{name: float(s.value) for name, s in self._prefer.items()}),
            weights=PaperWeights(**{name: float(s.value) for name, s in self._weights.items()}),
        )


def _is_plain(kind: StartKind) -> bool:
    """True for a kind of shape that needs nothing to be said of it."""
    if kind.make is None and kind.search is None:
        return False
    try:
        kind.options()
    except TypeError:
        return False
    return True


def _sliders(
    page: Page, declared: Mapping[str, Number], now: Any, on_change: Callable[[], None]
) -> dict[str, Any]:
    """A slider for each number, by its name."""
    sliders = {}
    for name, number in declared.items():
        value = float(getattr(now, name))
        most = max(LEAST_LARGEST, 4.0 * value)
        # No slider goes where a number is not allowed.
        while not number.allows(most):
            most /= 2.0
        least = 0.0 if number.allows(0.0) else most / 100.0
        slider = page.gui.add_slider(
            name.replace("_", " "), least, most, most / 200.0, value, hint=number.line
        )
        slider.on_update(lambda _: page.soon(on_change, "weights"))
        sliders[name] = slider
    return sliders


def session_html(session: DesignSession, chosen: int | None) -> str:
    """Where a design is, in a sentence with its state as an attribute, and a row for each outcome:
    label, bar with its target, probabilities, and whether its facet is pinned.

    chosen: the outcome whose label is to change places with the next that is clicked.
    """
    shape, state = session.shape, session.state
    said = {"running": "designing", "paused": "paused" if shape else "nothing designed yet"}
    words = [said.get(state, ""), session.message]
    longest = 1.0
    if state == "running" and session.starts > 1:
        words.append(f"starting shape {session.starts}")
    if shape is not None:
        words.append(f"step {len(session.shapes) - 1}")
        words.append(f"farthest from the probabilities by {100.0 * shape.error:.3g} %")
        longest = float(max(shape.outcomes.probabilities.max(), shape.target.max()))
    wrong = state == "failed" or session.status not in (None, Status.CONVERGED)
    said_words = [word for word in words if word]
    return html_part("session", session, said_words, wrong, BASINS, longest, chosen)


class DieFiles:
    """Fields and buttons of the files; all methods are called in the page's thread.

    session: gives the session whose die is wanted, or None; on_made: is given the die, once it is
    made.
    """

    def __init__(
        self,
        page: Page,
        session: Callable[[], DesignSession | None],
        on_made: Callable[[PrintableDie], None],
    ) -> None:
        self._page, self._session, self._on_made = page, session, on_made
        self._made: tuple[tuple[Any, ...], PrintableDie] | None = None
        self._job: Job | None = None
        gui = page.gui
        with gui.add_folder("Print it"):
            self._size = gui.add_text(
                "Size in mm", "", hint="from corner to corner; empty: 30, or what the labels need"
            )
            self._labels = gui.add_checkbox("Cut the labels in", initial_value=True)
            names = (*(ending.upper() for ending in FORMATS), "Recipe")
            download = gui.add_button_group("Download", names, hint="the recipe makes it again")
            download.on_click(
                lambda event: page.soon(lambda: self._begin(event.client, event.target.value))
            )
            self._error, self._table = gui.add_html(""), gui.add_html("")

    def refresh(self, session: DesignSession | None) -> None:
        """Leave out what is of another shape."""
        if self._made is not None and (session is None or session.shape is not self._made[0][0]):
            self._made = None
            self._table.content = ""

    def _begin(self, client: ClientHandle | None, what: str) -> None:
        session, size = self._session(), self._size.value.strip().removesuffix("mm").strip()
        if self._job is not None:
            return
        self._error.content = ""
        if session is None or session.shape is None or session.state == "running":
            self._refuse(
                "die: expected a design that is done or paused, got one that runs or none; wait, "
                "press Pause, or press Design first"
            )
            return
        try:
            size_mm = float(size) if size else None
        except ValueError:
            self._refuse(
                f"size: expected a number of millimeters, got {size!r}; correct it, or leave it "
                "empty"
            )
            return
        labels = bool(self._labels.value)
        key = session.shape, session.designed, size_mm, labels

        def work(job: Job) -> PrintableDie:
            return printable_die(
                session,
                size_mm=size_mm,
                engrave=labels,
                on_stage=lambda stage: job.progress(f"making the file: {stage}"),
            )

        def done(made: PrintableDie) -> None:
            self._made = key, made
            self._table.content = html_part("printed", made)
            self._on_made(made)
            self._send(client, what, made)

        def failed(error: Exception) -> None:
            if not isinstance(error, DiceError):
                raise error
            self._refuse(str(error))

        def ended() -> None:
            self._job = None

        if self._made is not None and self._made[0] == key:
            self._send(client, what, self._made[1])
        else:
            self._job = self._page.start(work, done, ended, failed)

    def _send(self, client: ClientHandle | None, what: str, die: PrintableDie) -> None:
        try:
            file = die.recipe_file() if what == "Recipe" else die.file(what.lower())
        except DiceError as error:
            self._refuse(str(error))
        else:
            self._page.download(client, *file)

    def _refuse(self, text: str) -> None:
        self._error.content = html_part("sentence", "file-error", text, True)


class NewDiePanel:
    """Fields, buttons and tables of a die that is designed; its shape is on show."""

    title = "New die"

    def __init__(self, exhibit: Exhibit) -> None:
        self._exhibit = exhibit
        self._session: DesignSession | None = None
        self._job: Job | None = None
        self._shape: DesignedShape | None = None
        self._viewed: ViewedBody | None = None
        self._own: ViewedBody | None = None
        self._chosen: int | None = None

    def build(self, page: Page) -> None:
        """Add the GUI elements; called once, within the tab."""
        self._page, gui = page, page.gui
        probabilities, labels = next(iter(PRESETS.values()))
        preset = gui.add_dropdown("Die", tuple(PRESETS))
        self._probabilities: Any = gui.add_text(
            "Probabilities",
            probabilities,
            hint="1/2, 1/3, 1/6; or fair: 7, binomial: 4, sum_of_dice: [6, 6]",
        )
        self._labels: Any = gui.add_text(
            "Labels", labels, hint="one for each, commas between them; empty: 1, 2, ..."
        )
        self._wrong = gui.add_html("")
        design = gui.add_button("Design", color="blue", hint="begin, or go on after a pause")
        steps = gui.add_button_group("", ("Pause", "Step", "Undo", "Reset"))
        self._state, self._refused = gui.add_html(""), gui.add_html("")
        self._files = DieFiles(page, lambda: self._session, self._show_made)
        self._options = DieOptions(page, self._weigh, self._set_speed)
        preset.on_update(lambda event: page.soon(lambda: self._take(event.target.value), "preset"))
        for text in (self._probabilities, self._labels):
            text.on_update(lambda _: page.soon(self._asked, "target"))
        design.on_click(lambda _: page.soon(lambda: self._go(DesignSession.run)))
        acts = {
            "Pause": lambda: self._with_session(DesignSession.pause),
            "Step": lambda: self._go(DesignSession.step),
            "Undo": lambda: self._with_session(DesignSession.undo),
            "Reset": self._reset,
        }
        steps.on_click(lambda event: page.soon(acts[event.target.value]))
        self._exhibit.on_show(self._take_over)
        page.on_action("pin", self._pin)
        page.on_action("label", self._click_label)

    def _take(self, name: str) -> None:
        self._probabilities.value, self._labels.value = PRESETS[name]
        self._asked()

    def _take_over(self, viewed: ViewedBody) -> None:
        """Offer the probabilities of another die that is on show, to design one like it."""
        shown = viewed.outcomes
        if viewed is self._own or shown is None or shown.target is None:
            return
        self._probabilities.value = format_probabilities(shown.target.tolist())
        self._labels.value = ", ".join(shown.labels)
        self._asked()

    def _asked(self) -> DieRequest | None:
        """What the fields ask for, or None where they cannot; then the page says why."""
        try:
            labels = self._labels.value.strip()
            target = parse_target(self._probabilities.value, labels or None)
            asked = self._options.request(target)
            asked.recipe()
        except DiceError as error:
            self._wrong.content = html_part("sentence", "target-error", str(error), True)
            return None
        self._wrong.content = ""
        return asked

    def _go(self, act: Callable[[DesignSession], None]) -> None:
        """Begin, or go on with the present die where that is still what is asked for."""
        asked, session = self._asked(), self._session
        if asked is None:
            return
        if session is None or not _is_same_die(asked, session.request):
            self._close_session()
            session = DesignSession(
                asked,
                lambda: self._page.soon(self._refresh, "design"),
                self._options.least_seconds,
            )
            self._session = session
        elif not self._change(session, replace(asked, pinned=session.request.pinned)):
            return
        act(session)
        self._watch(session)

    def _change(self, session: DesignSession, request: DieRequest) -> bool:
        """Ask a session for something else; whether that can be. If not the page says why."""
        try:
            session.change(request)
        except DiceError as error:
            self._refused.content = html_part("sentence", "change-error", str(error), True)
            return False
        self._refused.content = ""
        return True

    def _watch(self, session: DesignSession) -> None:
        """Have the page end a design that runs when it closes."""
        if self._job is not None and self._job.running:
            return

        def work(job: Job) -> None:
            try:
                while not session.wait(OFTEN):
                    # A bar that comes and goes would move what is pressed.
                    job.progress("" if session.shapes else "looking for a shape")
            except Stopped:
                session.close()
                raise

        def again() -> None:
            if self._session is session:
                self._job = None
                if session.state == "running":
                    self._watch(session)

        self._job = self._page.start(work, lambda _: None, again)

    def _with_session(self, act: Callable[[DesignSession], None]) -> None:
        if self._session is not None:
            act(self._session)

    def _close_session(self) -> None:
        if self._session is not None:
            self._session.close()
        if self._job is not None:
            self._job.stop()
        self._session, self._job, self._shape, self._chosen = None, None, None, None
        self._refused.content = ""

    def _reset(self) -> None:
        self._close_session()
        self._refresh()

    def _weigh(self) -> None:
        """Other weights, or another method, from the next step on; a die that is done goes on."""
        session, asked = self._session, self._asked()
        if session is None or asked is None or not _is_same_die(asked, session.request):
            return
        was = session.state
        if self._change(session, replace(asked, pinned=session.request.pinned)):
            if was == "done" and session.state == "paused":
                session.run()
            self._watch(session)

    def _set_speed(self) -> None:
        if self._session is not None:
            self._session.least_seconds = self._options.least_seconds

    def _pin(self, place: int) -> None:
        session = self._session
        if session is None or place >= len(session.labels):
            return
        label, pinned = session.labels[place], session.request.pinned
        others = tuple(other for other in pinned if other != label)
        pinned = others if label in pinned else (*pinned, label)
        self._change(session, replace(session.request, pinned=pinned))

    def _click_label(self, place: int) -> None:
        session = self._session
        if session is None or place >= len(session.labels):
            return
        if self._chosen is None:
            self._chosen = place
            self._refresh()
            return
        chosen, self._chosen = self._chosen, None
        if chosen == place:
            self._refresh()
            return
        session.swap(session.labels[chosen], session.labels[place])

    def _refresh(self) -> None:
        """Show where the design is."""
        session = self._session
        self._state.content = "" if session is None else session_html(session, self._chosen)
        self._files.refresh(session)
        if session is not None and session.shape is not self._shape:
            self._shape = session.shape
            if session.shape is not None:
                self._show(session, session.shape)

    def _show(self, session: DesignSession, shape: DesignedShape) -> None:
        poses = shape.poses
        is_next = self._viewed is not None and self._exhibit.viewed is self._viewed
        self._viewed = ViewedBody.of(
            make_body(poses.hull.vertices, name="new die"),
            outcomes=Outcomes(session.labels, shape.directions, shape.target),
            name="new die",
            poses=poses,
        )
        self._own = self._viewed
        if is_next:
            self._exhibit.update(self._viewed)
        else:
            self._exhibit.show(self._viewed)
        most = self._viewed.rows[int(shape.target.argmax())].rest
        self._exhibit.put(self._exhibit.standing(max(most, 0)))

    def _show_made(self, die: PrintableDie) -> None:
        """Show the die with its labels cut in."""
        target = die.recipe.target.target()
        self._own = ViewedBody.of(
            make_body(die.points, die.triangles, name=die.recipe.name),
            outcomes=Outcomes(target.labels, die.directions, target.probabilities),
            poses=die.verdict.poses,
        )
        self._exhibit.show(self._own)


def _is_same_die(asked: DieRequest, before: DieRequest) -> bool:
    """True where a design may go on with other weights or by another method."""

    def key(request: DieRequest) -> tuple[Any, ...]:
        return request.target, request.seed, request.start

    return key(asked) == key(before)
