"""Options of benches: how much is measured, and what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dicedesign.errors import InputError

__all__ = ["Amount", "Option", "meshes", "recipes"]


@dataclass(frozen=True)
class Amount:
    """An option that says how much is measured.

    Attributes
    ----------
    name: of the field of the bench's extents that it replaces.
    metavar, help: of the option; the help goes on with the defaults.
    flag: of the option, by default the name.
    kind: whole numbers or real ones.
    least: smallest whole number; real numbers are positive.
    below: what real numbers are less than.
    """

    name: str
    metavar: str
    help: str
    flag: str = ""
    kind: type[int] | type[float] = int
    least: int = 1
    below: float = float("inf")

    @property
    def option(self) -> str:
        """What is typed."""
        return self.flag or f"--{self.name.replace('_', '-')}"

    def check(self, value: float) -> None:
        """Raise InputError for a number out of range."""
        if self.kind is int:
            good, expected = value >= self.least, f"at least {self.least}"
        elif self.below < float("inf"):
            good, expected = 0.0 < value < self.below, f"a number in (0, {self.below:g})"
        else:
            good, expected = value > 0.0, "a positive number"
        if not good:
            raise InputError(
                f"{self.option}: expected {expected}, got {value:g}; give another, or leave it out"
            )


@dataclass(frozen=True)
class Option:
    """Another option or argument: its name or flag, its help, and more that argparse takes."""

    name: str
    help: str
    settings: Mapping[str, Any] = field(default_factory=dict)


def meshes(help: str = "STL, OBJ, PLY, OFF, GLB, XYZ, ...") -> Option:
    """The argument `meshes`: any number of files."""
    return Option("meshes", help, {"nargs": "*", "type": Path, "metavar": "MESH"})


def recipes(help: str, nargs: str = "+") -> Option:
    """The argument `recipes`: files, at least one unless `nargs` says otherwise."""
    return Option("recipes", help, {"nargs": nargs, "type": Path, "metavar": "RECIPE"})
