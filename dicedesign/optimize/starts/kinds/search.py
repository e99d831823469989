"""Random shapes with odds near the target's, one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dicedesign.optimize.starts.start import STARTS, Start, StartKind
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import STRICT

__all__ = ["SearchOptions"]


@dataclass(frozen=True)
class SearchOptions:
    """`start.search`: nothing to choose."""

    __pydantic_config__ = STRICT


def _shapes(target: Floats, group: Floats | None, seed: int) -> Iterator[Start | None]:
    """See `shapes_near` and `symmetric_shapes_near`."""
    if group is None:
        from dicedesign.optimize.starts.search import shapes_near

        return shapes_near(target, seed)
    from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near

    return symmetric_shapes_near(target, group, seed)


STARTS.register(
    StartKind(
        name="search",
        line="random shapes with odds near the target's, until one leads there",
        rank=5,
        options=SearchOptions,
        search=_shapes,
    )
)
