"""Options of the methods for convex dice that are refused."""

from __future__ import annotations

import re
from typing import Any

import pytest

from dicedesign.errors import InputError
from dicedesign.optimize.options import (
    ExactOptions,
    PaperOptions,
    PaperWeights,
    RefineOptions,
    SobolevOptions,
)
from dicedesign.optimize.preferences import Preferences

WHOLE = "expected a whole number from 1 to"


@pytest.mark.parametrize(
    ("kind", "options", "text"),
    [
        (ExactOptions, {"tolerance": 0.0}, "tolerance: expected a number from 1e-15 on and below"),
        (ExactOptions, {"sobolev": SobolevOptions()}, 'sobolev: expected coordinates "vertices"'),
        (ExactOptions, {"seconds": float("nan")}, "seconds: expected a positive number"),
        (ExactOptions, {"evaluations": 0}, "evaluations: expected a whole number above 0"),
        (PaperOptions, {"step": "newton"}, "step: expected momentum or line_search, got 'newton'"),
        (PaperOptions, {"steps": -1}, "steps: expected a whole number not below 0, got -1"),
        (PaperOptions, {"tolerance": 1.0}, "tolerance: expected a number from 1e-15 on and below"),
        (SobolevOptions, {"smoothing": 0.0}, "smoothing: expected a number above 0 and at most 1e"),
        (SobolevOptions, {"power": 5}, "sobolev.power: expected 1 to 4, got 5"),
        (RefineOptions, {"drops": 0}, f"refine.drops: {WHOLE} 10000000, got 0"),
        (RefineOptions, {"rounds": 0}, f"refine.rounds: {WHOLE} 50, got 0"),
        (RefineOptions, {"verdict": -1}, f"refine.verdict: {WHOLE} 10000000, got -1"),
        (RefineOptions, {"within": 1.0}, "refine.within: expected a number in (0, 1), got 1"),
        (PaperWeights, {"coplanar": -1.0}, "coplanar: expected a number not below 0, got -1"),
        (PaperWeights, {"neighbor": float("nan")}, "expected a number not below 0, got nan"),
        (PaperWeights, {"neighbor_radius": 0.0}, "expected a chord length above 0 and at most 2"),
        (PaperWeights, {"hold_margin": 0.0}, "expected a number above 0 and at most 1"),
        (Preferences, {"circles": -1.0}, "circles: expected a number from 0 to 1e+06, got -1"),
        (Preferences, {"margin": float("nan")}, "margin: expected a number from 0 to 1e+06"),
    ],
)
def test_values_out_of_range_are_refused_in_words(
    kind: type, options: dict[str, Any], text: str
) -> None:
    with pytest.raises(InputError, match=re.escape(text)):
        kind(**options)
