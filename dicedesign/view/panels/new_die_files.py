"""The part of a new die that makes files: size, labels, downloads, and the odds in the file."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import DiceError, InputError
from dicedesign.view.dice.design_session import DesignSession
from dicedesign.view.dice.finishing import PrintableDie, printable_die
from dicedesign.view.page.job import Job
from dicedesign.view.page.page import Page
from dicedesign.view.panels.new_die_tables import printed_table, sentence

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["DieFiles"]

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
