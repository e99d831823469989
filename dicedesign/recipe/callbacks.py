"""What a run reports while it goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Design
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.optimize.targets import Target
    from dicedesign.results.parts import Candidate, RoundOfThrows
    from dicedesign.results.result import Step
    from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True)
class Callbacks:
    """Progress callbacks. An exception in one ends the run.

    Attributes
    ----------
    on_stage: receives the name of each stage when it begins.
    on_part: receives the part of a stage that is done, the whole, and their unit in the plural.
    on_step: receives each accepted step of the design.
    on_round: receives each round of throws.
    on_attempt: receives a line on the search for a concave die, before the first attempt and after
        each.
    on_start: receives the number of each starting shape of a convex die, from 0 on.
    on_shape: receives the hull of a convex die and its faces' directions (f, 3), in the order of
        the target, before `on_step` receives the step.
    on_candidate: receives each of several dice with different numbers of faces when it is designed:
        what distinguishes it, its target with its faces, and its design.
    """

    on_stage: Callable[[str], None] = lambda *_: None
    on_step: Callable[[Step], None] = lambda *_: None
    on_round: Callable[[RoundOfThrows], None] = lambda *_: None
    on_attempt: Callable[[str], None] = lambda *_: None
    on_start: Callable[[int], None] = lambda *_: None
    on_shape: Callable[[ConvexHull, Floats], None] = lambda *_: None
    on_part: Callable[[int, int, str], None] = lambda *_: None
    on_candidate: Callable[[Candidate, Target, Design], None] = lambda *_: None
