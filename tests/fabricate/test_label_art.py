"""Outlines of labels, against constructed fonts, fontTools and closed forms."""

from __future__ import annotations

import contextlib
import math
import random
from itertools import combinations, pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from fontTools.pens.areaPen import AreaPen
from fontTools.ttLib import TTFont

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import (
    MOST_PIPS,
    label_arts,
    line_breaks,
    pip_places,
    pips_section,
    reads_upside_down,
    text_contours,
    text_section,
)

BUNDLED = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans-Bold.ttf")


def test_numbers_that_read_differently_upside_down_are_marked() -> None:
    """Among all numbers up to 999, those whose turned digits are another number without a leading
    zero."""
    turned = str.maketrans("01689", "01986")
    for number in range(1000):
        text = str(number)
        other = text[::-1].translate(turned)
        expected = set(text) <= set("01689") and other != text and str(int(other)) == other
        assert reads_upside_down(text) == expected
    assert not any(map(reads_upside_down, ["", "6a", "-6"]))


def test_a_bar_is_beneath_an_ambiguous_label_and_a_dot_after_it() -> None:
    plain = text_section("16")
    barred, dotted = (
        label_arts("16", EngravingOptions(ambiguous=mark))[0].section for mark in ("bar", "dot")
    )
    left, bottom, right, _ = plain.bounds()
    x0, y0, x1, y1 = min((part.bounds() for part in barred.decompose()), key=lambda box: box[1])
    assert y1 < bottom
    assert (x0, x1) == pytest.approx((left, right), abs=1e-6)
    assert barred.area() == pytest.approx(plain.area() + (x1 - x0) * (y1 - y0))
    x0, y0, x1, y1 = max((part.bounds() for part in dotted.decompose()), key=lambda box: box[0])
    assert x0 > right
    assert y0 == pytest.approx(0.0, abs=1e-6)
    circle = math.pi * (x1 - x0) * (y1 - y0) / 4.0
    assert dotted.area() == pytest.approx(plain.area() + circle, rel=2e-3)


def test_pips_are_separate_circles_symmetric_under_a_half_turn() -> None:
    for number in range(1, MOST_PIPS + 1):
        section = pips_section(str(number))
        places, diameter = pip_places(number)
        assert len(section.decompose()) == number
        assert section.area() == pytest.approx(number * math.pi * diameter**2 / 4.0, rel=0.02)
        assert -1e-6 < min(section.bounds()) < max(section.bounds()) < 1.0 + 1e-6
        gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(number, 1)]
        assert (gaps > 1.2 * diameter).all()
        turned = np.linalg.norm(places[:, None] - (1.0 - places), axis=-1)
        assert turned.min(axis=1).max() < 1e-12
    for text in ("0", "21", "-1", "²"):
        with pytest.raises(EngravingError, match="whole number from 1 to 20 to show as pips"):
            pips_section(text)


def test_areas_equal_those_of_fonttools() -> None:
    font = TTFont(BUNDLED)
    glyphs, names, unit = font.getGlyphSet(), font.getBestCmap(), font["glyf"]["one"].yMax
    for text in ("8", "16", "3/6", "A & B", "½", "ÄÖ"):
        expected = 0.0
        for character in text.replace(" ", ""):
            pen = AreaPen(glyphs)
            glyphs[names[ord(character)]].draw(pen)
            expected += abs(pen.value) / unit**2
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


def test_what_a_font_cannot_draw_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(EngravingError, match=r"font DejaVu Sans Bold, got '骰' \(U\+9AB0\)"):
        text_contours("1骰")
    with pytest.raises(EngravingError, match="at least one visible character"):
        text_section(" ")
    with pytest.raises(InputError, match=r"engrave.font: expected the family .* 'DejaVu Sanz'"):
        text_section("1", "DejaVu Sanz")
    path = tmp_path / "bad.otf"
    for content in (b"", b"\x00\x01\x00\x00" + bytes(500), b"OTTO\xff\xff" * 99):
        path.write_bytes(content)
        with pytest.raises(InputError, match="expected a TTF or OTF font with outlines"):
            text_section("1", str(path))


def test_letters_are_kerned() -> None:
    """As the font's own table says: "AV" is closer than "AH"."""
    gaps = []
    for pair in ("AV", "AH"):
        first, second = sorted(part.bounds()[::2] for part in text_section(pair).decompose())
        gaps.append(second[0] - first[1])
    assert gaps[0] < 0.0 < gaps[1]


def test_a_family_gives_its_bold_face() -> None:
    by_name, bundled = text_section("8", "DejaVu Sans"), text_section("8")
    assert by_name.area() == pytest.approx(bundled.area())
    assert text_section("8", "dejavu serif").area() != pytest.approx(bundled.area(), rel=1e-2)


def test_damaged_fonts_give_a_label_or_an_input_error(tmp_path: Path) -> None:
    """Bytes overwritten anywhere or in the list of tables, and files cut short."""
    data, chance = BUNDLED.read_bytes(), random.Random(0)
    path = tmp_path / "damaged.ttf"
    for _ in range(40):
        damaged = bytearray(data)
        for _ in range(chance.choice((1, 5, 100))):
            place = chance.randrange(chance.choice((300, len(data))))
            damaged[place] = chance.randrange(256)
        if chance.random() < 0.2:
            damaged = damaged[: chance.randrange(len(data))]
        path.write_bytes(damaged)
        with contextlib.suppress(InputError, EngravingError):
            assert text_section("128", str(path)).area() > 0.0
