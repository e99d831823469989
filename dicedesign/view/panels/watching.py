"""Watching: the body let go on the floor, or thrown onto a table."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.film import Film, throw_film
from dicedesign.throws.tables import table_named
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.page.page import Page
from dicedesign.view.panels.odds import Odds
from dicedesign.view.scenes.exhibit import Exhibit
from dicedesign.view.scenes.motion import filmed
from dicedesign.view.scenes.settling import let_go

__all__ = ["Watching"]

LET_GO: Final = "Let it go"
THROW: Final = "Throw it"
THROW_SO: Final = "Throw it as it lies"

USUAL_TABLE: Final = "board-game"


class Watching:
    """Buttons that let a body go or throw it; a click on the sphere lets it go with that direction
    downward."""

    def __init__(self, exhibit: Exhibit, odds: Odds) -> None:
        self._exhibit = exhibit
        self._odds = odds
        self._rng = np.random.default_rng()
        self._page: Any = None

    def build(self, page: Page) -> None:
        """Add the GUI elements."""
        self._page, gui = page, page.gui
        gui.add_html(
            '<div class="dd"><p class="note">Click a bar to stand it so. Click the sphere to let '
            "it go with that direction downward; the orange dot is what points down.</p></div>"
        )
        ways = gui.add_button_group(
            "Watch",
            (LET_GO, THROW, THROW_SO),
            hint="It rolls without momentum, or is thrown, with any side or the present one down",
        )
        acts = {
            LET_GO: self._let_go_anyhow,
            THROW: lambda: self._throw(None),
            THROW_SO: lambda: self._throw(self._exhibit.down),
        }
        ways.on_click(lambda _: page.soon(acts[ways.value]))
        self._exhibit.on_direction = self._let_go

    def _let_go_anyhow(self) -> None:
        way = self._rng.normal(size=3)
        self._let_go(way / np.linalg.norm(way))

    def _let_go(self, down: Floats) -> None:
        viewed = self._exhibit.viewed
        if viewed is not None:
            motion = let_go(viewed, self._exhibit.pose, down)
            self._exhibit.move(motion, lambda: self._say_end(viewed, "It came to rest on"))

    def _throw(self, down: Floats | None) -> None:
        viewed = self._exhibit.viewed
        if viewed is None:
            return
        table = table_named(self._odds.table or USUAL_TABLE)
        seed = int(self._rng.integers(2**31))
        self._page.start(
            lambda job: (viewed, throw_film(viewed.rigid, table, seed, down)),
            lambda thrown: self._watch(*thrown),
        )

    def _watch(self, viewed: ViewedBody, film: Film) -> None:
        if self._exhibit.viewed is viewed:
            told = f"Thrown onto {film.table.name}, it came to rest on"
            motion = filmed(film, viewed.center)
            self._exhibit.move(motion, lambda: self._say_end(viewed, told))

    def _say_end(self, viewed: ViewedBody, told: str) -> None:
        rest = int(angle_between(viewed.poses.normals, self._exhibit.down).argmin())
        self._page.say(f"{told} {viewed.rows[viewed.row_of_rest[rest]].label}.")
