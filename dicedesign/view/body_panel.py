"""Tab "Body": properties and probabilities of the body, and buttons that change and throw it."""

from __future__ import annotations

from typing import Any

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.sphere import angle_between
from dicedesign.palette import BASINS
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.throws.momentum_model import MomentumMixture, momentum_model
from dicedesign.throws.simulation import simulate, throw_film
from dicedesign.throws.tables import TABLE_NAMES, load_table, mixture_tables
from dicedesign.view.dragging import DragControls
from dicedesign.view.motion import Motion, film_motion, release_motion, turn_motion
from dicedesign.view.page import Job, html_part
from dicedesign.view.sources import Source
from dicedesign.view.viewed_body import ViewedBody
from dicedesign.view.viewport import Viewport

MAX_ROWS = 24
"""Rows of the table of probabilities; the others are summed."""


def body_html(viewed: ViewedBody, update: int) -> str:
    """Name, sizes and center of mass of a body. update: number of changes shown so far."""
    mesh = viewed.shape.body.triangles
    shape = "the dragged hull"
    if not viewed.is_dragged:
        shape = "points" if mesh is None else f"a mesh of {len(mesh):,} triangles"
    extent = float(np.ptp(viewed.hull.vertices, axis=0).max())
    digits = 6 - int(np.floor(np.log10(extent)))
    # Adding zero removes the sign of a zero.
    center = ", ".join(f"{round(float(x), digits) + 0.0:.10g}" for x in viewed.center)
    margins = np.degrees(viewed.poses.margins)
    margin = float(margins.min()) if len(margins) > 1 else None
    errors = [abs(row.probability - row.target) for row in viewed.rows if row.target is not None]
    largest_error = max(errors, default=None)
    return html_part("body", viewed, update, shape, margin, center, largest_error)


def probabilities_html(viewed: ViewedBody, thrown: Floats | None) -> str:
    """Table of the rows of a body: label, bar, probabilities in percent.

    thrown: (rows,) probabilities on a table, or None.
    """
    rows, others = viewed.rows[:MAX_ROWS], viewed.rows[MAX_ROWS:]
    thrown_values = [] if thrown is None else thrown[:MAX_ROWS].tolist()
    values = [max(row.probability, row.target or 0.0) for row in rows]
    longest = max(1e-9, *values, *thrown_values)
    rest = sum(row.probability for row in others)
    return html_part(
        "probabilities", viewed, rows, thrown_values, longest, BASINS, len(others), rest
    )


NO_TABLE = "no table: set down gently"


class ProbabilityControls:
    """Properties of the body, the table of its probabilities, and the choice of a gaming table.

    Attributes
    ----------
    table: name of the gaming table, or None.
    """

    def __init__(self, viewport: Viewport) -> None:
        self.table: str | None = None
        self._viewport, page = viewport, viewport.page
        self._model: MomentumMixture | None = None
        self._updates = 0
        self._facts = page.gui.add_html("")
        table = page.gui.add_dropdown(
            "Thrown onto",
            (NO_TABLE, *TABLE_NAMES),
            hint="Effect of momentum on the probabilities, by the momentum model of a table",
        )
        self._bars = page.gui.add_html("")
        table.on_update(lambda _: page.enqueue(lambda: self._choose(table.value), "table"))
        page.on_action("stand", self._stand)
        viewport.on_change.append(self._refresh)

    def _choose(self, name: str) -> None:
        self.table = None if name == NO_TABLE else name
        self._model = None if self.table is None else momentum_model(self.table)
        self._refresh(self._viewport.viewed)

    def _refresh(self, viewed: ViewedBody) -> None:
        thrown = None
        if self.table is not None:
            try:
                thrown = viewed.throw_probabilities(self._model)
            except DiceError as error:
                self._viewport.page.report_error(error)
        self._updates += 1
        self._facts.content = body_html(viewed, self._updates)
        self._bars.content = probabilities_html(viewed, thrown)

    def _stand(self, index: int) -> None:
        viewed = self._viewport.viewed
        if index >= len(viewed.rows):
            return
        row = viewed.rows[index]
        if row.rest < 0:
            self._viewport.page.notify(f"{row.label}: the die has no resting facet for it")
        else:
            pose = viewed.poses.transforms[row.rest]
            self._viewport.move(turn_motion(viewed.hull, self._viewport.pose, pose))


RELEASE = "Let it go"
THROW = "Throw it"
THROW_FROM_POSE = "Throw from this pose"
THROW_MANY = "Throw 100"

DEFAULT_TABLE = "board-game"

MANY = 100

FEW = 5.0
"""Expected count below which a chi-square test tells little."""

UNLIKELY = 0.05


def describe_tally(counts: Integers, probabilities: Floats, table: str) -> str:
    """Sentence on whether counts (k,) of throws agree with probabilities (k,)."""
    throws = int(counts.sum())
    expected = throws * float(probabilities[probabilities > 0.0].min())
    if expected < FEW:
        enough = FEW / float(probabilities[probabilities > 0.0].min())
        return f"{throws} throws onto {table}; from about {enough:,.0f} on, a test can tell."
    chance = chi_square(counts, probabilities).p_value
    says = f"{throws} throws onto {table}; so far from these probabilities are "
    says += f"{100.0 * chance:.2g} % of dice that have them (chi-square test): "
    return says + (
        "this die hardly has them." if chance < UNLIKELY else "nothing speaks against it."
    )


class MotionControls:
    """Buttons that release or throw the body; a click on the sphere chooses the direction down."""

    def __init__(self, viewport: Viewport, probabilities: ProbabilityControls) -> None:
        self._viewport, page = viewport, viewport.page
        self._probabilities = probabilities
        rng = self._rng = np.random.default_rng()
        page.gui.add_html(
            '<div class="dd"><p class="note">Click a bar to stand the body on that side. Click the '
            "sphere to let it go with that direction down; the orange dot marks the "
            "current down direction."
            "</p></div>"
        )
        buttons = page.gui.add_button_group(
            "Watch",
            (RELEASE, THROW, THROW_FROM_POSE, THROW_MANY),
            hint="It rolls without momentum, or is thrown from a random or its current orientation",
        )
        actions = {
            RELEASE: lambda: self._release(rng.normal(size=3)),
            THROW: lambda: self._throw(None),
            THROW_FROM_POSE: lambda: self._throw(viewport.down),
            THROW_MANY: self._throw_many,
        }
        self._tally = page.gui.add_html("")
        self._counts: tuple[str, Integers] | None = None
        viewport.on_change.append(lambda _: self._forget())
        buttons.on_click(lambda _: page.enqueue(actions[buttons.value]))
        viewport.on_direction = self._release

    def _release(self, down: Floats) -> None:
        viewed = self._viewport.viewed
        motion = release_motion(viewed, self._viewport.pose, down / np.linalg.norm(down))
        self._move(viewed, motion, "It came to rest on")

    def _throw(self, down: Floats | None) -> None:
        viewed = self._viewport.viewed
        table = load_table(self._probabilities.table or DEFAULT_TABLE)
        seed = int(self._rng.integers(2**31))

        def show(motion: Motion) -> None:
            if self._viewport.viewed is viewed:
                self._move(viewed, motion, f"Thrown onto {table.name}, it came to rest on")

        self._viewport.page.start(
            lambda _: film_motion(throw_film(viewed.rigid, table, seed, down), viewed.center), show
        )

    def _throw_many(self) -> None:
        """Count simulated throws onto the chosen table, or onto one without momentum."""
        viewed, name = self._viewport.viewed, self._probabilities.table or "carpet"
        seed = int(self._rng.integers(2**31))

        def count(_: Job) -> Integers:
            throws = simulate(viewed.rigid, mixture_tables(name), MANY, seed)
            by_row = np.bincount(viewed.row_of_rest, throws.counts, len(viewed.rows))
            return np.rint(by_row).astype(np.int64)

        def show(counts: Integers) -> None:
            if self._viewport.viewed is not viewed:
                return
            if self._counts is not None and self._counts[0] == name:
                counts = counts + self._counts[1]
            self._counts = name, counts
            expected = viewed.throw_probabilities(momentum_model(name))
            sentence = describe_tally(counts, expected, name)
            rows = viewed.rows[:MAX_ROWS]
            self._tally.content = html_part("tally", rows, counts.tolist(), BASINS, sentence)

        self._viewport.page.start(count, show)

    def _forget(self) -> None:
        self._counts, self._tally.content = None, ""

    def _move(self, viewed: ViewedBody, motion: Motion, text: str) -> None:
        """Show a motion, and then the rest at its end after a text."""

        def notify() -> None:
            rest = int(angle_between(viewed.poses.normals, self._viewport.down).argmin())
            label = viewed.rows[viewed.row_of_rest[rest]].label
            self._viewport.page.notify(f"{text} {label}.")

        self._viewport.move(motion, notify)


class BodyPanel:
    """Tab with the probabilities, the gizmo and the throws of the body.

    source: bodies to choose from, or None.
    """

    def __init__(self, viewport: Viewport, source: Source | None) -> None:
        self._viewport, page = viewport, viewport.page
        self._load_job: Job | None = None
        if source is not None and len(source.names) > 1:
            file = page.gui.add_dropdown("File", source.names)
            file.on_update(lambda _: page.enqueue(lambda: self._load(source, file.value), "file"))
        probabilities = ProbabilityControls(viewport)
        with page.gui.add_folder("Watch it"):
            MotionControls(viewport, probabilities)
        with page.gui.add_folder("Change it"):
            DragControls(viewport)
            save = page.gui.add_button("Download STL", hint="Current hull")
        save.on_click(lambda event: page.enqueue(lambda: self._save(event.client)))

    def _load(self, source: Source, name: str) -> None:
        """Load another body of the source, and show it."""
        if self._load_job is not None:
            self._load_job.stop()
        self._load_job = self._viewport.page.start(
            lambda job: source.load(name, job.progress), self._viewport.show
        )

    def _save(self, client: Any) -> None:
        viewed, page = self._viewport.viewed, self._viewport.page
        if not viewed.has_uniform_center:
            page.notify(
                "The file is a solid of one density. Its center of mass is the centroid of the "
                "hull, not where you dragged it; a cavity or weights can put it there."
            )
        name = "".join(c if c.isalnum() or c in "-_" else "_" for c in viewed.name)
        page.download(client, f"{name}_hull.stl", stl_bytes(viewed.hull.surface))
