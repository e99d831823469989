"""Fonts by name and by file, against fonts built here and fontTools' own reading."""

from __future__ import annotations

import contextlib
import math
import random
from itertools import pairwise
from pathlib import Path

import pytest
from fontTools.fontBuilder import FontBuilder
from fontTools.pens.t2CharStringPen import T2CharStringPen
from fontTools.pens.ttGlyphPen import TTGlyphPen

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.fonts import _bundled
from dicedesign.fabricate.label_art import text_section

UPEM = 1000

KAPPA = 4.0 / 3.0 * (math.sqrt(2.0) - 1.0)
"""Length of the handles of a cubic curve that is nearly a quarter of a circle."""


def square(pen, left: float, bottom: float, side: float, clockwise: bool) -> None:
    corners = [(0, 0), (0, 1), (1, 1), (1, 0)] if clockwise else [(0, 0), (1, 0), (1, 1), (0, 1)]
    places = [(left + side * x, bottom + side * y) for x, y in corners]
    pen.moveTo(places[0])
    for place in places[1:]:
        pen.lineTo(place)
    pen.closePath()


def circle(pen, x: float, y: float, radius: float) -> None:
    """Counter-clockwise, of four cubic curves."""
    handle = KAPPA * radius
    pen.moveTo((x + radius, y))
    turns = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 0)]
    for (a, b), (c, d) in pairwise(turns):
        pen.curveTo(
            (x + radius * a + handle * c, y + radius * b + handle * d),
            (x + radius * c + handle * a, y + radius * d + handle * b),
            (x + radius * c, y + radius * d),
        )
    pen.closePath()


def written_font(path: Path, is_cff: bool, draw, kerning: str = "") -> Path:
    """A font with a digit 1, drawn by `draw`, 700 units tall, and a letter H of the same outline;
    each 800 wide."""
    builder = FontBuilder(UPEM, isTTF=not is_cff)
    names = [".notdef", "one", "H"]
    builder.setupGlyphOrder(names)
    builder.setupCharacterMap({ord("1"): "one", ord("H"): "H"})
    if is_cff:
        strings = {}
        for name in names:
            pen = T2CharStringPen(800, None)
            if name != ".notdef":
                draw(pen)
            strings[name] = pen.getCharString()
        builder.setupCFF("Made", {}, strings, {})
    else:
        glyphs = {}
        for name in names:
            pen = TTGlyphPen(None)
            if name != ".notdef":
                draw(pen)
            glyphs[name] = pen.glyph()
        builder.setupGlyf(glyphs)
    builder.setupHorizontalMetrics(dict.fromkeys(names, (800, 0)))
    builder.setupHorizontalHeader(ascent=800, descent=-200)
    builder.setupOS2()
    builder.setupNameTable({"familyName": "Made", "styleName": "Regular"})
    builder.setupPost()
    if kerning:
        builder.addOpenTypeFeatures(kerning)
    builder.save(path)
    return path


@pytest.mark.parametrize("is_cff", [True, False])
@pytest.mark.parametrize("outer_clockwise", [True, False])
def test_contours_may_run_either_way_around(
    tmp_path: Path, is_cff: bool, outer_clockwise: bool
) -> None:
    """A square with a hole, which runs the other way."""

    def draw(pen) -> None:
        square(pen, 0, 0, 700, outer_clockwise)
        square(pen, 200, 200, 300, not outer_clockwise)

    path = written_font(tmp_path / ("made.otf" if is_cff else "made.ttf"), is_cff, draw)
    section = text_section("1", str(path))
    assert section.area() == pytest.approx(1.0 - (3.0 / 7.0) ** 2, rel=1e-6)
    assert section.bounds()[3] == pytest.approx(1.0)


def test_overlapping_contours_are_joined(tmp_path: Path) -> None:
    """As variable fonts have them."""

    def draw(pen) -> None:
        square(pen, 0, 0, 700, True)
        square(pen, 350, 0, 700, True)

    section = text_section("1", str(written_font(tmp_path / "made.ttf", False, draw)))
    assert section.area() == pytest.approx(1.5, rel=1e-6)
    assert section.num_contour() == 1


def test_cubic_curves_of_an_otf_are_followed(tmp_path: Path) -> None:
    path = written_font(tmp_path / "made.otf", True, lambda pen: circle(pen, 350, 350, 350))
    section = text_section("1", str(path))
    assert section.area() == pytest.approx(math.pi / 4.0, rel=5e-3)


@pytest.mark.parametrize("kern", [-300, 150])
def test_kerning_by_gpos_is_kept(tmp_path: Path, kern: int) -> None:
    rules = f"feature kern {{ pos one H {kern}; }} kern;"
    path = written_font(
        tmp_path / "made.ttf", False, lambda pen: square(pen, 0, 0, 700, True), rules
    )
    left, _, right, _ = text_section("1H", str(path)).bounds()
    assert (left, right) == pytest.approx((0.0, (800 + kern + 700) / 700), abs=1e-6)
    _, _, right, _ = text_section("H1", str(path)).bounds()
    assert right == pytest.approx(1500 / 700, abs=1e-6)


def test_a_font_that_changes_on_disk_is_read_again(tmp_path: Path) -> None:
    path = written_font(tmp_path / "a.ttf", False, lambda pen: square(pen, 0, 0, 700, True))
    assert text_section("1", str(path)).area() == pytest.approx(1.0)
    written_font(path, True, lambda pen: circle(pen, 350, 350, 350))
    assert text_section("1", str(path)).area() < 0.8


def test_a_family_gives_its_bold_face() -> None:
    by_name, bundled = text_section("8", "DejaVu Sans"), text_section("8")
    assert by_name.area() == pytest.approx(bundled.area())
    assert text_section("8", "dejavu serif").area() != pytest.approx(bundled.area(), rel=1e-2)


def test_the_bundled_font_is_the_default_and_a_file_like_others() -> None:
    assert text_section("8", str(_bundled())).area() == text_section("8").area()
    assert text_section("8", EngravingOptions().font).area() == text_section("8").area()


@pytest.mark.parametrize("name", ["No Such Font", "DejaVu Sanz", "serif"])
def test_an_unknown_family_is_refused_with_a_remedy(name: str) -> None:
    with pytest.raises(InputError, match=rf"engrave.font: expected the family .* got '{name}'"):
        text_section("1", name)


@pytest.mark.parametrize(
    "content", [b"", b"not a font", b"\x00\x01\x00\x00" + bytes(500), b"OTTO\xff\xff" * 99]
)
def test_a_file_that_is_no_font_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.otf"
    path.write_bytes(content)
    with pytest.raises(InputError, match="expected a TTF or OTF font with outlines"):
        text_section("1", str(path))


def test_a_font_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        text_section("1", str(tmp_path / "none.ttf"))


def test_damaged_fonts_give_a_label_or_an_error_of_ours(tmp_path: Path) -> None:
    """Bytes overwritten anywhere or in the list of tables, and files cut short."""
    data, chance = _bundled().read_bytes(), random.Random(0)
    path = tmp_path / "damaged.ttf"
    for _ in range(60):
        damaged = bytearray(data)
        for _ in range(chance.choice((1, 5, 100))):
            place = chance.randrange(chance.choice((300, len(data))))
            damaged[place] = chance.randrange(256)
        if chance.random() < 0.2:
            damaged = damaged[: chance.randrange(len(data))]
        path.write_bytes(damaged)
        with contextlib.suppress(InputError, EngravingError):
            assert text_section("128", str(path)).area() > 0.0
