"""Figures of a finished die: one file each, drawn for the dice that they fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from dicedesign.fabricate.finished_die import FinishedDie
from dicedesign.runtime.registry import Extension, Registry

__all__ = ["FIGURES", "Figure", "figure_files"]


@dataclass(frozen=True, kw_only=True)
class Figure(Extension):
    """One figure of the report.

    Attributes
    ----------
    title, caption: above and below it on the page.
    wanted: whether it fits a die.
    draw: its content, as the suffix says.
    suffix: of its file.
    """

    title: str
    caption: str
    wanted: Callable[[FinishedDie], bool]
    draw: Callable[[FinishedDie], bytes]
    suffix: str = ".png"


FIGURES: Final[Registry[Figure]] = Registry("figure", "dicedesign.report.figures.die")


def figure_files(die: FinishedDie) -> dict[str, bytes]:
    """The figures that fit a die, by name."""
    return {figure.name: figure.draw(die) for figure in FIGURES if figure.wanted(die)}
