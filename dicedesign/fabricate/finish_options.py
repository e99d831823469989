"""Options of labels and edges, apart from the code, so that a recipe loads no hulls."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

from dicedesign.errors import InputError, is_finite_number
from dicedesign.runtime.registry import Options
from dicedesign.tolerances import MOST_MM

BUNDLED_FONT = "DejaVu Sans Bold"
"""Name of the default font of labels. It comes with matplotlib; its digits are equally wide."""

FONT_FILES = (".ttf", ".otf", ".ttc")

ICON_NAMES = (
    "heart",
    "star",
    "bolt",
    "moon",
    "drop",
    "leaf",
    "crown",
    "cross",
    "diamond",
    "ring",
    "arrow",
    "flag",
)
"""Names of the icons of the package, which may stand for a path."""

Content = Literal["text", "pips"]
Ambiguous = Literal["bar", "dot", "none"]
Style = Literal["engraved", "raised"]
Read = Literal["auto", "up", "down", "both"]
Balancing = Literal["shape", "opposite", "fill", "none"]

Length = Annotated[float, Field(gt=0.0, le=MOST_MM)]
LengthOrZero = Annotated[float, Field(ge=0.0, le=MOST_MM)]
"""Lengths in mm; the latter may be 0."""

UPRIGHTS = ("edge", "largest")


def is_font_file(font: str) -> bool:
    """Whether a font is the path of a file rather than a name."""
    return font.lower().endswith(FONT_FILES)


@dataclass(frozen=True)
class EngravingOptions(Options):
    """Options of labels: look, size and depth. No length is above `MOST_MM`.

    Raises InputError for a value out of its range.
    """

    depth_mm: Length = 0.6
    """Depth of the pockets below the facet, above 0, and at least a millionth of the die's size. It
    does not scale with the die. On a die with symmetry some are shallower, to keep it."""
    margin_mm: LengthOrZero = 0.5
    """Distance between labels and the edges of their facet, at least 0; more at sharp edges, so
    that pockets do not meet."""
    min_height_mm: Length = 2.5
    """Smallest legible digit height, above 0."""
    max_height_mm: Length = 8.0
    """Largest digit height, at least `min_height_mm`."""
    stroke_mm: LengthOrZero = 0.0
    """Minimum width of strokes, such as the printer's line; thinner outlines grow. 0 leaves them
    unchanged."""
    content: Content = "text"
    """"text", or "pips" for numbers from 1 to 20 as on ordinary dice."""
    blank: list[str] = field(default_factory=list)
    """Labels whose faces stay blank, such as the rim of a coin."""
    icons: dict[str, str] = field(default_factory=dict)
    """Icons by the labels they replace: SVG files, with paths relative to the recipe, or one of
    heart, star, bolt, moon, drop, leaf, crown, cross, diamond, ring, arrow, flag. Dark areas are
    cut, as tall as a digit."""
    font: str = BUNDLED_FONT
    """The bundled font, the family of an installed one (its bold face), or the path of a .ttf or
    .otf file, relative to the recipe."""
    narrow: bool = False
    """Whether labels of several characters are in narrow capitals, which print at a smaller size
    than small letters."""
    upright: str | list[float] | tuple[float, ...] = "edge"
    """Up on the label: along the mirror line of a facet, or away from its longest edge if it has
    none ("edge"), from the edge that leaves most room ("largest"), or toward a direction [x, y, z]
    in the coordinates of die_plain.stl."""
    ambiguous: Ambiguous = "bar"
    """Mark of numbers such as 6 and 9 that read as each other upside down, if both are on the die:
    a "bar" beneath, a "dot" after them, or "none"."""
    style: Style = "engraved"
    """`engraved` cuts labels in; `raised` sinks the field around them; they stand as high as the
    border of the facet, so the die rests as without labels."""
    border_mm: Length = 1.0
    """Width of the border around a sunk field, above 0."""
    balance: Balancing = "shape"
    """Compensation for the material that labels take away: `shape` moves the facets until the
    finished die has the probabilities; `opposite` hollows a hidden ball opposite to them; `fill`
    makes bodies that fill the labels in another color, equally dense; `none` does nothing."""
    read: Read = "auto"
    """Where the label of an outcome lies: "down" on the facet that the die rests on; "up" on the
    level facet on top then, or around the corner or beside the edge on top where there is one;
    "both" below and on top; "auto" up where all tops are level facets or edges, or the die is a
    tetrahedron, as far as the labels fit there, and down elsewhere."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.max_height_mm < self.min_height_mm:
            raise InputError(
                f"max_height_mm: expected at least min_height_mm = {self.min_height_mm}, got "
                f"{self.max_height_mm}; enlarge it or reduce min_height_mm"
            )
        if not self.font.strip():
            raise InputError(f"font: expected a name or a path, got {self.font!r}; write one")
        given: Any = self.upright
        if isinstance(given, str):
            fits = given in UPRIGHTS
        else:
            fits = isinstance(given, list | tuple) and len(given) == 3
            fits = fits and all(map(is_finite_number, given)) and any(given)
        if not fits:
            raise InputError(
                f"upright: expected {' or '.join(UPRIGHTS)}, or a direction of three "
                f"finite numbers that are not all 0, got {given!r}; correct it"
            )
        if not isinstance(given, str):
            object.__setattr__(self, "upright", tuple(map(float, given)))


MOST_OF_SIZE = 0.2
"""Largest radius, over the size of the die."""

LEAST_OF_SIZE = 0.01
"""Smallest radius of a fillet, over the size of the die: the strips of a finer one are as small as
the rounding errors of files in single precision."""

ROUNDING = 1e-9
"""Relative tolerance of a measured size."""


@dataclass(frozen=True)
class EdgeOptions(Options):
    """Options of the edges and corners of a convex die.

    Raises InputError for a value out of its range.
    """

    radius_mm: Annotated[float, Field(gt=0.0)] = 1.0
    """Radius of a fillet, or of the ball whose chords are the chamfers, above 0: at most a fifth of
    the die's size, and the radius of the smallest facet's circle; for a fillet at least a hundredth
    of the size."""
    shape: Literal["fillet", "chamfer"] = "fillet"
    """`fillet` rounds off, `chamfer` cuts flat."""


def core_scale(options: EdgeOptions | None, size_mm: float) -> float:
    """Ratio of the size of a die's core to the size of the die.

    Raises InputError if the radius is too large or too small for the size.
    """
    if options is None:
        return 1.0
    part = options.radius_mm / size_mm
    if part > MOST_OF_SIZE * (1.0 + ROUNDING):
        raise InputError(
            f"edges.radius_mm: expected at most {MOST_OF_SIZE * size_mm:.3g}, a fifth of size_mm, "
            f"got {options.radius_mm:g}; lower it, or take a larger size_mm"
        )
    if options.shape == "fillet" and part < LEAST_OF_SIZE * (1.0 - ROUNDING):
        raise InputError(
            f"edges.radius_mm: expected at least {LEAST_OF_SIZE * size_mm:.3g} for a fillet, a "
            f"hundredth of size_mm, got {options.radius_mm:g}; enlarge it, take shape: chamfer, or "
            "leave edges out"
        )
    return 1.0 - 2.0 * part
