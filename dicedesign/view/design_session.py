"""Design a die in a thread, and show each step; a changed request restarts the solver."""

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
from dicedesign.optimize.targets import Target
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.results.parts import Status
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats

SHAPE_FILE: Final = "shape.obj"
"""File of the shape that a design continues from, beside its recipe."""


@dataclass(frozen=True)
class DieRequest:
    """Request for a die.

    Attributes
    ----------
    target: entries of a recipe's `target`.
    name: name of the die.
    seed: random seed.
    method: "exact" or "paper".
    start: entries of a recipe's `start`; None chooses a start for the method.
    prefer: weights of the preferences, in the exact method and in the finish of the paper's.
    weights: weights of the paper's energy.
    """

    target: Mapping[str, Any]
    name: str = "die"
    seed: int = 0
    method: str = "exact"
    start: Mapping[str, Any] | None = None
    prefer: Preferences = field(default_factory=legible)
    weights: PaperWeights = field(default_factory=PaperWeights)

    def recipe(self, *, from_shape: bool = False) -> Recipe:
        """Recipe of the request.

        from_shape: the design continues from the shape in `SHAPE_FILE`.

        Raises RecipeError: an entry cannot be used.
        """
        is_paper = self.method == "paper"
        start = {"mesh": {"path": SHAPE_FILE}} if from_shape else self.start
        options: dict[str, Any] = {"prefer": self.prefer.as_dict()}
        if is_paper:
            options["weights"] = self.weights.as_dict()
        if is_paper and from_shape:
            options["perturbation"] = 0.0
        entries: dict[str, Any] = {"name": self.name, "seed": self.seed, "target": self.target}
        if is_paper and not start:
            outcomes = len(parse_recipe(entries).target.target().face_labels)
            start = {"repulsion" if outcomes >= FEWEST_FACETS else "prism": {}}
        entries["start"] = start or {"search": {}}
        return parse_recipe(entries | {"method": {self.method: options}})


SAME_COORDINATES: Final = 1e-9
"""Largest difference between coordinates of equal shapes, whose size is about 1."""


@dataclass(frozen=True, eq=False)
class DesignedShape:
    """Convex die of uniform density after a step of a design, in an arbitrary unit.

    Attributes
    ----------
    hull: convex hull.
    directions: (f, 3) directions of the labeled faces, in the order of the target.
    target: their labels and probabilities.
    terms: weighted terms of the energy of the step, by name.
    """

    hull: ConvexHull
    directions: Floats
    target: Target
    terms: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def poses(self) -> RestPoses:
        """Rests of the forward model."""
        return analyze(self.hull, self.hull.centroid, "uniform solid")

    @cached_property
    def outcomes(self) -> OutcomeProbabilities:
        """Probabilities of the outcomes and of all other rests."""
        return outcome_probabilities(self.poses, self.directions, self.target.outcome_of_face)

    @property
    def error(self) -> float:
        """Largest |p - q|, or the probability of all other rests if that is larger."""
        return self.outcomes.error(self.target.probabilities)

    def equals(self, other: DesignedShape) -> bool:
        """Whether the corners and the directions of the outcomes are equal up to rounding."""
        pairs = (
            (self.hull.vertices, other.hull.vertices),
            (self.directions, other.directions),
        )
        return all(
            len(first) == len(second) and bool(np.abs(first - second).max() < SAME_COORDINATES)
            for first, second in pairs
        )


State = Literal["new", "running", "done", "failed"]


class DesignSession:
    """Design of one die in a thread.

    Attributes
    ----------
    request: current request; recipe: its recipe.
    shape: current shape, or None before the first; steps: number of steps that led to it.
    starts: number of starting shapes that the search has tried.
    message: why the solver stopped or failed; empty before.
    status: result of the last run of the solver; None before it, and after a change.
    final_design: design that the solver ended with, or None.
    follows_recipe: nothing was changed, so that `dicedesign run` makes this die.
    """

    def __init__(
        self,
        request: DieRequest,
        on_change: Callable[[], None] = lambda: None,
        step_seconds: float = 0.0,
    ) -> None:
        """Prepare a session. It starts with `run`.

        on_change: called from any thread after every change. step_seconds: least duration of a
        step, so that it can be seen. Raises InputError as `DieRequest.recipe`.
        """
        self.request, self.recipe = request, request.recipe()
        self.on_change, self._step_seconds = on_change, step_seconds
        self.shape: DesignedShape | None = None
        self.steps, self.starts, self.message = 0, 0, ""
        self.status: Status | None = None
        self.final_design: Design | None = None
        self.follows_recipe = True
        self._turn = threading.Condition()
        self._has_changed, self._is_closed = False, False
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> State:
        """Activity of the session; "new" before its start and after a change."""
        with self._turn:
            if self._thread is not None:
                return "running"
            if self.status is not None:
                return "done"
            return "failed" if self.message else "new"

    @property
    def target(self) -> Target:
        """Labeled faces and their target probabilities."""
        return self.recipe.target.target()

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the outcomes."""
        return self.target.labels

    def snapshot(self) -> tuple[DesignedShape | None, Design | None, bool]:
        """Consistent values of `shape`, `final_design` and `follows_recipe`."""
        with self._turn:
            return self.shape, self.final_design, self.follows_recipe

    def run(self) -> None:
        """Design until the solver ends, from the current shape if there is one."""
        with self._turn:
            if self.status is not None or self._thread is not None:
                return
            self.message = ""
            self._thread = threading.Thread(target=self._work, name="design", daemon=True)
            self._thread.start()
        self.on_change()

    def change(self, request: DieRequest) -> None:
        """Continue from the current shape with another request.

        Raises InputError: the request cannot be used, or has other outcomes; then nothing changes.
        """
        recipe = request.recipe(from_shape=self.shape is not None)
        labels, own = recipe.target.target().face_labels, self.target.face_labels
        if self.shape is not None and labels != own:
            raise InputError(
                f"target: expected the labels of this die, {', '.join(own)}, got "
                f"{', '.join(labels)}; press Reset first"
            )
        with self._turn:
            if request != self.request:
                self.request, self.recipe = request, recipe
                if self.shape is not None:
                    self.shape = replace(self.shape, target=self.target)
                self._outdate()
        self.on_change()

    def swap(self, first: str, second: str) -> None:
        """Swap two labels; a second swap reverts it.

        Raises InputError: a label is unknown, one has more faces than the other, or there is no
        shape yet.
        """
        for label in (first, second):
            if label not in self.labels:
                raise InputError(
                    f"label: expected one of {', '.join(self.labels)}, got {label!r}; correct it"
                )
        of_face = np.array(self.target.face_labels)
        faces, others = np.flatnonzero(of_face == first), np.flatnonzero(of_face == second)
        if len(faces) != len(others):
            raise InputError(
                f"label: expected one with as many faces as {first!r}, {len(faces)}, got "
                f"{second!r} with {len(others)}; choose another"
            )
        with self._turn:
            shape = self.shape
            if shape is None:
                raise InputError("label: expected a shape with labels, got none yet; design one")
            directions = shape.directions.copy()
            directions[faces], directions[others] = directions[others], directions[faces].copy()
            self.shape = replace(shape, directions=directions)
            self._outdate()
        self.on_change()

    def close(self) -> None:
        """End the thread at its next step."""
        with self._turn:
            self._is_closed = True
            self._turn.notify_all()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until nothing runs, for at most `seconds`; return whether nothing runs."""
        with self._turn:
            return self._turn.wait_for(lambda: self._thread is None, seconds)

    def _outdate(self) -> None:
        """Restart the solver at its next step, or with `run`."""
        self.follows_recipe = self.follows_recipe and self.shape is None
        self.status, self.final_design, self.message = None, None, ""
        self._has_changed = True
        self._turn.notify_all()

    def _work(self) -> None:
        """In the thread: run the solver until it ends, and again after each change."""
        while True:
            message, status, die = "", None, None
            with self._turn:
                self._has_changed = False
                request, origin = self.request, self.shape
            try:
                die = self._design(request, origin)
                status, message = die.status, die.status.value
            except _Stopped:
                if self._is_closed:
                    return
                continue
            except DiceError as error:
                message = str(error)
            except Exception as error:
                message = f"unexpected error, {type(error).__name__}: {error}"
            with self._turn:
                if self._has_changed:
                    continue
                self.message, self.status, self.final_design = message, status, die
                if die is not None:
                    # The best die may come from an earlier step.
                    end = DesignedShape(die.hull, die.directions, self.target, die.terms or {})
                    if self.shape is None or not end.equals(self.shape):
                        self.shape = end
                self._thread = None
                self._turn.notify_all()
            self.on_change()
            return

    def _design(self, request: DieRequest, origin: DesignedShape | None) -> Design:
        """In the thread: run the stages up to the design, from a shape or from the recipe's start.

        origin: the shape, or None.
        """
        recipe = request.recipe(from_shape=origin is not None)
        target, before = recipe.target.target(), origin
        next_shape: tuple[ConvexHull, Floats] | None = None

        def on_start(number: int) -> None:
            self._require_current()
            self.starts = number + 1
            self.on_change()

        def on_shape(hull: ConvexHull, directions: Floats) -> None:
            nonlocal next_shape
            next_shape = hull, directions

        def on_step(step: Step) -> None:
            nonlocal next_shape, before
            start = time.monotonic()
            if next_shape is None:
                # The solver returned to an earlier shape; the final design has it.
                return
            shape = DesignedShape(*next_shape, target, step.terms)
            previous, before, next_shape = before, None, None
            if previous is None or not shape.equals(previous):
                with self._turn:
                    self._require_current()
                    self.shape, self.steps = shape, self.steps + 1
                self.on_change()
            with self._turn:
                pause = start + self._step_seconds - time.monotonic()
                self._turn.wait_for(lambda: self._is_closed or self._has_changed, max(pause, 0.0))
                self._require_current()

        callbacks = Callbacks(on_start=on_start, on_shape=on_shape, on_step=on_step)
        work = Work(recipe, callbacks=callbacks)
        if origin is None:
            run_stages(work, last="design")
        else:
            work.start = Start(origin.hull.vertices, origin.directions)
            run_stages(work, after="start", last="design")
        return work.die

    def _require_current(self) -> None:
        """In the thread: raise _Stopped after `close` or a change."""
        with self._turn:
            if self._is_closed or self._has_changed:
                raise _Stopped


class _Stopped(BaseException):
    """The session is closed, or the solver restarts with another request or shape."""
