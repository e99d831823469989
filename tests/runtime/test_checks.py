"""Checks of numbers that people give."""

from __future__ import annotations

import pytest

from dicedesign.errors import InputError
from dicedesign.runtime.checks import check_whole


def test_whole_numbers() -> None:
    check_whole("--jobs", 1)
    check_whole("seed", 0, least=0)
    with pytest.raises(InputError, match=r"^--jobs: expected a whole number above 0, got 0; raise"):
        check_whole("--jobs", 0)
    with pytest.raises(InputError, match=r"^dice: expected a whole number of at least 8, got -1"):
        check_whole("dice", -1, least=8)
    with pytest.raises(InputError, match=r"^drops: expected a whole number up to 1000000000, got"):
        check_whole("drops", 10**12)
    with pytest.raises(InputError, match=r"^--jobs: expected a whole number up to 8, got 9; lower"):
        check_whole("--jobs", 9, most=8)
