"""The tab "New die": odds become a die, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from dicedesign.errors import DiceError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.recipe.reading import typed_target, written_odds
from dicedesign.view.design_run import PRESETS, DesignedShape, DieRequest
from dicedesign.view.design_session import DesignSession
from dicedesign.view.exhibit import Exhibit
from dicedesign.view.html_parts import html_part
from dicedesign.view.new_die_parts import DieFiles, DieOptions, session_html
from dicedesign.view.page import Job, Page, Stopped
from dicedesign.view.printable_die import PrintableDie
from dicedesign.view.viewed_body import Outcomes, ViewedBody

__all__ = ["NewDiePanel"]

OFTEN: Final = 0.1
"""Seconds between two looks at whether a design was told to stop."""


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
        first = next(iter(PRESETS.values()))
        preset = gui.add_dropdown("Die", tuple(PRESETS))
        self._odds: Any = gui.add_text(
            "Odds", first.odds, hint="1/2, 1/3, 1/6; or fair: 7, binomial: 4, sum_of_dice: [6, 6]"
        )
        self._labels: Any = gui.add_text(
            "Labels", first.labels, hint="one for each, commas between them; empty: 1, 2, ..."
        )
        self._wrong = gui.add_html("")
        design = gui.add_button("Design", color="blue", hint="begin, or go on after a pause")
        steps = gui.add_button_group("", ("Pause", "Step", "Undo", "Reset"))
        self._state, self._refused = gui.add_html(""), gui.add_html("")
        self._files = DieFiles(page, lambda: self._session, self._show_made)
        self._options = DieOptions(page, self._weigh, self._set_speed)
        preset.on_update(lambda event: page.soon(lambda: self._take(event.target.value), "preset"))
        for text in (self._odds, self._labels):
            text.on_update(lambda _: page.soon(self._check, "target"))
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
        preset = PRESETS[name]
        self._odds.value, self._labels.value = preset.odds, preset.labels
        self._check()

    def _take_over(self, viewed: ViewedBody) -> None:
        """Offer the odds of another die that is on show, to design one like it."""
        shown = viewed.outcomes
        if viewed is self._own or shown is None or shown.target is None:
            return
        self._odds.value = written_odds(shown.target.tolist())
        self._labels.value = ", ".join(shown.labels)
        self._check()

    def _asked(self) -> DieRequest | None:
        """What the fields ask for, or None where they cannot; then the page says why."""
        try:
            labels = self._labels.value.strip()
            target = typed_target(self._odds.value, labels or None)
            asked = self._options.request(target)
            asked.recipe()
        except DiceError as error:
            self._wrong.content = html_part("sentence", "target-error", str(error), True)
            return None
        self._wrong.content = ""
        return asked

    def _check(self) -> None:
        self._asked()

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
