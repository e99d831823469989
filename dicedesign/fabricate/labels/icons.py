"""Icons from SVG files: filled paths and shapes as a plane section.

The file is read as data of strangers: nothing is loaded, run or looked up, and what is neither a
path nor a shape in a plain colour is refused by name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final, NoReturn, TypeAlias

import numpy as np
from manifold3d import CrossSection

from dicedesign.errors import InputError, named
from dicedesign.fabricate.labels.flattening import CHORD_TOLERANCE, PolylinePen
from dicedesign.fabricate.labels.sections import even_odd, non_zero
from dicedesign.fabricate.labels.svg_geometry import OUTLINES, transform
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import read_file

__all__ = ["icon_section"]

MOST_BYTES: Final = 1 << 20
"""Of an SVG file: 1 MiB."""

MOST_SHAPES: Final = 1000

MOST_COORDINATE: Final = 1e6

MOST_DEPTH: Final = 100
"""Groups within each other."""

DARK: Final = 0.5
"""Luminance below which a colour is cut; what is lighter covers what lies beneath."""

SPACE: Final = "{http://www.w3.org/2000/svg}"

SILENT: Final = {"title", "desc", "metadata", "defs"}
"""Elements that show nothing by themselves."""

INHERITED: Final = ("fill", "fill-rule", "stroke", "visibility", "fill-opacity")

OWN: Final = ("display", "opacity")

REFUSED: Final = ("clip-path", "mask", "filter")
"""Properties that change what a shape covers."""

INVISIBLE: Final = ("none", "transparent")

ZERO: Final = ("0", "0%")

Style: TypeAlias = dict[str, str]


def icon_section(path: str, label: str) -> CrossSection:
    """Plane section of the dark shapes of an SVG file, of height 1, from the origin to the right
    and upward.

    Shapes count in the order of the file: dark ones are added, light ones taken out. Strokes are
    not drawn.

    path: of the file; label: what it stands for, in messages.

    Raises
    ------
    InputError: the file cannot be read, is no SVG of at most `MOST_BYTES`, has scripts, entities,
        references, text, pictures or whatever else is neither path nor shape, or shows nothing.
    """
    with named(f"engrave.icons: label {label!r}"):
        data = read_file(Path(path), "an SVG file", most=MOST_BYTES)
    reader = _Reader(f"engrave.icons: label {label!r}: {path}")
    shapes = list(reader.shapes(reader.root(data)))
    if not shapes:
        reader.refuse("at least one filled path or shape", "none", "fill one, or name another file")
    return reader.section(shapes)


class _Shape:
    """A path as (command, points) in the coordinates of the picture."""

    def __init__(self, strokes: list[tuple[str, Floats]], style: Style) -> None:
        self.strokes = strokes
        self.even_odd = style.get("fill-rule") == "evenodd"
        self.is_dark = _luminance(style.get("fill", "black")) < DARK

    def contours(self, tolerance: float) -> list[Floats]:
        pen = PolylinePen(tolerance)
        for command, points in self.strokes:
            getattr(pen, command)(*map(tuple, points.tolist()))
        return pen.contours()


class _Reader:
    """Shapes of one file; errors begin with `where`."""

    def __init__(self, where: str) -> None:
        self.where = where

    def refuse(self, expected: str, got: str, remedy: str) -> NoReturn:
        raise InputError(f"{self.where}: expected {expected}, got {got}; {remedy}")

    def root(self, data: bytes) -> Any:
        """The root element; entities are neither looked up nor replaced."""
        from lxml import etree

        parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
        try:
            root = etree.fromstring(data, parser)
        except (etree.XMLSyntaxError, ValueError) as error:
            self.refuse("an SVG file", f"no XML ({error})", "export it again")
        inner = root.getroottree().docinfo.internalDTD
        if inner is not None and next(iter(inner.iterentities()), None) is not None:
            self.refuse("no entities", "some in its DOCTYPE", "save it as plain SVG")
        if root.tag not in (f"{SPACE}svg", "svg"):
            self.refuse("an SVG file", f"an element <{root.tag}>", "export it again")
        for element in root.iter(etree.Element):
            name = element.tag.rpartition("}")[2]
            if name in ("script", "style"):
                self.refuse("no scripts and no style sheets", f"<{name}>", "save it as plain SVG")
            for key in element.attrib:
                if key.lower().startswith("on"):
                    self.refuse("no scripts", f"{key}= in <{name}>", "remove it")
        return root

    def shapes(
        self, element: Any, style: Style | None = None, outer: Floats | None = None, depth: int = 0
    ) -> Iterator[_Shape]:
        """Filled shapes of an element and those within, in the order of drawing."""
        outer = np.eye(3) if outer is None else outer
        name = self._name(element)
        if name is None or name in SILENT:
            return
        own = self._style(element, name)
        style = {key: value for key, value in (style or {}).items() if key in INHERITED} | own
        if own.get("display") == "none" or own.get("opacity") in ZERO:
            return
        matrix = outer @ self._matrix(element.get("transform") or "")
        if name in ("svg", "g") and not (name == "svg" and depth):
            if depth > MOST_DEPTH:
                self.refuse(f"at most {MOST_DEPTH} groups within each other", "more", "ungroup")
            for child in element:
                yield from self.shapes(child, style, matrix, depth + 1)
            return
        if name not in OUTLINES:
            self.refuse(
                "paths and shapes only",
                f"<{name}>",
                "convert everything to paths and save it as plain SVG",
            )
        if _hidden(style):
            return
        if style.get("fill") in INVISIBLE:
            if style.get("stroke", "none") not in INVISIBLE:
                self.refuse(
                    "filled shapes",
                    f"a stroke without a fill in <{name}>",
                    "convert strokes to paths",
                )
            return
        yield _Shape(self._drawn(element, name, matrix), style)

    def section(self, shapes: list[_Shape]) -> CrossSection:
        """The union of the dark shapes less the light ones above them, of height 1."""
        if len(shapes) > MOST_SHAPES:
            self.refuse(f"at most {MOST_SHAPES} shapes", f"{len(shapes)}", "join some")
        points = [points for shape in shapes for _, points in shape.strokes if len(points)]
        extent = float(np.ptp(np.concatenate(points), axis=0).max()) if points else 0.0
        if not 0.0 < extent < math.inf:
            self.refuse("a shape with an area", "none", "draw one")
        # Twice: the first time only to know how tall what is dark is.
        section, tolerance = CrossSection(), CHORD_TOLERANCE * extent
        for _ in range(2):
            section = CrossSection()
            for shape in shapes:
                contours = [c / extent for c in shape.contours(tolerance)]
                area = (even_odd if shape.even_odd else non_zero)(contours)
                section = section + area if shape.is_dark else section - area
            if not section.area() > 0.0:
                self.refuse("a dark shape with an area", "none", "fill one in black")
            left, bottom, _, top = section.bounds()
            tolerance = CHORD_TOLERANCE * (top - bottom) * extent
        scale = 1.0 / (top - bottom)
        return section.translate((-left, -bottom)).scale((scale, scale))

    def _name(self, element: Any) -> str | None:
        """Of an SVG element; None for those of editors."""
        tag = element.tag
        if not isinstance(tag, str):
            self.refuse("elements", "an entity or an instruction", "save it as plain SVG")
        if tag.startswith("{") and not tag.startswith(SPACE):
            return None
        return tag.removeprefix(SPACE)

    def _style(self, element: Any, name: str) -> Style:
        """Properties of an element, by its attributes and its style attribute."""
        style = {key: value.strip() for key, value in element.items()}
        for declaration in (element.get("style") or "").split(";"):
            key, colon, value = declaration.partition(":")
            if colon:
                style[key.strip().lower()] = value.replace("!important", "").strip()
        for key in REFUSED:
            if style.get(key, "none") != "none":
                self.refuse("plain shapes", f"{key} in <{name}>", "apply it or remove it")
        known = (*INHERITED, *OWN)
        return {key: style[key] for key in known if style.get(key, "inherit") != "inherit"}

    def _matrix(self, text: str) -> Floats:
        """(3, 3) of a transform attribute."""
        try:
            matrix = transform(text)
        except ValueError as error:
            self.refuse("a transform such as rotate(30)", str(error), "apply it or correct it")
        return matrix

    def _drawn(self, element: Any, name: str, matrix: Floats) -> list[tuple[str, Floats]]:
        """An element's outline in the coordinates of the picture, upright: y is upward."""
        from fontTools.pens.recordingPen import RecordingPen
        from fontTools.svgLib.path import parse_path

        pen = RecordingPen()
        try:
            parse_path(OUTLINES[name](element), pen)
        # Of bad paths it raises what comes.
        except Exception as error:
            self.refuse(f"an outline of <{name}>", repr(error)[:80], "export it again")
        strokes = []
        for command, points in pen.value:
            plain = np.array(points, dtype=np.float64).reshape(-1, 2)
            self._check_range(plain)
            flat = (plain @ matrix[:2, :2].T + matrix[:2, 2]) * (1.0, -1.0)
            self._check_range(flat)
            strokes.append((command, flat))
        return strokes

    def _check_range(self, points: Floats) -> None:
        if not (np.abs(points) < MOST_COORDINATE).all():
            self.refuse(f"coordinates below {MOST_COORDINATE:g}", "others", "scale the picture")


def _hidden(style: Style) -> bool:
    return style.get("visibility") in ("hidden", "collapse") or style.get("fill-opacity") in ZERO


@cache
def _luminance(colour: str) -> float:
    """Of a colour of CSS, in [0, 1]; 0 where it is that of the text around or cannot be read."""
    from PIL import ImageColor

    try:
        red, green, blue = ImageColor.getrgb(colour)[:3]
    except ValueError:
        return 0.0
    return (0.2126 * red + 0.7152 * green + 0.0722 * blue) / 255.0
