from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from dicedesign.errors import EngravingError
from dicedesign.fabricate.labels.glyphs import (
    CHORD_TOLERANCE,
    label_contours,
    reads_upside_down,
    text_contours,
    text_section,
)


def shoelace(contour: np.ndarray) -> float:
    following = np.roll(contour, -1, axis=0)
    return 0.5 * float((contour[:, 0] * following[:, 1] - contour[:, 1] * following[:, 0]).sum())


@pytest.mark.parametrize(
    ("digit", "holes"), list(zip("0123456789", (1, 0, 0, 0, 1, 0, 1, 0, 2, 1), strict=True))
)
def test_digits_have_their_holes_and_turn_the_right_way(digit, holes):
    areas = [shoelace(contour) for contour in text_contours(digit)]
    assert sum(area < 0 for area in areas) == holes
    assert sum(area > 0 for area in areas) == 1
    assert 0.2 < sum(areas) < 0.7


@pytest.mark.parametrize("text", ["0", "8", "16", "66", "3/6", "A & B", "2d6"])
def test_section_area_is_the_signed_sum_of_the_contours(text):
    expected = sum(shoelace(contour) for contour in label_contours(text))
    assert text_section(text).area() == pytest.approx(expected, rel=1e-6)


def test_unit_is_the_digit_height_and_the_baseline_is_zero():
    points = np.concatenate(text_contours("1"))
    assert points[:, 1].min() == 0.0
    assert points[:, 1].max() == 1.0


def test_digits_are_equally_wide():
    starts = [text_contours(digit + "1")[-1][:, 0].min() for digit in "0123456789"]
    np.testing.assert_allclose(starts, starts[0])
    step = starts[0] - text_contours("1")[0][:, 0].min()
    third = text_contours("111")[2][:, 0].min() - text_contours("1")[0][:, 0].min()
    assert third == pytest.approx(2 * step)


def test_curves_are_flattened_finely():
    # The outer contour of "0" has its extreme points on the curve: along it, the outline turns by
    # a small angle at each corner, as a chord of sagitta CHORD_TOLERANCE on a curve does.
    outline = max(text_contours("0"), key=shoelace)
    edges = np.roll(outline, -1, axis=0) - outline
    following = np.roll(edges, -1, axis=0)
    turn = np.arctan2(
        edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0], (edges * following).sum(1)
    )
    sagitta = np.linalg.norm(edges, axis=1) * np.abs(turn) / 8
    assert sagitta.max() < 2 * CHORD_TOLERANCE


def test_coordinates_are_not_shared_between_calls():
    text_contours("4")[0][:] = 0.0
    assert text_section("4").area() > 0.2


@pytest.mark.parametrize("text", ["6", "9", "66", "99", "68", "89", "16", "91", "61", "01", "106"])
def test_ambiguous(text):
    assert reads_upside_down(text) is True


@pytest.mark.parametrize(
    "text", ["", "0", "1", "8", "11", "88", "69", "96", "10", "60", "2", "26", "6a", "1001", "-6"]
)
def test_not_ambiguous(text):
    assert reads_upside_down(text) is False


@pytest.mark.parametrize("text", ["6", "9", "16", "68"])
def test_an_ambiguous_label_has_a_bar_beneath_as_wide_as_the_text(text):
    *letters, bar = label_contours(text)
    points = np.concatenate(letters)
    assert len(letters) == len(text_contours(text))
    assert bar[:, 1].max() < points[:, 1].min()
    assert (bar[:, 0].min(), bar[:, 0].max()) == (points[:, 0].min(), points[:, 0].max())
    assert shoelace(bar) > 0


@pytest.mark.parametrize("text", ["8", "69", "10", "7"])
def test_other_labels_have_none(text):
    assert len(label_contours(text)) == len(text_contours(text))


def test_a_character_that_the_font_lacks_is_named():
    with pytest.raises(EngravingError, match=r"got '骰' \(U\+9AB0\)"):
        text_contours("1骰")


@pytest.mark.parametrize("text", ["", " "])
def test_a_label_that_draws_nothing_is_refused(text):
    with pytest.raises(EngravingError, match="at least one visible character"):
        text_section(text)


def test_fabricating_loads_no_matplotlib_and_no_torch():
    code = (
        "import sys\n"
        "import dicedesign.fabricate.solids.engraving, dicedesign.geometry.meshes.stl\n"
        "from dicedesign.fabricate.labels.glyphs import text_section\n"
        "text_section('6')\n"
        "print([name for name in ('matplotlib', 'torch') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
