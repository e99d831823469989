"""Surfaces that the package builds, as starts of concave dice."""

from __future__ import annotations

from typing import Final, Literal

from dicedesign.optimize.starts.start import StartKind, StartSurface


def _surface(name: str, _: int) -> StartSurface:
    from dicedesign.concave.shapes import shape

    return StartSurface(shape(name))


SHAPE: Final = StartKind(
    name="shape",
    line="a surface built in, `dragon`, `duck`, `kitten` or `knot`, for method concave",
    # The keys of `SHAPES`, whose builders take long to import.
    options=Literal["dragon", "duck", "kitten", "knot"],
    surface=_surface,
)
