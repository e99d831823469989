"""The exception tree, and the error about what is not installed."""

from __future__ import annotations

import pytest

from dicedesign import errors
from dicedesign.errors import (
    DiceError,
    InputError,
    LabelRoomError,
    OutputError,
    check_whole,
    missing_extra,
)


@pytest.mark.parametrize("name", [name for name in errors.__all__ if name.endswith("Error")])
def test_errors_are_caught_by_their_standard_kind_too(name: str) -> None:
    kind = getattr(errors, name)
    assert issubclass(kind, DiceError)
    if kind is not DiceError:
        assert issubclass(kind, OSError if kind is OutputError else ValueError)


def test_an_extra_that_is_missing_is_named_with_the_way_to_it() -> None:
    fault = ImportError("No module named 'igl'")
    error = missing_extra("repair", "winding numbers", fault)
    assert isinstance(error, InputError)
    for part in ("winding numbers: ", str(fault), "pip install 'dicedesign[repair]'"):
        assert part in str(error)


def test_labels_without_room_name_a_sufficient_size() -> None:
    error = LabelRoomError("too small", 31.5)
    assert (str(error), error.size_mm) == ("too small", 31.5)


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
