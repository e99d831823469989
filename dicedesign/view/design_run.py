"""A run of the design of a new die: what is asked for, its shapes, and a gate for its steps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.die import Design
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.options import PaperWeights, legible
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.starts.start import FEWEST_FACETS, Start
from dicedesign.recipe.pipeline import Listeners, Work, run_stages
from dicedesign.recipe.reading import checked_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.outcomes import OutcomeOdds, outcome_odds
from dicedesign.rest.poses import RestPoses, analyse
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True)
class Preset:
    """What goes into the fields of a new die; empty labels are those of the odds."""

    odds: str
    labels: str = ""


PRESETS: Final = {
    "Two dice in one (2d6)": Preset("sum_of_dice: [6, 6]"),
    "Two small dice in one (2d4)": Preset("sum_of_dice: [4, 4]"),
    "Fair, 3 sides": Preset("fair: 3"),
    "Fair, 5 sides": Preset("fair: 5"),
    "Fair, 7 sides": Preset("fair: 7"),
    "Heads of 4 coins (binomial)": Preset("binomial: 4"),
    "A coin that can stand": Preset("1/2, 1/3, 1/6", "heads, tails, edge"),
    "Loaded: 6 twice as often": Preset("1/7, 1/7, 1/7, 1/7, 1/7, 2/7"),
    "Yes, no, perhaps": Preset("0.45, 0.45, 0.1", "yes, no, perhaps"),
}
"""By what the page calls them."""


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
        recipe = checked_recipe(self._entries(start or {"search": {}}, "exact"))
        if self.method == "exact":
            return recipe
        outcomes = len(recipe.target.target().labels)
        suits: dict[str, Any] = {"repulsion" if outcomes >= FEWEST_FACETS else "prism": {}}
        return checked_recipe(self._entries(start or suits, self.method, goes_on))

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


class Outdated(BaseException):
    """What a thread works on has changed: it begins again."""


class Abandoned(BaseException):
    """Nobody waits for what a thread works on: it ends."""


class StepGate:
    """How many steps a thread may make, and whether what it works on is still wanted.

    Attributes
    ----------
    turn: the lock of all that the thread and others share; who waits for a change waits on it.
    steps_left: None for any number.
    is_held: whether the thread waits for more.
    has_changed: whether something has, since the thread began.
    is_closed: whether nobody waits for anything.
    least_seconds: that a step takes at least, where any number may be made.
    """

    def __init__(self, on_held: Callable[[], None], least_seconds: float = 0.0) -> None:
        """A gate that lets no step through yet.

        on_held: called when the thread begins to wait.
        """
        self.turn = threading.Condition()
        self.steps_left: int | None = 0
        self.is_held, self.has_changed, self.is_closed = False, False, False
        self._on_held, self.least_seconds = on_held, least_seconds

    def allow(self, steps: int | None) -> None:
        """Let so many steps through from now on, None for any number."""
        with self.turn:
            self.steps_left = steps
            self.is_held = self.is_held and steps == 0
            self.turn.notify_all()

    def outdate(self) -> None:
        """Have the thread begin again at its next step."""
        with self.turn:
            self.has_changed = True
            self.turn.notify_all()

    def close(self) -> None:
        """Have the thread end at its next step."""
        with self.turn:
            self.is_closed = True
            self.turn.notify_all()

    def begin(self) -> None:
        """In the thread: wait until a step is allowed, and take note of all changes. Raises
        Abandoned."""
        self._hold()
        with self.turn:
            if self.is_closed:
                raise Abandoned
            self.has_changed = False

    def require_current(self) -> None:
        """In the thread: raise Outdated or Abandoned where that is so."""
        with self.turn:
            if self.is_closed:
                raise Abandoned
            if self.has_changed:
                raise Outdated

    def count(self) -> None:
        """In the thread: a step has been made."""
        with self.turn:
            if self.steps_left is not None:
                self.steps_left = max(self.steps_left - 1, 0)

    def wait(self, began: float) -> None:
        """In the thread: wait until the next step is allowed, after one that began at a time of
        `time.monotonic`. Raises as `require_current`."""
        with self.turn:
            rest = began + self.least_seconds - time.monotonic()
            if self.steps_left is None and rest > 0.0:
                self.turn.wait_for(lambda: self.is_closed or self.has_changed, rest)
        self.hold()

    def hold(self) -> None:
        """In the thread: wait until there is a step to be made. Raises as `require_current`."""
        self._hold()
        self.require_current()

    def _hold(self) -> None:
        with self.turn:
            if self.steps_left == 0:
                self.is_held = True
                self.turn.notify_all()
        if self.is_held:
            self._on_held()
        with self.turn:
            self.turn.wait_for(lambda: self.steps_left != 0 or self.is_closed)
            self.is_held = False


SAME: Final = 1e-9
"""Largest difference of coordinates, whose extent is about 1, of corners that count as the same."""


@dataclass(frozen=True, eq=False)
class DesignedShape:
    """A convex die as designed so far, in a unit of the design's own.

    Attributes
    ----------
    hull: the shape, of uniform density.
    directions: (k, 3) down in the outcomes, in the order of the target.
    target: (k,) wanted odds.
    energy: what the step to it has lowered; terms: its weighted terms by name.
    """

    hull: ConvexHull
    directions: Floats
    target: Floats
    energy: float = 0.0
    terms: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def poses(self) -> RestPoses:
        """Its rests, by the forward model."""
        return analyse(self.hull, self.hull.centroid, "uniform solid")

    @cached_property
    def outcomes(self) -> OutcomeOdds:
        """Odds of the outcomes, and of all other rests."""
        return outcome_odds(self.poses, self.directions)

    @property
    def error(self) -> float:
        """Largest |p - q|, or the odds of all other rests where these are larger."""
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

    def start(self, pinned: tuple[int, ...] = ()) -> Start:
        """A starting shape to go on from, of whose outcomes some keep their planes."""
        return Start(self.hull.vertices, self.directions, pinned=pinned)


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
            run_stages(work, last="design")
        else:
            labels = work.target.labels
            work.start = self._origin.start(tuple(labels.index(each) for each in self._pinned))
            run_stages(work, after="start", last="design")
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
