"""What is asked for on the page, as the entries of a recipe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from dicedesign.errors import InputError
from dicedesign.optimize.options import legible
from dicedesign.optimize.paper_options import PaperWeights
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.starts.repulsion import FEWEST_FACETS
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.schema.recipe import Recipe

__all__ = ["SHAPE_FILE", "DieRequest"]

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
