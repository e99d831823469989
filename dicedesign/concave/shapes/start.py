"""Surfaces that the package builds, as starts of concave dice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from dicedesign.optimize.starts.start import STARTS, StartKind

if TYPE_CHECKING:
    from dicedesign.geometry.surfaces.surface import Surface

__all__: list[str] = []


def _surface(name: str) -> tuple[Surface, tuple[str, ...]]:
    from dicedesign.concave.shapes.shapes import shape

    return shape(name), ()


STARTS.register(
    StartKind(
        name="shape",
        line="a surface built in, `duck`, `gear`, `kitten` or `knot`, for method concave",
        rank=4,
        # The keys of `SHAPES`, whose builders take long to import.
        options=Literal["duck", "gear", "kitten", "knot"],
        surface=_surface,
    )
)
