"""Random shapes with odds near the target's, one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import STARTS, Start, StartKind
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import STRICT

__all__ = ["SearchOptions"]


MOST_HELPERS: Final = 60


@dataclass(frozen=True)
class SearchOptions:
    """`start.search`.

    Attributes
    ----------
    helpers: least number of facets without an outcome, 0 to `MOST_HELPERS`: they leave more dice of
        the same odds to choose from.
    """

    __pydantic_config__ = STRICT

    helpers: int = 0


def _check(options: SearchOptions, outcomes: int) -> None:
    if not 0 <= options.helpers <= MOST_HELPERS:
        raise InputError(
            f"start.search.helpers: expected 0 to {MOST_HELPERS}, got {options.helpers}; leave it "
            "out"
        )


def _shapes(
    options: SearchOptions, target: Floats, group: Floats | None, seed: int
) -> Iterator[Start | None]:
    """See `shapes_near` and `symmetric_shapes_near`."""
    if group is None:
        from dicedesign.optimize.starts.search import shapes_near

        return shapes_near(target, seed, options.helpers)
    from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near

    return symmetric_shapes_near(target, group, seed, options.helpers)


STARTS.register(
    StartKind(
        name="search",
        line="random shapes with odds near the target's, until one leads there",
        rank=5,
        options=SearchOptions,
        check=_check,
        search=_shapes,
    )
)
