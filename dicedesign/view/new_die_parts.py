"""Parts of the tab for a new die: options, tables of its state, and files to save."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import DiceError, InputError
from dicedesign.optimize.options import PaperWeights, legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.report.palette import BASINS
from dicedesign.results.parts import Status
from dicedesign.runtime.registry import Number
from dicedesign.view.design_run import DieRequest
from dicedesign.view.design_session import DesignSession
from dicedesign.view.html_parts import html_part
from dicedesign.view.page import Job, Page
from dicedesign.view.printable_die import PrintableDie, printable_die

if TYPE_CHECKING:
    from viser import ClientHandle


METHODS: Final = {"exact": "exact", "the paper's descent": "paper"}

BY_METHOD: Final = "as the method likes"
"""The start of who does not care."""

LEAST_LARGEST: Final = 2.0
"""A slider goes at least so far, and to four times its number's default."""

FASTEST: Final = 200
"""Steps a second, from which on none is held back."""


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
                hint="exact: odds to rounding, then the preferences below; the paper's: vertices "
                "go down an energy, then an exact finish",
            )
            self._start = gui.add_dropdown(
                "Start", tuple(self._starts), hint="the shape to begin with"
            )
            self._speed = gui.add_slider(
                "Steps a second", 1, FASTEST, 1, 30, hint=f"{FASTEST}: as fast as they come"
            )
            with gui.add_folder("Preferences", expand_by_default=False):
                self._prefer = _sliders(page, Preferences.declared(), legible(), on_weights)
            self._energy = gui.add_folder(
                "Weights of the paper's energy", expand_by_default=False, visible=False
            )
            with self._energy:
                self._weights = _sliders(page, PaperWeights.declared(), PaperWeights(), on_weights)
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
    label, bar with its target, odds, and whether its facet is pinned.

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
        words.append(f"farthest from the odds by {100.0 * shape.error:.3g} %")
        longest = float(max(shape.outcomes.odds.max(), shape.target.max()))
    wrong = state == "failed" or session.status not in (None, Status.CONVERGED)
    said_words = [word for word in words if word]
    return html_part("session", session, said_words, wrong, BASINS, longest, chosen)


FORMATS: Final = ("stl", "3mf")


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
            self._makers = {
                **{kind.upper(): _as_format(kind) for kind in FORMATS},
                "Recipe": PrintableDie.recipe_file,
            }
            download = gui.add_button_group(
                "Download", tuple(self._makers), hint="the recipe makes it again"
            )
            download.on_click(
                lambda event: page.soon(lambda: self._begin(event.client, event.target.value))
            )
            self._error = gui.add_html("")
            self._table = gui.add_html("")

    def refresh(self, session: DesignSession | None) -> None:
        """Leave out what is of another shape."""
        if self._made is not None and (session is None or session.shape is not self._made[0][0]):
            self._made = None
            self._table.content = ""

    def _begin(self, client: ClientHandle | None, what: str) -> None:
        session = self._session()
        if self._job is not None:
            return
        self._error.content = ""
        try:
            if session is None or session.shape is None or session.state == "running":
                raise InputError(
                    "die: expected a design that is done or paused, got one that runs or none; "
                    "wait, press Pause, or press Design first"
                )
            size, labels = self._size_mm(), bool(self._labels.value)
        except InputError as error:
            self._refuse(error)
            return
        key = session.shape, session.designed, size, labels
        if self._made is not None and self._made[0] == key:
            self._send(client, what, self._made[1])
            return

        def work(job: Job) -> PrintableDie | DiceError:
            try:
                return printable_die(
                    session,
                    size_mm=size,
                    engrave=labels,
                    on_stage=lambda stage: job.progress(f"making the file: {stage}"),
                )
            except DiceError as error:
                return error

        def done(made: PrintableDie | DiceError) -> None:
            if isinstance(made, DiceError):
                self._refuse(made)
                return
            self._made = key, made
            self._table.content = html_part("printed", made)
            self._on_made(made)
            self._send(client, what, made)

        def ended() -> None:
            self._job = None

        self._job = self._page.start(work, done, ended)

    def _size_mm(self) -> float | None:
        text = self._size.value.strip().removesuffix("mm").strip()
        if not text:
            return None
        try:
            return float(text)
        except ValueError as error:
            raise InputError(
                f"size: expected a number of millimetres, got {text!r}; correct it, or leave it "
                "empty"
            ) from error

    def _send(self, client: ClientHandle | None, what: str, die: PrintableDie) -> None:
        try:
            self._page.download(client, *self._makers[what](die))
        except DiceError as error:
            self._refuse(error)

    def _refuse(self, error: DiceError) -> None:
        self._error.content = html_part("sentence", "file-error", str(error), True)


def _as_format(kind: str) -> Callable[[PrintableDie], tuple[str, bytes]]:
    return lambda die: die.file(kind)
