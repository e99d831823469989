"""Trial without a design, in a module that workers can import."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

CUBE = [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]


def made_up_trial(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Random outcome of a trial, determined by its recipe."""
    rng = np.random.default_rng(zlib.crc32(json.dumps(entries).encode()))
    solved, measures = rng.random() < 0.5, rng.random(3)
    return {
        "status": "converged" if solved else "no_progress",
        "max_abs_error": 1e-15 if solved else float(measures[0]),
        "inradius_mm": float(measures[1]),
        "margin_deg": float(measures[2]),
        "asymmetry": 0.0,
        "message": "made up",
        "vertices": CUBE,
        "down": [0.0, 0.0, -1.0],
        "seconds": 0.0,
    }
