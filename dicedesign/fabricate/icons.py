"""Icons from SVG files: filled paths and shapes as a plane section.

The file is read as data of strangers: nothing is loaded, run or looked up, and what is neither a
path nor a shape in a plain colour is refused by name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final, NoReturn, TypeAlias

import numpy as np
from manifold3d import CrossSection

from dicedesign.errors import InputError, named
from dicedesign.fabricate.sections import (
    CHORD_TOLERANCE,
    PolylinePen,
    even_odd,
    non_zero,
    pieces_of,
)
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import read_file

INVISIBLE: Final = ("none", "transparent")

MOST_CHARACTERS: Final = 100
"""Of a colour."""

WEIGHTS: Final = (0.2126, 0.7152, 0.0722)
"""Of red, green and blue in luminance, ITU-R BT.709."""


@cache
def luminance(colour: str) -> float | None:
    """Of a colour of CSS, in [0, 1]: a name, #rgb, #rrggbb, rgb(), or currentColor, which is 0.
    None where it shows nothing.

    Raises ValueError, with the colour quoted: it is none of these, such as the url() of a gradient.
    """
    plain = colour.strip().lower()
    if plain in INVISIBLE:
        return None
    if plain == "currentcolor":
        return 0.0
    try:
        red, green, blue, alpha = _channels(plain)
    except ValueError as error:
        raise ValueError(repr(colour[:60])) from error
    if alpha == 0.0:
        return None
    return sum(w * c for w, c in zip(WEIGHTS, (red, green, blue), strict=True)) / 255.0


def is_zero(opacity: str) -> bool:
    """Whether an opacity, a number or a percentage, is 0 or below.

    Raises ValueError, with the opacity quoted: it is no number.
    """
    try:
        return _number(opacity, 1.0) <= 0.0
    except ValueError as error:
        raise ValueError(repr(opacity[:60])) from error


def _channels(colour: str) -> tuple[float, float, float, float]:
    """Red, green, blue and opacity, in [0, 255]."""
    if len(colour) > MOST_CHARACTERS:
        raise ValueError(colour)
    function, bracket, inner = colour.partition("(")
    if bracket and function in ("rgb", "rgba"):
        if not inner.endswith(")"):
            raise ValueError(colour)
        red, green, blue, *rest = inner[:-1].replace(",", " ").replace("/", " ").split()
        if len(rest) > 1:
            raise ValueError(colour)
        parts = [_number(part, 255.0) for part in (red, green, blue)]
        parts += [255.0 * _number(part, 1.0) for part in rest or ["1"]]
    else:
        from PIL import ImageColor

        parts = [float(part) for part in (*ImageColor.getrgb(colour), 255)[:4]]
    red_, green_, blue_, alpha = (min(max(part, 0.0), 255.0) for part in parts)
    return red_, green_, blue_, alpha


def _number(text: str, whole: float) -> float:
    """A number, or a percentage of a whole; finite."""
    text = text.strip()
    number = float(text.removesuffix("%")) * (whole / 100.0 if text.endswith("%") else 1.0)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


LARGEST: Final = 1e6
"""Entry of a transform."""

MOST_CHARACTERS: Final = 2000
"""Of a transform, and of numbers in an arc that nothing separates."""

MOST_CALLS: Final = 100
"""In a transform."""


def _length(element: Any, name: str, default: float = 0.0) -> float:
    text = element.get(name)
    value = default if text is None else float(text.strip().removesuffix("px"))
    if not math.isfinite(value):
        raise ValueError(f"{name}={text!r}")
    return value


def _ellipse(element: Any, rx: float, ry: float) -> str:
    x, y = _length(element, "cx"), _length(element, "cy")
    if not (rx > 0.0 and ry > 0.0):
        return ""
    half = f"A{rx!r},{ry!r} 0 0 1"
    return f"M{x - rx!r},{y!r} {half} {x + rx!r},{y!r} {half} {x - rx!r},{y!r} Z"


def _rectangle(element: Any) -> str:
    x, y = _length(element, "x"), _length(element, "y")
    width, height = _length(element, "width"), _length(element, "height")
    if not (width > 0.0 and height > 0.0):
        return ""
    rx = _length(element, "rx", _length(element, "ry"))
    ry = _length(element, "ry", rx)
    rx, ry = min(max(rx, 0.0), 0.5 * width), min(max(ry, 0.0), 0.5 * height)
    right, bottom = x + width, y + height
    if rx == 0.0 or ry == 0.0:
        return f"M{x!r},{y!r} H{right!r} V{bottom!r} H{x!r} Z"
    arc = f"A{rx!r},{ry!r} 0 0 1"
    return (
        f"M{x + rx!r},{y!r} H{right - rx!r} {arc} {right!r},{y + ry!r} V{bottom - ry!r} "
        f"{arc} {right - rx!r},{bottom!r} H{x + rx!r} {arc} {x!r},{bottom - ry!r} "
        f"V{y + ry!r} {arc} {x + rx!r},{y!r} Z"
    )


_ARC: Final = re.compile(r"[Aa]([^MmZzLlHhVvCcSsQqTtAa]*)")


def _path(element: Any) -> str:
    """Path data; the time to parse arcs rises with the square of what is not separated in them."""
    data = element.get("d") or ""
    for arc in _ARC.finditer(data):
        if max(map(len, re.split(r"[, \t]", arc[1]))) > MOST_CHARACTERS:
            raise ValueError(f"an arc with more than {MOST_CHARACTERS} characters in a row")
    return data


OUTLINES: Final[dict[str, Callable[[Any], str]]] = {
    "path": _path,
    "rect": _rectangle,
    "circle": lambda e: _ellipse(e, _length(e, "r"), _length(e, "r")),
    "ellipse": lambda e: _ellipse(e, _length(e, "rx"), _length(e, "ry")),
    "polygon": lambda e: f"M{e.get('points')}Z" if (e.get("points") or "").strip() else "",
    "polyline": lambda e: f"M{e.get('points')}Z" if (e.get("points") or "").strip() else "",
    "line": lambda e: "",
}
"""Outlines of shapes, as a path attribute has them."""


def _rotation(degrees: float, x: float = 0.0, y: float = 0.0) -> Floats:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    there, back = _translation(x, y), _translation(-x, -y)
    turn: Floats = there @ np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)]) @ back
    return turn


def _translation(x: float, y: float = 0.0) -> Floats:
    return np.array([(1.0, 0.0, x), (0.0, 1.0, y), (0.0, 0.0, 1.0)])


_TRANSFORMS: Final[dict[str, Callable[..., Floats]]] = {
    "matrix": lambda a, b, c, d, e, f: np.array([(a, c, e), (b, d, f), (0.0, 0.0, 1.0)]),
    "translate": _translation,
    "scale": lambda x, y=None: np.diag([x, x if y is None else y, 1.0]),
    "rotate": _rotation,
    "skewX": lambda a: np.array([(1.0, math.tan(math.radians(a)), 0.0), (0, 1, 0), (0, 0, 1)]),
    "skewY": lambda a: np.array([(1.0, 0, 0), (math.tan(math.radians(a)), 1, 0), (0, 0, 1)]),
}

_CALL: Final = re.compile(r"(\w+)\s*\(([^()]*)\)[\s,]*")


def transform(text: str) -> Floats:
    """Matrix (3, 3) of a transform attribute, such as "translate(3 4) rotate(30)".

    Raises ValueError: it cannot be read, has more than `MOST_CHARACTERS` or `MOST_CALLS`, or has
    entries that are not finite or above `LARGEST`.
    """
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f"more than {MOST_CHARACTERS} characters")
    text = text.strip()
    matrix, position = np.eye(3), 0
    for _ in range(MOST_CALLS):
        if position == len(text):
            return matrix
        call = _CALL.match(text, position)
        if call is None:
            raise ValueError(repr(text[:60]))
        try:
            numbers = [float(value) for value in re.split(r"[\s,]+", call[2].strip())]
            step = _TRANSFORMS[call[1]](*numbers)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(repr(text[:60])) from error
        _check_size(step, text)
        matrix = matrix @ step
        _check_size(matrix, text)
        position = call.end()
    if position < len(text):
        raise ValueError(f"more than {MOST_CALLS} in a row")
    return matrix


def _check_size(matrix: Floats, text: str) -> None:
    if not (np.isfinite(matrix).all() and np.abs(matrix).max() <= LARGEST):
        raise ValueError(repr(text[:60]))


MOST_BYTES: Final = 1 << 20
"""Of an SVG file: 1 MiB."""

MOST_SHAPES: Final = 1000

MOST_CORNERS: Final = 10_000
"""Of an icon, with curves flattened; what takes longest takes the square of it."""

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
        references, text, pictures or whatever else is neither path nor shape, fills that are no
        plain colours, more than `MOST_SHAPES` or `MOST_CORNERS`, or shows nothing.
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

    def __init__(self, strokes: list[tuple[str, Floats]], *, even_odd: bool, is_dark: bool) -> None:
        self.strokes = strokes
        self.even_odd = even_odd
        self.is_dark = is_dark

    def corners(self, tolerance: float) -> int:
        """How many `contours` has at most."""
        number, before = 0, np.empty((0, 2))
        for _, points in self.strokes:
            bends = len(points) > 1
            number += pieces_of(np.vstack([before, points]), tolerance) if bends else len(points)
            before = points[-1:]
        return number

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
        if own.get("display") == "none" or self._is_zero(own, "opacity", name):
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
        is_faint = self._is_zero(style, "fill-opacity", name)
        if is_faint or style.get("visibility") in ("hidden", "collapse"):
            return
        light = self._luminance(style, "fill", "black", name)
        if light is None:
            if self._luminance(style, "stroke", "none", name) is not None:
                self.refuse(
                    "filled shapes",
                    f"a stroke without a fill in <{name}>",
                    "convert strokes to paths",
                )
            return
        is_even_odd = style.get("fill-rule") == "evenodd"
        strokes = self._drawn(element, name, matrix)
        yield _Shape(strokes, even_odd=is_even_odd, is_dark=light < DARK)

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
            self._check_corners(sum(shape.corners(tolerance) for shape in shapes))
            for shape in shapes:
                contours = [c / extent for c in shape.contours(tolerance)]
                area = (even_odd if shape.even_odd else non_zero)(contours)
                section = section + area if shape.is_dark else section - area
            self._check_corners(section.num_vert())
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

    def _is_zero(self, style: Style, key: str, name: str) -> bool:
        """Whether an opacity, 1 where there is none, is 0."""
        try:
            return is_zero(style.get(key, "1"))
        except ValueError as error:
            self.refuse(f"a number as {key} of <{name}>", str(error), "correct it")

    def _luminance(self, style: Style, key: str, default: str, name: str) -> float | None:
        """Of a fill or stroke, None where it shows nothing."""
        try:
            return luminance(style.get(key, default))
        except ValueError as error:
            self.refuse(
                f"a plain colour such as black or #202020 as {key} of <{name}>",
                str(error),
                "fill it with one, or export it again",
            )

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
        self._check_corners(len(pen.value))
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

    def _check_corners(self, number: int) -> None:
        if number > MOST_CORNERS:
            self.refuse(f"at most {MOST_CORNERS} corners", f"{number}", "simplify the paths")
