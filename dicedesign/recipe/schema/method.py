"""The method of a recipe, with its options."""

from __future__ import annotations

from typing import Any, Final

from pydantic import Field, model_validator

from dicedesign.concave.options import ConcaveOptions
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.paper_options import PaperOptions
from dicedesign.recipe.schema.entries import Strict, one_of

__all__ = ["MethodRecipe"]

METHODS: Final = ("exact", "paper", "concave")
"""Keys of `method`."""


class MethodRecipe(Strict):
    """`method`: how the die is found: `exact` unless it says `paper`, or `concave` for a die that
    keeps the shape of its start. A word alone is the method with all its defaults."""

    exact: ExactOptions | None = Field(default_factory=ExactOptions)
    paper: PaperOptions | None = None
    concave: ConcaveOptions | None = None

    @model_validator(mode="before")
    @classmethod
    def _choose(cls, given: Any) -> Any:
        if given in METHODS:
            given = {given: {}}
        if isinstance(given, dict) and any(given.get(name) is not None for name in METHODS):
            return {"exact": None, **given}
        return given

    @model_validator(mode="after")
    def _check(self) -> MethodRecipe:
        one_of(self, *METHODS)
        return self

    @property
    def name(self) -> str:
        """The key of the method."""
        return next(key for key, value in self if value is not None)

    @property
    def thrown(self) -> bool:
        """True where the target is meant for a die that is thrown onto a table."""
        return self.exact is not None and self.exact.odds == "thrown"

    @property
    def tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.paper is not None:
            return self.paper.reached
        options = self.exact or self.concave
        assert options is not None
        return options.tolerance
