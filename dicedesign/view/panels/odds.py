"""Bars of odds, set down and thrown, that follow the body."""

from __future__ import annotations

from typing import Any, Final

from dicedesign.errors import DiceError
from dicedesign.throws.momentum_model import MomentumModel, momentum_model
from dicedesign.throws.tables import TABLE_NAMES
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.page.page import Page
from dicedesign.view.panels.odds_bars import body_html, odds_html
from dicedesign.view.scenes.exhibit import Exhibit

__all__ = ["Odds"]

NO_TABLE: Final = "no table: set down gently"


class Odds:
    """What the body on show does.

    Attributes
    ----------
    table: name of the table that it is thrown onto, or None.
    """

    def __init__(self, exhibit: Exhibit) -> None:
        self.table: str | None = None
        self._exhibit = exhibit
        self._model: MomentumModel | None = None
        self._updates = 0
        self._facts: Any = None
        self._bars: Any = None

    def build(self, page: Page) -> None:
        """Add the GUI elements."""
        gui = page.gui
        self._facts = gui.add_html("")
        chosen = gui.add_dropdown(
            "Thrown onto",
            (NO_TABLE, *TABLE_NAMES),
            hint="What momentum does to the odds, by the momentum model of a table",
        )
        self._bars = gui.add_html("")

        @chosen.on_update
        def _(_: Any) -> None:
            page.soon(lambda: self._choose(chosen.value), "table")

        page.on_action("stand", self._stand)
        self._exhibit.on_change(self._refresh)

    def _choose(self, name: str) -> None:
        self.table = None if name == NO_TABLE else name
        self._model = None if self.table is None else momentum_model(self.table)
        if self._exhibit.viewed is not None:
            self._refresh(self._exhibit.viewed)

    def _refresh(self, viewed: ViewedBody) -> None:
        thrown = None
        if self.table is not None:
            try:
                thrown = viewed.thrown(self._model)
            except DiceError as error:
                self._exhibit.page.failed(error)
        self._updates += 1
        self._facts.content = body_html(viewed, self._updates)
        self._bars.content = odds_html(viewed, thrown)

    def _stand(self, place: int) -> None:
        viewed = self._exhibit.viewed
        if viewed is None or place >= len(viewed.rows):
            return
        row = viewed.rows[place]
        if row.rest < 0:
            self._exhibit.page.say(f"{row.label}: there is no facet on which the die shows it")
        else:
            self._exhibit.stand(row.rest)
