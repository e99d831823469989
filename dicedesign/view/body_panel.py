"""The tab of the body on show: its numbers, bars of its probabilities, and buttons to watch it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.sphere import angle_between
from dicedesign.report.palette import BASINS
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum_model import MomentumModel, momentum_model
from dicedesign.throws.simulation import Film, throw_film
from dicedesign.throws.tables import TABLE_NAMES, table_named
from dicedesign.view.dragging import Dragging
from dicedesign.view.exhibit import Exhibit
from dicedesign.view.motion import filmed, let_go
from dicedesign.view.page import Job, Page, html_part
from dicedesign.view.sources import Source, Tell
from dicedesign.view.viewed_body import ViewedBody

MOST_ROWS: Final = 24
"""Bars of a body with more rests are those of the first."""


def body_html(viewed: ViewedBody, update: int) -> str:
    """Name, counts and center of mass of a body; update: how many changes were shown so far."""
    mesh = viewed.solid.body.triangles
    shape = "the hull that was dragged"
    if not viewed.dragged:
        shape = "points" if mesh is None else f"a mesh of {len(mesh):,} triangles"
    extent = float(np.ptp(viewed.hull.vertices, axis=0).max())
    digits = 6 - int(np.floor(np.log10(extent)))
    # Adding zero takes the sign off a zero.
    center = ", ".join(f"{round(float(x), digits) + 0.0:.10g}" for x in viewed.center)
    margins = np.degrees(viewed.poses.margins)
    leaves = float(margins.min()) if len(margins) > 1 else None
    misses = [abs(row.probabilities - row.wanted) for row in viewed.rows if row.wanted is not None]
    off = max(misses, default=None)
    return html_part("body", viewed, update, shape, viewed.hull, leaves, center, off)


def probabilities_html(viewed: ViewedBody, thrown: Floats | None) -> str:
    """A table of the rows of a body: label, bar, probabilities in percent.

    thrown: (rows,) probabilities on a table, or None.
    """
    shown, others = viewed.rows[:MOST_ROWS], viewed.rows[MOST_ROWS:]
    onto_table = None if thrown is None else thrown[:MOST_ROWS].tolist()
    longest = max(
        1e-9, *(max(row.probabilities, row.wanted or 0.0) for row in shown), *(onto_table or ())
    )
    rest = sum(row.probabilities for row in others)
    return html_part("probabilities", viewed, shown, onto_table, longest, BASINS, len(others), rest)


NO_TABLE: Final = "no table: set down gently"


class Probabilities:
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
            hint="What momentum does to the probabilities, by the momentum model of a table",
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
        self._bars.content = probabilities_html(viewed, thrown)

    def _stand(self, place: int) -> None:
        viewed = self._exhibit.viewed
        if viewed is None or place >= len(viewed.rows):
            return
        row = viewed.rows[place]
        if row.rest < 0:
            self._exhibit.page.say(f"{row.label}: there is no facet on which the die shows it")
        else:
            self._exhibit.stand(row.rest)


LET_GO: Final = "Let it go"
THROW: Final = "Throw it"
THROW_SO: Final = "Throw it as it lies"

USUAL_TABLE: Final = "board-game"


class Watching:
    """Buttons that let a body go or throw it; a click on the sphere lets it go with that direction
    downward."""

    def __init__(self, exhibit: Exhibit, probabilities: Probabilities) -> None:
        self._exhibit = exhibit
        self._probabilities = probabilities
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
        table = table_named(self._probabilities.table or USUAL_TABLE)
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


SILENCE: Final = 1.0
"""Seconds between two lines about progress on a terminal."""


class BodyPanel:
    """Bars, handles and throws of the body on show.

    source: of bodies to choose from, or None.
    """

    title = "Body"

    def __init__(self, exhibit: Exhibit, source: Source | None) -> None:
        self._exhibit = exhibit
        self._source = source
        self._probabilities = Probabilities(exhibit)
        self._dragging = Dragging(exhibit)
        self._watching = Watching(exhibit, self._probabilities)
        self._page: Any = None
        self._loading: Job | None = None

    def build(self, page: Page) -> None:
        """Add the GUI elements; called once, within the tab."""
        self._page, gui = page, page.gui
        if self._source is not None and len(self._source.names) > 1:
            chosen = gui.add_dropdown("File", self._source.names)
            chosen.on_update(lambda _: page.soon(lambda: self.load(chosen.value), "file"))
        self._probabilities.build(page)
        with gui.add_folder("Change it"):
            self._dragging.build(page)
            save = gui.add_button("Download STL", hint="The hull as it is now")
        with gui.add_folder("Watch it"):
            self._watching.build(page)

        @save.on_click
        def _(event: Any) -> None:
            page.soon(lambda: self._save(event.client))

        self._exhibit.on_show(self._dragging.begin)

    def load(self, name: str, on_error: Callable[[Exception], None] | None = None) -> None:
        """Show another body of the source, when it is read or designed; on_error: as of
        `Page.start`."""
        source, page = self._source, self._page
        if source is None:
            return
        if self._loading is not None:
            self._loading.stop()
        self._loading = page.start(
            lambda job: source.load(name, Tell(_told_twice(job), self._preview)),
            self._exhibit.show,
            on_error=on_error,
        )

    def _preview(self, hull: ConvexHull) -> None:
        self._page.soon(lambda: self._exhibit.preview(hull))

    def _save(self, client: Any) -> None:
        viewed: ViewedBody | None = self._exhibit.viewed
        if viewed is None:
            return
        if not viewed.follows:
            self._page.say(
                "A file of one density has its center of mass where that of its solid is, not "
                "where it was dragged to; a cavity or weights can put it there."
            )
        hull = viewed.hull
        name = "".join(c if c.isalnum() or c in "-_" else "_" for c in viewed.name)
        self._page.download(client, f"{name}_hull.stl", stl_bytes(hull.vertices, hull.triangles))


def _told_twice(job: Job) -> Callable[[str], None]:
    """Tells of progress on the page, and on a terminal where there is one."""
    last = -SILENCE

    def told(words: str) -> None:
        nonlocal last
        job.progress(words)
        now = time.monotonic()
        if now - last >= SILENCE and sys.stderr.isatty():
            last = now
            print(f"note: {words}", file=sys.stderr, flush=True)

    return told
