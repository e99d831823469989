"""Icons from SVG files: paths, shapes and strokes as a plane section.

Files are untrusted: nothing is loaded, run or looked up, and any element that is neither a path nor
a shape in a plain color is refused by name. picosvg reads shapes and transforms, and skia-pathops
outlines strokes; its unions are not used, as they can take hours for paths that cross themselves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np
from manifold3d import CrossSection, FillRule

from dicedesign.errors import InputError, named
from dicedesign.fabricate.finish_options import ICON_NAMES
from dicedesign.fabricate.fonts import CHORD_TOLERANCE, PolylinePen
from dicedesign.runtime.files import read_file

MOST_BYTES = 1 << 20
"""Largest size of an SVG file: 1 MiB."""

MOST_SHAPES = 1000

CORNERS = (10_000, "corners", "simplify the paths")
"""Largest number of corners of an icon with flattened curves, and the words of its message; the
time grows with its square."""

MOST_CHARACTERS = 2000
"""Largest length of an attribute, or of a number in a path: searches in more take minutes."""

MOST_PARTS = 8 * CORNERS[0]
"""Largest count of drawn elements and of commands and numbers in their paths, those of repeated
elements each time: an arc has eight for a corner."""

MOST_ATTRIBUTES = 100
"""Largest number of attributes of an element; the time to copy it grows with the square."""

MOST_COORDINATE = 1e6

TOO_LARGE = f"coordinates below {MOST_COORDINATE:g}", "others", "scale the picture"
"""Words of a message about coordinates."""

NO_AREA = ("a dark shape with an area", "none", "fill one in black")
"""Words of a message about an icon that shows nothing."""

MOST_DEPTH = 100
"""Largest depth of nested groups."""

STROKE_WIDTH = 1000.0
"""Width to which strokes are scaled for Skia, whose tolerance is a quarter."""

DARK = 0.5
"""Luminance below which a color is cut; lighter shapes cover those beneath."""

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Luminance of red, green and blue, ITU-R BT.709."""

SPACE = "{http://www.w3.org/2000/svg}"

LINK = "{http://www.w3.org/1999/xlink}href"

SHAPES = {"path", "rect", "circle", "ellipse", "line", "polygon", "polyline"}

SILENT = {"title", "desc", "metadata", "defs"}
"""Elements that are not drawn."""

NEUTRAL = {
    "clip-path": "none",
    "mask": "none",
    "filter": "none",
    "stroke-dasharray": "none",
    "visibility": "visible",
}
"""Properties that change the area of a shape, each with the only allowed value."""

INHERITED = re.compile(r"fill(-.+)?|stroke(-.+)?")

TRANSFORM = re.compile(r"\s*((matrix|translate|scale|rotate|skewX|skewY)\s*\([^()]*\)(\s*,)?\s*)*")
"""One transform after the other. No text matches in two ways, which would take exponential time."""

PATH_PART = re.compile(r"\d+\.?\d*|\.\d+|[a-df-zA-DF-Z]")
"""A command or a number of a path; of an exponent a second number."""

Outline: TypeAlias = tuple[Any, bool, bool]
"""Path of Skia, whether it has the even-odd fill rule, and whether it is dark."""


def icon_section(path: str, label: str) -> CrossSection:
    """Plane section of the dark shapes of an SVG file, of height 1, with its lower left corner at
    the origin.

    Dark shapes and strokes are added and light ones subtracted, in the order of the file.

    path: of the file, or one of `ICON_NAMES`; label: of the icon, in messages.

    Raises
    ------
    InputError: the file cannot be read, is no SVG of at most `MOST_BYTES`, has scripts, entities,
        text, pictures or other elements, fills that are no plain colors, too many shapes or
        corners, or shows nothing.
    """
    if path in ICON_NAMES:
        path = str(Path(__file__).parent / "symbols" / f"{path}.svg")
    with named(f"engrave.icons: label {label!r}"):
        data = read_file(Path(path), "an SVG file", most=MOST_BYTES)
        with named(path):
            root = _root(data)
            _require_plain(root)
            outlines = list(islice(_Picture(root).outlines(root), MOST_SHAPES + 1))
            _limit(len(outlines), MOST_SHAPES, "shapes", "join some")
            return _section(outlines)


def _refuse(expected: str, got: str, remedy: str) -> NoReturn:
    raise InputError(f"expected {expected}, got {got}; {remedy}")


def _limit(number: int, most: int, what: str, remedy: str) -> None:
    if number > most:
        _refuse(f"at most {most} {what}", str(number), remedy)


def _root(data: bytes) -> Any:
    """Parse the root element; entities are neither looked up nor replaced."""
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        _refuse("an SVG file", f"no XML ({error})", "export it again")
    inner = root.getroottree().docinfo.internalDTD
    if inner is not None and next(iter(inner.iterentities()), None) is not None:
        _refuse("no entities", "some in its DOCTYPE", "save it as plain SVG")
    if root.tag == "svg":
        for element in root.iter(etree.Element):
            element.tag = element.tag if element.tag.startswith("{") else SPACE + element.tag
    if root.tag != f"{SPACE}svg":
        _refuse("an SVG file", f"an element <{root.tag}>", "export it again")
    return root


def _require_plain(root: Any) -> None:
    """Raise InputError for scripts, style sheets or very long or very many attributes."""
    from lxml import etree

    for element in root.iter(etree.Element):
        name = element.tag.rpartition("}")[2]
        if name in ("script", "style"):
            _refuse("no scripts and no style sheets", f"<{name}>", "save it as plain SVG")
        _limit(len(element.attrib), MOST_ATTRIBUTES, f"attributes of <{name}>", "remove some")
        for key, value in element.items():
            if key.lower().startswith("on"):
                _refuse("no scripts", f"{key}= in <{name}>", "remove it")
            run = max(map(len, re.split(r"[, \n\t]", value))) if key == "d" else len(value)
            if key != "points":
                _limit(run, MOST_CHARACTERS, f"characters as {key} of <{name}>", "shorten it")


@contextmanager
def _readable(name: str) -> Iterator[None]:
    """Refuse an element that picosvg cannot read, for which it raises any exception."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        _refuse(f"a <{name}> that can be read", repr(error)[:100], "correct it or export it again")


class _Picture:
    """Elements of an SVG file by references, and the count of those drawn, see `MOST_PARTS`."""

    def __init__(self, root: Any) -> None:
        self.by_id = {f"#{element.get('id')}": element for element in root.iter()}
        self.parts = 0

    def outlines(
        self, element: Any, outer: Any = None, depth: int = 0, **style: str
    ) -> Iterator[Outline]:
        """Yield filled shapes and strokes of an element and its children, in the order of drawing,
        in the coordinates of the picture.

        outer: transform of the parents; style: inherited properties.
        """
        from lxml import etree
        from picosvg.svg import from_element
        from picosvg.svg_meta import parse_css_declarations
        from picosvg.svg_transform import Affine2D

        if not isinstance(element.tag, str):
            _refuse("elements", "an entity or an instruction", "save it as plain SVG")
        name = element.tag.removeprefix(SPACE)
        if name.startswith("{") or name in SILENT:
            return
        _limit(depth, MOST_DEPTH, "groups within each other", "ungroup")
        own: dict[str, str] = dict(element.items())
        self.parts += 1 + sum(len(PATH_PART.findall(own.get(key, ""))) for key in ("d", "points"))
        _limit(self.parts, MOST_PARTS, "elements, commands and numbers", "simplify the paths")
        with _readable(name):
            parse_css_declarations(own.pop("style", "").replace("!important", ""), own)
            own = {key: value.strip() for key, value in own.items() if value.strip() != "inherit"}
            for key, neutral in NEUTRAL.items():
                if own.get(key, neutral) != neutral:
                    _refuse("plain shapes", f"{key} in <{name}>", "apply it or remove it")
            if own.get("display") == "none" or not float(own.get("opacity", 1.0)) > 0.0:
                return
            if not TRANSFORM.fullmatch(own.get("transform", "")):
                raise ValueError(own["transform"])
            matrix = Affine2D.fromstring(own.get("transform", ""))
            if name == "use":
                place = float(own.get("x", 0)), float(own.get("y", 0))
                matrix = Affine2D.compose_ltr((Affine2D.identity().translate(*place), matrix))
            if outer is not None:
                matrix = Affine2D.compose_ltr((matrix, outer))
            if not max(map(abs, matrix)) < MOST_COORDINATE:
                _refuse(*TOO_LARGE)
            style |= {key: value for key, value in own.items() if INHERITED.fullmatch(key)}
            if name in SHAPES:
                yield from _shape_outlines(
                    from_element(etree.Element(element.tag, own), **style), matrix
                )
                return
            children = [self.by_id[own.get(LINK) or own["href"]]] if name == "use" else element
        if name not in ("g", "use") and depth > 0:
            _refuse(
                "paths and shapes only",
                f"<{name}>",
                "convert everything to paths and save it as plain SVG",
            )
        for child in children:
            yield from self.outlines(child, matrix, depth + 1, **style)


def _shape_outlines(shape: Any, matrix: Any) -> Iterator[Outline]:
    """Yield the filled outlines of a picosvg shape and its stroke."""
    from pathops import LineCap, LineJoin
    from picosvg.svg_pathops import skia_path

    path = skia_path(shape.as_cmd_seq(), "nonzero")
    light = _luminance(shape.fill)
    if light is not None and shape.fill_opacity > 0.0:
        yield path.transform(*matrix), shape.fill_rule == "evenodd", light < DARK
    light = _luminance(shape.stroke)
    if light is not None and shape.stroke_opacity > 0.0 and shape.stroke_width > 0.0:
        _limit(len(path), *CORNERS)
        # Skia's tolerance is absolute.
        scale = STROKE_WIDTH / shape.stroke_width
        path = path.transform(scale, 0.0, 0.0, scale)
        path.stroke(
            STROKE_WIDTH,
            LineCap[f"{shape.stroke_linecap.upper()}_CAP"],
            LineJoin[f"{shape.stroke_linejoin.upper()}_JOIN"],
            shape.stroke_miterlimit,
        )
        path.convertConicsToQuads()
        path = path.transform(1.0 / scale, 0.0, 0.0, 1.0 / scale)
        yield path.transform(*matrix), False, light < DARK


def _section(outlines: Sequence[Outline]) -> CrossSection:
    """Section of height 1: the union of the dark outlines less the light ones above them."""
    from pathops import PathVerb

    if not outlines:
        _refuse("at least one filled path or shape", "none", "fill one, or name another file")
    # Paths that are not finite have no bounds.
    boxes = [path.bounds or 4 * (math.inf,) for path, _, _ in outlines]
    if not all(abs(place) < MOST_COORDINATE for box in boxes for place in box):
        _refuse(*TOO_LARGE)
    dark = [box for box, (_, _, is_dark) in zip(boxes, outlines, strict=True) if is_dark]
    height = max((box[3] for box in dark), default=0) - min((box[1] for box in dark), default=0)
    if not height > 0.0:
        _refuse(*NO_AREA)
    shapes, corners = [], 0
    for path, _, _ in outlines:
        pen = PolylinePen(CHORD_TOLERANCE * height)
        draw: dict[Any, Callable[..., None]] = {
            PathVerb.MOVE: pen.moveTo,
            PathVerb.LINE: pen.lineTo,
            PathVerb.QUAD: pen.qCurveTo,
            PathVerb.CUBIC: pen.curveTo,
            PathVerb.CLOSE: pen.closePath,
        }
        for verb, points in path:
            draw[verb](*points)
            _limit(corners + pen.corners, *CORNERS)
        corners += pen.corners
        shapes.append([contour * (1.0, -1.0) for contour in pen.contours()])
    section = CrossSection()
    for contours, (_, is_even_odd, is_dark) in zip(shapes, outlines, strict=True):
        area = CrossSection(contours, FillRule.EvenOdd if is_even_odd else FillRule.NonZero)
        _limit(area.num_vert(), *CORNERS)
        section = section + area if is_dark else section - area
        _limit(section.num_vert(), *CORNERS)
    if not section.area() > 0.0:
        _refuse(*NO_AREA)
    left, bottom, _, top = section.bounds()
    scale = 1.0 / (top - bottom)
    return section.translate((-left, -bottom)).scale((scale, scale))


def _luminance(color: str) -> float | None:
    """Luminance in [0, 1] of a CSS color: a name, #rgb, #rrggbb, rgb(), or currentColor, which is
    0; None if transparent. Raises InputError for others, such as url()."""
    from PIL import ImageColor

    plain = color.lower()
    if plain in ("none", "transparent"):
        return None
    try:
        call = re.fullmatch(r"rgba?\(([^()]*)\)", plain)
        if call is None:
            channels = (*ImageColor.getrgb("black" if plain == "currentcolor" else plain), 255)
        else:
            parts = re.split(r"[\s,/]+", f"{call[1].strip()},1")
            channels = tuple(
                float(part.removesuffix("%")) * (2.55 if part.endswith("%") else 1.0)
                for part in parts
            )
        red, green, blue, alpha = channels[:4]
        light = float(np.dot(LUMINANCE, np.clip((red, green, blue), 0.0, 255.0))) / 255.0
        if not math.isfinite(light):
            raise ValueError(color)
    except ValueError:
        _refuse(
            "plain colors such as black or #202020",
            repr(color[:60]),
            "fill shapes with one, or export them again",
        )
    return light if alpha > 0.0 else None
