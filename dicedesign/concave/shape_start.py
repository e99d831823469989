"""Surfaces that the package builds, as starts of concave dice."""

from __future__ import annotations

from typing import Literal

from dicedesign.optimize.starts.start import STARTS, StartKind, StartSurface


def _surface(name: str, _: int) -> StartSurface:
    from dicedesign.concave.shapes import shape

    return StartSurface(shape(name))


STARTS.register(
    StartKind(
        name="shape",
        line="a surface built in, `dragon`, `duck`, `kitten` or `knot`, for method concave",
        rank=4,
        # The keys of `SHAPES`, whose builders take long to import.
        options=Literal["dragon", "duck", "kitten", "knot"],
        surface=_surface,
    )
)
