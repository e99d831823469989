"""A session in which a die is designed: its run begins anew where what is asked for changes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.fabricate.die import Design
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.view.design_run import (
    Abandoned,
    DesignedShape,
    DesignRun,
    DieRequest,
    Outdated,
    StepGate,
)

State = Literal["running", "paused", "done", "failed"]


class DesignSession:
    """The design of one die.

    Attributes
    ----------
    request: what is asked for; recipe: the same, checked.
    shapes: every one so far, the first being the start, the last the present one; those that were
        undone are not among them.
    starts: how many starting shapes have been looked for.
    message: why the solver stopped, or could not go on; empty before.
    status: how the last run of the solver ended; None before, and after a change.
    designed: the die that it ended with, or None.
    is_straight: whether `dicedesign run` comes to the same die by the recipe alone: nothing was
        undone or changed on the way.
    """

    def __init__(
        self,
        request: DieRequest,
        on_change: Callable[[], None] = lambda: None,
        least_seconds: float = 0.0,
    ) -> None:
        """A session that begins once it is told to.

        Parameters
        ----------
        request: of the die.
        on_change: called from any thread after anything has changed.
        least_seconds: that each step takes at least, to be watched.

        Raises InputError as `DieRequest.recipe`.
        """
        self.request, self.recipe = request, request.recipe()
        self.on_change = on_change
        self.shapes: tuple[DesignedShape, ...] = ()
        self.starts, self.message = 0, ""
        self.status: Status | None = None
        self.designed: Design | None = None
        self.is_straight = True
        self._gate = StepGate(lambda: self.on_change(), least_seconds)
        self._turn = self._gate.turn
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> State:
        """What the session is doing; paused also before it has begun."""
        with self._turn:
            if self._thread is not None:
                return "paused" if self._gate.is_held else "running"
            if self._gate.has_changed:
                return "paused"
            if self.status is not None:
                return "done"
            return "failed" if self.message else "paused"

    @property
    def target(self) -> Floats:
        """(k,) wanted odds."""
        return self.recipe.target.target().probabilities

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the outcomes."""
        return self.recipe.target.target().labels

    @property
    def shape(self) -> DesignedShape | None:
        """The present one, or None before there is any."""
        shapes = self.shapes
        return shapes[-1] if shapes else None

    def end(self) -> tuple[DesignedShape | None, Design | None, bool]:
        """The present shape, the die that the solver ended with, if it did and has it, and whether
        that is the die of the recipe (`is_straight`)."""
        with self._turn:
            return self.shape, self.designed, self.is_straight

    @property
    def least_seconds(self) -> float:
        """That each step takes at least, to be watched."""
        return self._gate.least_seconds

    @least_seconds.setter
    def least_seconds(self, seconds: float) -> None:
        self._gate.least_seconds = seconds

    def run(self) -> None:
        """Go on until the solver ends."""
        self._go(None)

    def step(self) -> None:
        """Make one step, and pause."""
        self._go(1)

    def pause(self) -> None:
        """Stop after the step that is being made."""
        self._gate.allow(0)
        self.on_change()

    def undo(self) -> None:
        """Pause, and go back to the shape before the present one; to the first at most."""
        with self._turn:
            self._gate.allow(0)
            if len(self.shapes) > 1:
                self.shapes = self.shapes[:-1]
                self._note_change()
        self.on_change()

    def change(self, request: DieRequest) -> None:
        """Ask for another die from the next step on, from the present shape.

        Raises InputError where it cannot be asked for, or has other outcomes; then nothing changes.
        """
        recipe = request.recipe(goes_on=bool(self.shapes))
        labels = recipe.target.target().labels
        if self.shapes and labels != self.labels:
            raise InputError(
                f"target: expected the labels of this die, {', '.join(self.labels)}, got "
                f"{', '.join(labels)}; begin anew"
            )
        strange = [label for label in request.pinned if label not in labels]
        if strange:
            raise InputError(
                f"pinned: expected labels out of {', '.join(labels)}, got {strange[0]!r}; correct "
                "it"
            )
        with self._turn:
            if request != self.request:
                before = self.target
                self.request, self.recipe = request, recipe
                if not np.array_equal(before, self.target):
                    self.shapes = tuple(replace(s, target=self.target) for s in self.shapes)
                self._note_change()
        self.on_change()

    def swap(self, first: str, second: str) -> None:
        """Let two labels change places; facets that are pinned stay so. It is a step that can be
        undone. Raises InputError for another label, and before there is a shape."""
        places = []
        for label in (first, second):
            if label not in self.labels:
                raise InputError(
                    f"label: expected one of {', '.join(self.labels)}, got {label!r}; correct it"
                )
            places.append(self.labels.index(label))
        with self._turn:
            shape = self.shape
            if shape is None:
                raise InputError("label: expected a shape to bear it, got none yet; design one")
            directions = shape.directions.copy()
            directions[places] = directions[places[::-1]]
            other = {first: second, second: first}
            pinned = tuple(other.get(label, label) for label in self.request.pinned)
            self.request = replace(self.request, pinned=pinned)
            self.shapes = (*self.shapes, replace(shape, directions=directions))
            self._note_change()
        self.on_change()

    def close(self) -> None:
        """End the thread at its next step, if there is one; the session is of no more use."""
        self._gate.close()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until nothing runs; whether that is so after so many seconds."""
        with self._turn:
            return self._turn.wait_for(lambda: self._thread is None or self._gate.is_held, seconds)

    def _go(self, steps: int | None) -> None:
        with self._turn:
            if self.status is not None and not self._gate.has_changed:
                # There is nothing left to do.
                return
            self._gate.allow(steps)
            if self._thread is None:
                self.message = ""
                self._thread = threading.Thread(target=self._work, name="design", daemon=True)
                self._thread.start()
        self.on_change()

    def _note_change(self) -> None:
        self.is_straight = self.is_straight and not self.shapes
        self.status, self.designed, self.message = None, None, ""
        self._gate.outdate()

    def _work(self) -> None:
        """Run the solver, again after each change, until it ends."""
        while True:
            message, status, die = "", None, None
            try:
                self._gate.begin()
                die = DesignRun(
                    self.request, self.shape, self._gate, self._note_start, self._add
                ).designed()
                status, message = die.status, die.status.value
            except Outdated:
                continue
            except Abandoned:
                return
            except DiceError as error:
                message = str(error)
            except Exception as error:
                message = f"an error that nobody foresaw, {type(error).__name__}: {error}"
            with self._turn:
                if self._gate.has_changed:
                    continue
                self.message, self.status, self.designed = message, status, die
                self._take_end()
                self._thread = None
                self._turn.notify_all()
            self.on_change()
            return

    def _note_start(self, number: int) -> None:
        self.starts = number
        self.on_change()

    def _add(self, shape: DesignedShape) -> None:
        with self._turn:
            self._gate.require_current()
            self.shapes = (*self.shapes, shape)
            self._gate.count()
        self.on_change()

    def _take_end(self) -> None:
        """The best die may be none of the last steps."""
        if self.designed is not None:
            die, last = self.designed, self.shapes[-1]
            terms = die.terms or {}
            end = DesignedShape(die.hull, die.directions, last.target, sum(terms.values()), terms)
            if not end.is_like(last):
                self.shapes = (*self.shapes, end)
