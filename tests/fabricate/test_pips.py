from __future__ import annotations

import math

import numpy as np
import pytest

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import MOST_PIPS, label_arts, pip_places, pips_section

NUMBERS = range(1, MOST_PIPS + 1)


@pytest.mark.parametrize("number", NUMBERS)
def test_there_are_as_many_pips_of_the_area_of_circles_in_the_square(number: int) -> None:
    section = pips_section(str(number))
    _, diameter = pip_places(number)
    parts = section.decompose()
    assert len(parts) == number
    assert section.area() == pytest.approx(number * math.pi * diameter**2 / 4.0, rel=0.02)
    left, bottom, right, top = section.bounds()
    assert min(left, bottom) > -1e-6
    assert max(right, top) < 1.0 + 1e-6


@pytest.mark.parametrize("number", NUMBERS)
def test_patterns_are_the_same_after_half_a_turn(number: int) -> None:
    """So that no pattern has an upright."""
    places, _ = pip_places(number)
    turned = 1.0 - places
    gaps = np.linalg.norm(places[:, None] - turned, axis=-1)
    assert gaps.min(axis=1).max() < 1e-12


@pytest.mark.parametrize("number", NUMBERS)
def test_pips_are_apart(number: int) -> None:
    places, diameter = pip_places(number)
    gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(number, 1)]
    assert number == 1 or gaps.min() > 1.2 * diameter


def test_pips_of_ordinary_dice_are_equal_and_fill_one_square() -> None:
    options = EngravingOptions(content="pips")
    assert {label_arts(str(n), options)[0].box for n in range(1, 10)} == {(0.0, 0.0, 1.0, 1.0)}
    assert len({pip_places(n)[1] for n in range(1, 10)}) == 1


@pytest.mark.parametrize("text", ["0", "21", "six", "-1", "1.5", "²", ""])
def test_what_is_no_such_number_is_refused(text: str) -> None:
    with pytest.raises(EngravingError, match="whole number from 1 to 20 to show as pips"):
        pips_section(text)
