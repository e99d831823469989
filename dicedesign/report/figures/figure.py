"""Figures of a report about a finished die: one file each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["FIGURES", "Figure", "figure_files"]


@dataclass(frozen=True, kw_only=True)
class Figure(Extension):
    """A figure; `name` is that of its file, without the ending, and `rank` its place on the page.

    Attributes
    ----------
    title, caption: above and below it on the page.
    wanted: whether a die has it.
    draw: the content of its file.
    suffix: ending of its file, ".png" or ".gif".
    instead_of: name of a figure that is not shown on the page where this one is, or empty.
    """

    title: str
    caption: str
    wanted: Callable[[FinishedDie], bool]
    draw: Callable[[FinishedDie], bytes]
    suffix: str = ".png"
    instead_of: str = ""


FIGURES: Final = FolderRegistry[Figure]("figure", "dicedesign.report.figures", Figure)
"""All figures of dice, in the order of the page."""


def figure_files(die: FinishedDie) -> dict[str, bytes]:
    """The content of the file of each figure that a die has, by the figure's name."""
    return {figure.name: figure.draw(die) for figure in FIGURES if figure.wanted(die)}
