from __future__ import annotations

import math

import pytest

from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import label_arts, marked, reads_upside_down, text_section


@pytest.mark.parametrize(
    "text",
    ["6", "9", "66", "99", "68", "89", "16", "91", "61", "01", "106", "606", "909", "86", "98"],
)
def test_ambiguous(text: str) -> None:
    assert reads_upside_down(text) is True


@pytest.mark.parametrize(
    "text", ["", "0", "1", "8", "11", "88", "69", "96", "10", "60", "2", "26", "6a", "1001", "-6"]
)
def test_not_ambiguous(text: str) -> None:
    assert reads_upside_down(text) is False


def test_one_of_two_numbers_is_the_other_turned_by_half_a_turn() -> None:
    """Of all numbers up to 999, by turning the outlines themselves: those that are marked are those
    whose turned digits are digits of another number without a leading zero."""
    turned = {"0": "0", "1": "1", "6": "9", "8": "8", "9": "6"}
    for number in range(1000):
        text = str(number)
        if set(text) <= set(turned):
            other = "".join(turned[digit] for digit in text[::-1])
            expected = other != text and str(int(other)) == other
        else:
            expected = False
        assert reads_upside_down(text) == expected


@pytest.mark.parametrize("text", ["6", "9", "16", "68", "99"])
def test_an_ambiguous_label_has_a_bar_beneath_as_wide_as_the_text(text: str) -> None:
    plain = text_section(text)
    left, bottom, right, _ = plain.bounds()
    *_, (x0, y0, x1, y1) = sorted(
        (part.bounds() for part in label_arts(text, EngravingOptions())[0].section.decompose()),
        key=lambda bounds: -bounds[1],
    )
    assert y1 < bottom
    assert (x0, x1) == pytest.approx((left, right), abs=1e-6)
    assert (x1 - x0) * (y1 - y0) == pytest.approx(marked(plain, "bar").area() - plain.area())


def test_a_dot_follows_the_number_on_its_baseline() -> None:
    options = EngravingOptions(ambiguous="dot")
    plain, dotted = text_section("9"), label_arts("9", options)[0].section
    dot = max(dotted.decompose(), key=lambda part: part.bounds()[0])
    left, bottom, right, top = dot.bounds()
    assert left > plain.bounds()[2]
    assert bottom == pytest.approx(0.0, abs=1e-6)
    assert dot.area() == pytest.approx(math.pi * (right - left) * (top - bottom) / 4.0, rel=0.02)
    assert dotted.area() == pytest.approx(plain.area() + dot.area())


@pytest.mark.parametrize("text", ["8", "69", "10", "7"])
@pytest.mark.parametrize("mark", ["bar", "dot", "none"])
def test_other_labels_are_not_marked(text: str, mark: str) -> None:
    options = EngravingOptions(ambiguous=mark)
    assert label_arts(text, options)[0].section.area() == text_section(text).area()


def test_none_leaves_ambiguous_labels_alone() -> None:
    art = label_arts("6", EngravingOptions(ambiguous="none"))[0]
    assert art.section.area() == text_section("6").area()
