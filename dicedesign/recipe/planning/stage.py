"""Stages of a run: one file each, planned from the recipe, run in the order of their ranks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from dicedesign.recipe.planning.work import Work
from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension

__all__ = ["STAGES", "Stage", "plan"]


@dataclass(frozen=True, kw_only=True)
class Stage(Extension):
    """One stage of a run.

    Attributes
    ----------
    wanted: whether a run needs it, asked when its turn comes.
    run: does its work.
    """

    wanted: Callable[[Work], bool]
    run: Callable[[Work], None]


STAGES: Final[FolderRegistry[Stage]] = FolderRegistry("stage", "dicedesign.recipe.stages", Stage)


def plan(work: Work, *, after: str | None = None, last: str | None = None) -> None:
    """Run the stages that a recipe needs.

    after: the stage that ran last, None to begin; last: the one that ends it, None for all. Raises
    what stages raise: `DiceError`s, and KeyboardInterrupt.
    """
    least = float("-inf") if after is None else STAGES[after].rank
    most = float("inf") if last is None else STAGES[last].rank
    for stage in STAGES:
        if least < stage.rank <= most and stage.wanted(work):
            with work.clock.stage(stage.name):
                stage.run(work)
