"""Parts of the tab for a new die: options, tables of its state, and files to save."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import DiceError, InputError
from dicedesign.optimize.options import PaperWeights, legible
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.report.palette import BASINS
from dicedesign.results.parts import Status
from dicedesign.runtime.numbers import Number
from dicedesign.view.design_run import DieRequest
from dicedesign.view.design_session import DesignSession
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


def sentence(name: str, text: str, *, wrong: bool = False) -> str:
    """A sentence of an element of its own, or nothing for no text. name: the element's id."""
    look = "wrong" if wrong else "note"
    return f'<div class="dd"><p id="{name}" class="{look}">{html.escape(text)}</p></div>' * bool(
        text
    )


def session_html(session: DesignSession, chosen: int | None) -> str:
    """Where a design is, in a sentence with its state as an attribute, and a row for each outcome:
    label, bar with its target, odds, and whether its facet is pinned.

    chosen: the outcome whose label is to change places with the next that is clicked.
    """
    return _status(session) + _facet_table(session, chosen)


def _status(session: DesignSession) -> str:
    shape, state = session.shape, session.state
    said = []
    if state == "running":
        said.append("designing")
    elif state == "paused":
        said.append("paused" if shape is not None else "nothing designed yet")
    if session.message:
        said.append(session.message)
    if state == "running" and session.starts > 1:
        said.append(f"starting shape {session.starts}")
    if shape is not None:
        said.append(f"step {len(session.shapes) - 1}")
        said.append(f"farthest from the odds by {100.0 * shape.error:.3g} %")
    is_off = session.status not in (None, Status.CONVERGED)
    look = "wrong" if state == "failed" or is_off else "note"
    return (
        f'<div class="dd"><p id="design" class="{look}" data-state="{state}">'
        f"{html.escape('; '.join(said))}</p>{_terms(session)}</div>"
    )


def _terms(session: DesignSession) -> str:
    """What the steps lower: the terms of an energy, or preferences."""
    shape = session.shape
    if shape is None or not shape.terms:
        return ""
    terms = ", ".join(f"{name} {value:.3g}" for name, value in shape.terms.items())
    return f'<p id="terms" class="note">lowered: {html.escape(terms)}</p>'


def _facet_table(session: DesignSession, chosen: int | None) -> str:
    shape = session.shape
    if shape is None:
        return ""
    odds, target = shape.outcomes.odds.tolist(), shape.target.tolist()
    longest = max(*odds, *target)
    rows = []
    for place, (label, has, wanted) in enumerate(zip(session.labels, odds, target, strict=True)):
        color = BASINS[place % len(BASINS)]
        bar = (
            f'<div class="track"><div class="fill" style="width:{100.0 * has / longest:.2f}%;'
            f'background:{color}"></div><div class="wanted" '
            f'style="left:{100.0 * wanted / longest:.2f}%"></div></div>'
        )
        is_pinned = label in session.request.pinned
        mark = ' class="chosen"' if place == chosen else ""
        rows.append(
            f'<tr{mark}><td data-action="label:{place}" role="button" tabindex="0" '
            f'title="change places with another label">{html.escape(label)}</td>'
            f'<td class="bar">{bar}</td><td>{100.0 * wanted:.3f}</td><td>{100.0 * has:.3f}</td>'
            f'<td data-action="pin:{place}" role="button" tabindex="0" '
            f'aria-pressed="{str(is_pinned).lower()}" title="keep this facet where it is">'
            f"{'&#9679;' if is_pinned else '&#9675;'} pin</td></tr>"
        )
    stray = shape.outcomes.elsewhere
    if stray > 0.0:
        rows.append(
            f"<tr><td>other</td><td></td><td>0.000</td><td>{100.0 * stray:.3f}</td><td></td></tr>"
        )
    hint = (
        "Click two labels to let them change places."
        if chosen is None
        else (f"Click the label that changes places with {session.labels[chosen]}.")
    )
    return (
        '<div class="dd"><table id="facets"><thead><tr><th>shows</th><th></th><th>wanted %</th>'
        f"<th>has %</th><th></th></tr></thead><tbody>{''.join(rows)}</tbody></table>"
        f"<p class='note'>{html.escape(hint)}</p></div>"
    )


def printed_table(die: PrintableDie) -> str:
    """The odds of the file that is printed, as it was read back, and what there is to say."""
    rows = "".join(
        f"<tr><td>{html.escape(label)}</td><td>{100.0 * wanted:.6f}</td><td>{100.0 * has:.6f}</td>"
        "</tr>"
        for label, wanted, has in die.rows()
    )
    size = f"{die.recipe.size_mm:g} mm from corner to corner"
    look = "note" if die.is_converged else "wrong"
    return (
        '<div class="dd"><table id="printed"><thead><tr><th>shows</th><th>wanted %</th>'
        f"<th>in the file %</th></tr></thead><tbody>{rows}</tbody></table>"
        f"<p id='verdict' class='{look}'>{html.escape(die.message)}</p>"
        f"{_paragraphs([size, *die.notes])}</div>"
    )


def _paragraphs(texts: Iterable[str]) -> str:
    return "".join(f"<p class='note'>{html.escape(text)}</p>" for text in texts)


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
            self._table.content = printed_table(made)
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
        self._error.content = sentence("file-error", str(error), wrong=True)


def _as_format(kind: str) -> Callable[[PrintableDie], tuple[str, bytes]]:
    return lambda die: die.file(kind)
