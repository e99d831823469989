"""One run of a solver that goes through a gate with each step."""

from __future__ import annotations

import time
from collections.abc import Callable

from dicedesign.fabricate.die import Design
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.recipe.planning.stage import plan
from dicedesign.recipe.planning.work import Listeners, Work
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats
from dicedesign.view.dice.designed_shape import DesignedShape
from dicedesign.view.dice.request import DieRequest
from dicedesign.view.dice.step_gate import StepGate

__all__ = ["DesignRun"]


class DesignRun:
    """A run of the stages that design a die, from the start of its recipe or from a shape.

    The solver is the one of `dicedesign run`; it is held in what it calls after each step.
    """

    def __init__(
        self,
        request: DieRequest,
        origin: DesignedShape | None,
        gate: StepGate,
        on_start: Callable[[int], None],
        on_shape: Callable[[DesignedShape], None],
    ) -> None:
        """A run that has not begun.

        Parameters
        ----------
        request: of the die. origin: the shape to go on from, or None.
        gate: that each step goes through.
        on_start: called with the number of starting shapes that have been looked for.
        on_shape: called with each shape but the origin, before the gate; raises as the gate does
            where nobody wants it any more.
        """
        self._recipe = request.recipe(goes_on=origin is not None)
        self._pinned, self._origin, self._gate = request.pinned, origin, gate
        self._on_start, self._on_shape = on_start, on_shape
        self._told: tuple[ConvexHull, Floats] | None = None

    def designed(self) -> Design:
        """The die at the end. Raises as stages and the gate do."""
        listeners = Listeners(on_start=self._start, on_shape=self._shape, on_step=self._step)
        work = Work(self._recipe, listeners=listeners)
        if self._origin is None:
            plan(work, last="design")
        else:
            labels = work.target.labels
            work.start = self._origin.start(tuple(labels.index(each) for each in self._pinned))
            plan(work, after="start", last="design")
        return work.die

    def _start(self, number: int) -> None:
        self._gate.hold()
        self._on_start(number + 1)

    def _shape(self, hull: ConvexHull, directions: Floats) -> None:
        self._told = hull, directions

    def _step(self, step: Step) -> None:
        began, told = time.monotonic(), self._told
        if told is None:
            # Back to a shape that was told before; the die at the end has it.
            return
        target = self._recipe.target.target().probabilities
        shape = DesignedShape(*told, target, step.energy, step.terms)
        origin, self._origin, self._told = self._origin, None, None
        if origin is None or not shape.is_like(origin):
            self._on_shape(shape)
        self._gate.wait(began)
