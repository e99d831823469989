"""`method` of a recipe: exact, paper or concave, with its options."""

from __future__ import annotations

from typing import Any

from pydantic import Field, model_validator

from dicedesign.concave.options import ConcaveOptions
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.recipe.target import Strict

METHODS = ("exact", "paper", "concave")
"""Keys of `method`."""


class MethodRecipe(Strict):
    """`method`: `exact` (default), `paper`, or `concave` for a die that keeps the shape of its
    start. A name alone stands for the method with its defaults."""

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
        self.one_of(*METHODS)
        return self

    @property
    def name(self) -> str:
        """Key of the method."""
        return self.one_of(*METHODS)

    @property
    def options(self) -> Any:
        """Options of the method."""
        return getattr(self, self.name)

    @property
    def is_thrown(self) -> bool:
        """Whether the target holds for throws onto a table."""
        return self.exact is not None and self.exact.probabilities == "thrown"

    @property
    def table(self) -> str | None:
        """Table name with throw distribution; None for probabilities without momentum."""
        return self.options.table_with_hand if self.is_thrown else None

    @property
    def tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        options = self.options
        tolerance: float = options.effective_tolerance if self.paper else options.tolerance
        return tolerance
