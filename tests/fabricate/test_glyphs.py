"""Text as outlines and sections, against fontTools' own reading of the font."""

from __future__ import annotations

import subprocess
import sys
from itertools import combinations, pairwise

import numpy as np
import pytest
from fontTools.pens.areaPen import AreaPen
from fontTools.ttLib import TTFont

from dicedesign.errors import EngravingError
from dicedesign.fabricate.fonts import _bundled
from dicedesign.fabricate.label_art import (
    LINE_SPACING,
    line_breaks,
    text_contours,
    text_section,
)
from dicedesign.fabricate.sections import CHORD_TOLERANCE


@pytest.fixture(scope="module")
def bundled() -> TTFont:
    return TTFont(_bundled())


def shoelace(contour: np.ndarray) -> float:
    following = np.roll(contour, -1, axis=0)
    return 0.5 * float((contour[:, 0] * following[:, 1] - contour[:, 1] * following[:, 0]).sum())


def area_by_fonttools(font: TTFont, text: str) -> float:
    glyphs, unit = font.getGlyphSet(), font["glyf"]["one"].yMax
    total = 0.0
    for character in text:
        pen = AreaPen(glyphs)
        glyphs[font.getBestCmap()[ord(character)]].draw(pen)
        total += abs(pen.value)
    return total / unit**2


@pytest.mark.parametrize(
    ("digit", "holes"), list(zip("0123456789", (1, 0, 0, 0, 1, 0, 1, 0, 2, 1), strict=True))
)
def test_digits_have_their_holes(digit: str, holes: int) -> None:
    contours = text_section(digit).to_polygons()
    areas = [shoelace(np.asarray(contour)) for contour in contours]
    assert sum(area < 0 for area in areas) == holes
    assert sum(area > 0 for area in areas) == 1


@pytest.mark.parametrize("text", ["0", "8", "16", "66", "3/6", "A & B", "2d6", "½", "ÄÖ"])
def test_areas_are_those_that_fonttools_finds_for_the_curves(bundled: TTFont, text: str) -> None:
    expected = area_by_fonttools(bundled, text.replace(" ", ""))
    assert text_section(text).area() == pytest.approx(expected, rel=3e-3)


def test_unit_is_the_digit_height_and_the_baseline_is_zero() -> None:
    points = np.concatenate(text_contours("1"))
    assert points[:, 1].min() == 0.0
    assert points[:, 1].max() == 1.0


def test_digits_are_equally_wide_and_not_kerned() -> None:
    starts = [text_contours(digit + "1")[-1][:, 0].min() for digit in "0123456789"]
    np.testing.assert_allclose(starts, starts[0])
    step = starts[0] - text_contours("1")[0][:, 0].min()
    third = text_contours("111")[2][:, 0].min() - text_contours("1")[0][:, 0].min()
    assert third == pytest.approx(2 * step)


@pytest.mark.parametrize("pair", ["AV", "To", "LT"])
def test_pairs_are_set_by_the_kerning_of_the_font(bundled: TTFont, pair: str) -> None:
    metrics, names, unit = bundled["hmtx"], bundled.getBestCmap(), bundled["glyf"]["one"].yMax
    kerning = bundled["kern"].kernTables[0]
    left, right = (names[ord(character)] for character in pair)
    assert kerning[left, right] < 0
    expected = (metrics[left][0] + kerning[left, right] + metrics[right][1]) / unit
    assert text_contours(pair)[-1][:, 0].min() >= 0.0
    first = text_contours(pair[0])
    others = np.concatenate(text_contours(pair)[len(first) :])
    assert others[:, 0].min() == pytest.approx(expected, abs=2e-3)


def test_curves_are_flattened_finely() -> None:
    # The outer contour of "0" has its extreme points on the curve: along it, the outline turns by
    # a small angle at each corner, as a chord of sagitta CHORD_TOLERANCE on a curve does.
    outline = max(text_contours("0"), key=lambda contour: abs(shoelace(contour)))
    edges = np.roll(outline, -1, axis=0) - outline
    following = np.roll(edges, -1, axis=0)
    turn = np.arctan2(
        edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0], (edges * following).sum(1)
    )
    sagitta = np.linalg.norm(edges, axis=1) * np.abs(turn) / 8
    assert sagitta.max() < 2 * CHORD_TOLERANCE


def test_lines_are_centred_one_below_the_other() -> None:
    section, upper, lower = (text_section(text) for text in ("11\n4", "11", "4"))
    assert section.area() == pytest.approx(upper.area() + lower.area(), rel=1e-6)
    left, bottom, right, top = section.bounds()
    assert (bottom, top) == pytest.approx((0.0, 1.0 + LINE_SPACING), abs=1e-6)
    cut = [part.bounds() for part in section.decompose()]
    ones = [(x0, x1) for x0, y0, x1, _ in cut if y0 > 1.0]
    (x0,) = [x0 for x0, y0, _, _ in cut if y0 < 1.0]
    assert len(ones) == 2
    # Digits are centred in equal widths: that of the one below is half a width further.
    start = lower.bounds()[0]
    digit = text_contours("11")[1][:, 0].min() - text_contours("1")[0][:, 0].min()
    assert x0 == pytest.approx(start + 0.5 * digit, abs=1e-6)
    assert right - left < 2 * digit


def test_lines_are_broken_at_spaces_where_the_widest_is_narrowest() -> None:
    """Against all ways to break, by the bounds of what is drawn."""
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


@pytest.mark.parametrize("text", ["word", "12", "no\N{NO-BREAK SPACE}break"])
def test_a_text_without_spaces_stays_in_its_line(text: str) -> None:
    assert list(line_breaks(text)) == [text]


def test_text_from_right_to_left_runs_that_way() -> None:
    """The first letter, alef, is the rightmost: of three parts the bounds of the last in x."""
    alef, both = text_section("א"), text_section("אב")
    rightmost = max(both.decompose(), key=lambda part: part.bounds()[2])
    assert rightmost.area() == pytest.approx(alef.area(), rel=1e-6)


def test_a_character_that_the_font_lacks_is_named() -> None:
    with pytest.raises(EngravingError, match=r"font DejaVu Sans Bold, got '骰' \(U\+9AB0\)"):
        text_contours("1骰")


@pytest.mark.parametrize("text", ["", " ", "\n"])
def test_a_label_that_draws_nothing_is_refused(text: str) -> None:
    with pytest.raises(EngravingError, match="at least one visible character"):
        text_section(text)


def test_fabricating_loads_no_matplotlib_and_no_torch() -> None:
    code = (
        "import sys\n"
        "import dicedesign.fabricate.engraving, dicedesign.geometry.meshes.formats\n"
        "from dicedesign.fabricate.label_art import text_section\n"
        "text_section('6')\n"
        "print([name for name in ('matplotlib', 'torch', 'lxml') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
