"""What options of concave dice are refused, and in which words."""

from __future__ import annotations

import math
from typing import Any

import pytest

from dicedesign.concave.options import ConcaveOptions
from dicedesign.errors import InputError


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"tolerance": 0.0}, "tolerance: expected a number above 0 and below 1, got 0; leave it"),
        ({"tolerance": 1.0}, "tolerance: expected a number above 0 and below 1, got 1; leave it"),
        ({"tolerance": math.nan}, "tolerance: expected a number above 0 and below 1, got nan"),
        ({"hull": "exact"}, "hull: expected gauss_newton or descent, got 'exact'; choose one"),
        ({"fill": ""}, "fill: expected correspondence or quadratic, got ''; choose one"),
        ({"points": 49}, "points: expected at least 50, got 49; raise it, or leave it out to keep"),
        ({"attempts": 0}, "attempts: expected a whole number above 0, got 0; leave it out for 40"),
        ({"enough": 0}, "enough: expected a whole number above 0, got 0; leave it out for 8"),
        ({"displacement": 0.0}, "displacement: expected a positive number, got 0; leave it out"),
        ({"displacement": math.inf}, "displacement: expected a positive number, got inf"),
        ({"seconds": -1.0}, "seconds: expected a positive number, got -1; leave it out"),
        ({"seconds": math.nan}, "seconds: expected a positive number, got nan; leave it out"),
    ],
)
def test_values_out_of_range(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        ConcaveOptions(**options)


def test_the_ends_of_the_ranges_are_taken() -> None:
    options = ConcaveOptions(tolerance=0.999, points=50, attempts=1, displacement=1e-9, seconds=0.1)
    assert (options.hull, options.fill) == ("gauss_newton", "correspondence")
