"""Widths of strokes and of what is between them, against shapes whose widths are known."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from manifold3d import JoinType

from dicedesign.fabricate.fine_parts import narrowest_gap, narrowest_stroke
from dicedesign.fabricate.label_art import text_section


def bar(x: float, y: float, width: float, height: float) -> np.ndarray:
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    return np.array([(x + a, y + b) for a, b in corners])


def ring(radius: float, corners: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(corners) / corners
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_bar_is_as_wide_as_its_shorter_side() -> None:
    assert narrowest_stroke([bar(3.0, -1.0, 0.3, 2.0)]) == pytest.approx(0.3, rel=1e-12)
    assert narrowest_gap([bar(3.0, -1.0, 0.3, 2.0)]) is None


def test_two_bars_have_a_gap() -> None:
    bars = [bar(0.0, 0.0, 0.5, 2.0), bar(0.7, 0.0, 0.4, 2.0)]
    assert narrowest_stroke(bars) == pytest.approx(0.4, rel=1e-12)
    assert narrowest_gap(bars) == pytest.approx(0.2, rel=1e-12)


def test_a_ring_is_as_wide_as_its_radii_differ() -> None:
    """Between two polygons of as many sides it is the difference of their inscribed circles."""
    contours = [ring(2.0, 40), ring(1.4, 40)[::-1]]
    inscribed = np.cos(np.pi / 40)
    assert narrowest_stroke(contours) == pytest.approx(0.6 * inscribed, rel=1e-12)
    assert narrowest_gap(contours) == pytest.approx(2.8 * inscribed, rel=1e-12)


def test_memory_is_bounded() -> None:
    """A ring of 8,000 corners, in closed form as above, in less memory than one number for each
    pair of them would take."""
    contours, inscribed = [ring(2.0, 4000), ring(1.4, 4000)[::-1]], np.cos(np.pi / 4000)
    tracemalloc.start()
    try:
        assert narrowest_stroke(contours) == pytest.approx(0.6 * inscribed, rel=1e-9)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 100e6 < 8 * 8000**2


def test_turning_and_scaling_change_nothing_else() -> None:
    contours = text_section("85").to_polygons()
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    for narrowest in (narrowest_stroke, narrowest_gap):
        turned = narrowest([3.0 * contour @ turn.T for contour in contours])
        assert turned == pytest.approx(3.0 * narrowest(contours), rel=1e-9)


def test_a_triangle_has_no_strokes() -> None:
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 0.9)])
    assert narrowest_stroke([corners]) is None
    assert narrowest_stroke([]) is None


@pytest.mark.parametrize(
    "text", ["1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "H", "E", "W", "M"]
)
def test_what_is_opened_by_half_a_stroke_loses_it(text: str) -> None:
    """By another way: a disc (with corners) that is thinner than the thinnest stroke can be rolled
    everywhere within the label, and one that is thicker cannot."""
    section = text_section(text)
    stroke = narrowest_stroke(section.to_polygons())

    def kept(width: float) -> float:
        opened = section.offset(-width / 2, JoinType.Miter).offset(width / 2, JoinType.Miter)
        return (section ^ opened).area() / section.area()

    assert kept(0.95 * stroke) > 0.995
    assert kept(1.1 * stroke) < 0.97


@pytest.mark.parametrize("text", ["5", "8", "10", "E", "H"])
def test_what_is_closed_by_half_a_gap_fills_it(text: str) -> None:
    """The same from outside; curves that grow are a little larger in any case."""
    section = text_section(text)
    gap = narrowest_gap(section.to_polygons())

    def filled(width: float) -> float:
        closed = section.offset(width / 2, JoinType.Miter).offset(-width / 2, JoinType.Miter)
        return closed.area() / section.area() - 1.0

    assert filled(0.95 * gap) < 0.02
    assert filled(1.1 * gap) > 0.03


@pytest.mark.parametrize("text", ["heads", "tails", "edge", "sag"])
def test_joints_of_curves_are_no_strokes(text: str) -> None:
    """They are short: what is lost with them is nothing that one would miss."""
    section = text_section(text)
    stroke = narrowest_stroke(section.to_polygons())
    digits = [narrowest_stroke(text_section(digit).to_polygons()) for digit in "0123456789"]
    assert 0.8 * min(digits) < stroke < max(digits)
