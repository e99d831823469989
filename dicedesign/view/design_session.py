"""A session in which a die is designed step by step: its run begins anew where what is asked for
changes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.fabricate.die import Design
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.options import PaperWeights, legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import FEWEST_FACETS, Start
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.results.parts import Status
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats

SHAPE_FILE: Final = "shape.off"
"""The shape that a design goes on from, beside its recipe."""


@dataclass(frozen=True)
class DieRequest:
    """A die to be designed.

    Attributes
    ----------
    target: entries of a recipe's `target`.
    name: of the die.
    seed: of everything random.
    method: "exact" or "paper".
    start: entries of a recipe's `start`; None for what suits the method.
    prefer: weights of the exact method, and of the paper's after its finish.
    weights: of the paper's energy.
    pinned: labels of the outcomes whose facets stay in their planes.
    """

    target: Mapping[str, Any]
    name: str = "die"
    seed: int = 0
    method: str = "exact"
    start: Mapping[str, Any] | None = None
    prefer: Preferences = field(default_factory=legible)
    weights: PaperWeights = field(default_factory=PaperWeights)
    pinned: tuple[str, ...] = ()

    def recipe(self, *, goes_on: bool = False) -> Recipe:
        """The checked recipe.

        goes_on: whether the design starts from a shape that is there, that of `SHAPE_FILE`.

        Raises RecipeError where an entry cannot be used, and InputError where facets are pinned
        and the method moves none.
        """
        if self.pinned and self.method != "exact":
            raise InputError(
                "pinned: expected none with the paper's method, which moves corners and keeps no "
                f"facet, got {', '.join(self.pinned)}; unpin, or take the exact method"
            )
        start = {"mesh": {"path": SHAPE_FILE}} if goes_on else self.start
        recipe = parse_recipe(self._entries(start or {"search": {}}, "exact"))
        if self.method == "exact":
            return recipe
        outcomes = len(recipe.target.target().labels)
        suits: dict[str, Any] = {"repulsion" if outcomes >= FEWEST_FACETS else "prism": {}}
        return parse_recipe(self._entries(start or suits, self.method, goes_on))

    def _entries(
        self, start: Mapping[str, Any], method: str, goes_on: bool = False
    ) -> dict[str, Any]:
        options: dict[str, Any] = {"prefer": self.prefer.as_dict()}
        if method == "paper":
            options["weights"] = self.weights.as_dict()
            if goes_on:
                # What was reached is not shaken again.
                options["perturbation"] = 0.0
        return {
            "name": self.name,
            "seed": self.seed,
            "target": dict(self.target),
            "start": dict(start),
            "method": {method: options},
        }


SAME: Final = 1e-9
"""Largest difference of coordinates, whose extent is about 1, of corners that count as the same."""


@dataclass(frozen=True, eq=False)
class DesignedShape:
    """A convex die as designed so far, in a unit of the design's own.

    Attributes
    ----------
    hull: the shape, of uniform density.
    directions: (k, 3) down in the outcomes, in the order of the target.
    target: (k,) wanted probabilities.
    terms: weighted terms by name of the energy that the step to it has lowered.
    """

    hull: ConvexHull
    directions: Floats
    target: Floats
    terms: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def poses(self) -> RestPoses:
        """Its rests, by the forward model."""
        return analyze(self.hull, self.hull.centroid, "uniform solid")

    @cached_property
    def outcomes(self) -> OutcomeProbabilities:
        """Probabilities of the outcomes, and of all other rests."""
        return outcome_probabilities(self.poses, self.directions)

    @property
    def error(self) -> float:
        """Largest |p - q|, or the probabilities of all other rests where these are larger."""
        return self.outcomes.error(self.target)

    def is_like(self, other: DesignedShape) -> bool:
        """True for the same corners and outcomes, but for rounding."""
        return all(
            len(first) == len(second) and bool(np.abs(first - second).max() < SAME)
            for first, second in (
                (self.hull.vertices, other.hull.vertices),
                (self.directions, other.directions),
            )
        )


State = Literal["running", "paused", "done", "failed"]


class DesignSession:
    """The design of one die, in a thread that waits before each step until it may make it.

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
    least_seconds: that each step takes at least, to be watched, where any number may be made.
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
        least_seconds: see above.

        Raises InputError as `DieRequest.recipe`.
        """
        self.request, self.recipe = request, request.recipe()
        self.on_change, self.least_seconds = on_change, least_seconds
        self.shapes: tuple[DesignedShape, ...] = ()
        self.starts, self.message = 0, ""
        self.status: Status | None = None
        self.designed: Design | None = None
        self.is_straight = True
        self._turn = threading.Condition()
        self._steps_left: int | None = 0
        self._is_held, self._has_changed, self._is_closed = False, False, False
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> State:
        """What the session is doing; paused also before it has begun."""
        with self._turn:
            if self._thread is not None:
                return "paused" if self._is_held else "running"
            if self._has_changed:
                return "paused"
            if self.status is not None:
                return "done"
            return "failed" if self.message else "paused"

    @property
    def target(self) -> Floats:
        """(k,) wanted probabilities."""
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

    def run(self, steps: int | None = None) -> None:
        """Make so many steps, and pause; None for all until the solver ends."""
        with self._turn:
            if self.status is not None and not self._has_changed:
                # There is nothing left to do.
                return
            self._allow(steps)
            if self._thread is None:
                self.message = ""
                self._thread = threading.Thread(target=self._work, name="design", daemon=True)
                self._thread.start()
        self.on_change()

    def step(self) -> None:
        """Make one step, and pause."""
        self.run(1)

    def pause(self) -> None:
        """Stop after the step that is being made."""
        self._allow(0)
        self.on_change()

    def undo(self) -> None:
        """Pause, and go back to the shape before the present one; to the first at most."""
        with self._turn:
            self._allow(0)
            if len(self.shapes) > 1:
                self.shapes = self.shapes[:-1]
                self._outdate()
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
                self._outdate()
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
            self._outdate()
        self.on_change()

    def close(self) -> None:
        """End the thread at its next step, if there is one; the session is of no more use."""
        with self._turn:
            self._is_closed = True
            self._turn.notify_all()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until nothing runs; whether that is so after so many seconds."""
        with self._turn:
            return self._turn.wait_for(lambda: self._thread is None or self._is_held, seconds)

    def _allow(self, steps: int | None) -> None:
        """Let so many steps through from now on, None for any number."""
        with self._turn:
            self._steps_left = steps
            self._is_held = self._is_held and steps == 0
            self._turn.notify_all()

    def _outdate(self) -> None:
        """Have the thread begin again at its next step."""
        self.is_straight = self.is_straight and not self.shapes
        self.status, self.designed, self.message = None, None, ""
        self._has_changed = True
        self._turn.notify_all()

    def _work(self) -> None:
        """In the thread: run the solver, again after each change, until it ends."""
        while True:
            message, status, die = "", None, None
            try:
                self._hold()
                with self._turn:
                    self._has_changed = False
                    request, origin = self.request, self.shape
                die = self._design(request, origin)
                status, message = die.status, die.status.value
            except _Outdated:
                continue
            except _Abandoned:
                return
            except DiceError as error:
                message = str(error)
            except Exception as error:
                message = f"an error that nobody foresaw, {type(error).__name__}: {error}"
            with self._turn:
                if self._has_changed:
                    continue
                self.message, self.status, self.designed = message, status, die
                if die is not None:
                    # The best die may be none of the last steps.
                    end = DesignedShape(die.hull, die.directions, self.target, die.terms or {})
                    if not end.is_like(self.shapes[-1]):
                        self.shapes = (*self.shapes, end)
                self._thread = None
                self._turn.notify_all()
            self.on_change()
            return

    def _design(self, request: DieRequest, origin: DesignedShape | None) -> Design:
        """In the thread: run the stages that design a die, from the start of its recipe or from a
        shape, and wait in what the solver calls after each step."""
        recipe = request.recipe(goes_on=origin is not None)
        target, before = recipe.target.target(), origin
        reported: tuple[ConvexHull, Floats] | None = None

        def on_start(number: int) -> None:
            self._hold()
            self._require_current()
            self.starts = number + 1
            self.on_change()

        def on_shape(hull: ConvexHull, directions: Floats) -> None:
            nonlocal reported
            reported = hull, directions

        def on_step(step: Step) -> None:
            nonlocal reported, before
            began = time.monotonic()
            if reported is None:
                # Back to a shape that was reported before; the die at the end has it.
                return
            shape = DesignedShape(*reported, target.probabilities, step.terms)
            first, before, reported = before, None, None
            if first is None or not shape.is_like(first):
                with self._turn:
                    self._require_current()
                    self.shapes = (*self.shapes, shape)
                    if self._steps_left is not None:
                        self._steps_left = max(self._steps_left - 1, 0)
                self.on_change()
            with self._turn:
                rest = began + self.least_seconds - time.monotonic()
                if self._steps_left is None and rest > 0.0:
                    self._turn.wait_for(lambda: self._is_closed or self._has_changed, rest)
            self._hold()
            self._require_current()

        callbacks = Callbacks(on_start=on_start, on_shape=on_shape, on_step=on_step)
        work = Work(recipe, callbacks=callbacks)
        if origin is None:
            run_stages(work, last="design")
        else:
            pinned = tuple(target.labels.index(label) for label in request.pinned)
            work.start = Start(origin.hull.vertices, origin.directions, pinned=pinned)
            run_stages(work, after="start", last="design")
        return work.die

    def _hold(self) -> None:
        """In the thread: wait until there is a step to be made. Raises _Abandoned."""
        with self._turn:
            is_held = self._is_held = self._steps_left == 0
            self._turn.notify_all()
        if is_held:
            self.on_change()
        with self._turn:
            self._turn.wait_for(lambda: self._steps_left != 0 or self._is_closed)
            self._is_held = False
            if self._is_closed:
                raise _Abandoned

    def _require_current(self) -> None:
        """In the thread: raise _Outdated or _Abandoned where that is so."""
        with self._turn:
            if self._is_closed:
                raise _Abandoned
            if self._has_changed:
                raise _Outdated


class _Outdated(BaseException):
    """What a thread works on has changed: it begins again."""


class _Abandoned(BaseException):
    """Nobody waits for what a thread works on: it ends."""
