"""Outlines of labels, against constructed fonts, fontTools and closed forms."""

from __future__ import annotations

import contextlib
import math
import random
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from fontTools.fontBuilder import FontBuilder
from fontTools.pens.areaPen import AreaPen
from fontTools.pens.t2CharStringPen import T2CharStringPen
from fontTools.ttLib import TTFont

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.fonts import _bundled_font
from dicedesign.fabricate.label_art import (
    MOST_PIPS,
    add_mark,
    label_arts,
    line_breaks,
    pip_places,
    pips_section,
    reads_upside_down,
    text_contours,
    text_section,
)


def test_numbers_that_read_differently_upside_down_are_marked() -> None:
    """Among all numbers up to 999, those whose turned digits are another number without a leading
    zero."""
    turned = {"0": "0", "1": "1", "6": "9", "8": "8", "9": "6"}
    for number in range(1000):
        text = str(number)
        if set(text) <= set(turned):
            other = "".join(turned[digit] for digit in text[::-1])
            expected = other != text and str(int(other)) == other
        else:
            expected = False
        assert reads_upside_down(text) == expected
    assert not any(map(reads_upside_down, ["", "6a", "-6"]))


def test_an_ambiguous_label_has_a_bar_beneath_as_wide_as_the_text() -> None:
    text = "16"
    plain = text_section(text)
    left, bottom, right, _ = plain.bounds()
    *_, (x0, y0, x1, y1) = sorted(
        (part.bounds() for part in label_arts(text, EngravingOptions())[0].section.decompose()),
        key=lambda bounds: -bounds[1],
    )
    assert y1 < bottom
    assert (x0, x1) == pytest.approx((left, right), abs=1e-6)
    assert (x1 - x0) * (y1 - y0) == pytest.approx(add_mark(plain, "bar").area() - plain.area())


def test_a_dot_follows_the_number_on_its_baseline() -> None:
    options = EngravingOptions(ambiguous="dot")
    plain, dotted = text_section("9"), label_arts("9", options)[0].section
    dot = max(dotted.decompose(), key=lambda part: part.bounds()[0])
    left, bottom, right, top = dot.bounds()
    assert left > plain.bounds()[2]
    assert bottom == pytest.approx(0.0, abs=1e-6)
    assert dot.area() == pytest.approx(math.pi * (right - left) * (top - bottom) / 4.0, rel=0.02)
    assert dotted.area() == pytest.approx(plain.area() + dot.area())


def test_pips_are_separate_circles_symmetric_under_a_half_turn() -> None:
    for number in range(1, MOST_PIPS + 1):
        section = pips_section(str(number))
        places, diameter = pip_places(number)
        assert len(section.decompose()) == number
        assert section.area() == pytest.approx(number * math.pi * diameter**2 / 4.0, rel=0.02)
        assert min(section.bounds()) > -1e-6
        assert max(section.bounds()) < 1.0 + 1e-6
        gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(number, 1)]
        assert (gaps > 1.2 * diameter).all()
        turned = np.linalg.norm(places[:, None] - (1.0 - places), axis=-1)
        assert turned.min(axis=1).max() < 1e-12
    for text in ("0", "21", "six", "-1", "1.5", "²", ""):
        with pytest.raises(EngravingError, match="whole number from 1 to 20 to show as pips"):
            pips_section(text)


def area_by_fonttools(font: TTFont, text: str) -> float:
    glyphs, unit = font.getGlyphSet(), font["glyf"]["one"].yMax
    total = 0.0
    for character in text:
        pen = AreaPen(glyphs)
        glyphs[font.getBestCmap()[ord(character)]].draw(pen)
        total += abs(pen.value)
    return total / unit**2


def test_areas_equal_those_of_fonttools() -> None:
    font = TTFont(_bundled_font())
    for text in ("0", "8", "16", "66", "3/6", "A & B", "2d6", "½", "ÄÖ"):
        expected = area_by_fonttools(font, text.replace(" ", ""))
        assert text_section(text).area() == pytest.approx(expected, rel=3e-3)


def test_lines_are_broken_at_spaces_where_the_widest_is_narrowest() -> None:
    """Compared with all line breaks, by the bounds of the sections."""
    words = ["a", "critical", "hit", "or", "a", "miss"]
    broken = list(line_breaks(" ".join(words)))
    assert [text.count("\n") for text in broken] == [0, 1, 2, 3]
    assert all(text.replace("\n", " ").split(" ") == words for text in broken)
    for count, text in enumerate(broken):
        widths = []
        for breaks in combinations(range(1, len(words)), count):
            ends = [0, *breaks, len(words)]
            lines = [" ".join(words[i:j]) for i, j in pairwise(ends)]
            widths.append(max(text_section(line).bounds()[2] for line in lines))
        widest = max(text_section(line).bounds()[2] for line in text.split("\n"))
        assert widest == pytest.approx(min(widths), abs=0.1)


def test_right_to_left_text() -> None:
    """The first letter, alef, is the rightmost."""
    alef, both = text_section("א"), text_section("אב")
    rightmost = max(both.decompose(), key=lambda part: part.bounds()[2])
    assert rightmost.area() == pytest.approx(alef.area(), rel=1e-6)


def test_a_character_that_the_font_lacks_is_named() -> None:
    with pytest.raises(EngravingError, match=r"font DejaVu Sans Bold, got '骰' \(U\+9AB0\)"):
        text_contours("1骰")


def test_a_label_that_draws_nothing_is_refused() -> None:
    with pytest.raises(EngravingError, match="at least one visible character"):
        text_section(" ")


UPEM = 1000

KAPPA = 4.0 / 3.0 * (math.sqrt(2.0) - 1.0)
"""Length of the handles of a cubic curve that is nearly a quarter of a circle."""


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


def test_cubic_curves_overlaps_and_kerning_of_an_otf(tmp_path: Path) -> None:
    """The digit 1 and the letter H have one outline, 700 units tall and 800 wide: two concentric
    circles of the same orientation, as the strokes of variable fonts overlap."""
    names, strings = [".notdef", "one", "H"], {}
    for name in names:
        pen = T2CharStringPen(800, None)
        if name != ".notdef":
            circle(pen, 350, 350, 350)
            circle(pen, 350, 350, 100)
        strings[name] = pen.getCharString()
    builder = FontBuilder(UPEM, isTTF=False)
    builder.setupGlyphOrder(names)
    builder.setupCharacterMap({ord("1"): "one", ord("H"): "H"})
    builder.setupCFF("Built", {}, strings, {})
    builder.setupHorizontalMetrics(dict.fromkeys(names, (800, 0)))
    builder.setupHorizontalHeader(ascent=800, descent=-200)
    builder.setupOS2()
    builder.setupNameTable({"familyName": "Built", "styleName": "Regular"})
    builder.setupPost()
    builder.addOpenTypeFeatures("feature kern { pos one H -300; } kern;")
    path = tmp_path / "built.otf"
    builder.save(path)
    section = text_section("1", str(path))
    assert section.num_contour() == 1
    assert section.area() == pytest.approx(math.pi / 4.0, rel=5e-3)
    for text, width in (("1H", 1200 / 700), ("H1", 1500 / 700)):
        left, _, right, _ = text_section(text, str(path)).bounds()
        assert (left, right) == pytest.approx((0.0, width), abs=1e-6)


def test_a_family_gives_its_bold_face() -> None:
    by_name, bundled = text_section("8", "DejaVu Sans"), text_section("8")
    assert by_name.area() == pytest.approx(bundled.area())
    assert text_section("8", "dejavu serif").area() != pytest.approx(bundled.area(), rel=1e-2)


def test_an_unknown_family_is_refused_with_a_remedy() -> None:
    with pytest.raises(InputError, match=r"engrave.font: expected the family .* 'DejaVu Sanz'"):
        text_section("1", "DejaVu Sanz")


@pytest.mark.parametrize(
    "content", [b"", b"not a font", b"\x00\x01\x00\x00" + bytes(500), b"OTTO\xff\xff" * 99]
)
def test_a_file_that_is_no_font_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.otf"
    path.write_bytes(content)
    with pytest.raises(InputError, match="expected a TTF or OTF font with outlines"):
        text_section("1", str(path))


def test_damaged_fonts_give_a_label_or_an_input_error(tmp_path: Path) -> None:
    """Bytes overwritten anywhere or in the list of tables, and files cut short."""
    data, chance = _bundled_font().read_bytes(), random.Random(0)
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
