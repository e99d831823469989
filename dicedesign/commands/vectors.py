"""Vectors as command-line options."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError

__all__ = ["vector"]


def vector(option: str, text: str) -> NDArray[np.float64]:
    """The three finite numbers of "x,y,z" (3,). Raises InputError naming the option."""
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise InputError(f"{option}: expected three numbers x,y,z, got {text!r}")
    return values
