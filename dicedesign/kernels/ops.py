"""The compiled kernels, where they were built.

They are the inner loops of hull, rest model and gradients in C++, built when the package is
installed. A kernel answers only what rounding cannot change and returns None otherwise; the NumPy
code that called it then decides, in exact arithmetic where it has to. So the kernels change speed
only, and a machine without a C++ compiler does without them, but for the package's own simulator of
throws.
"""

from __future__ import annotations

from types import ModuleType
from typing import Final

__all__ = ["compiled"]

INTERFACE: Final = 3
"""Counts changes of what the kernels take and return; those of another number are not used."""

compiled: ModuleType | None
"""The module of kernels, or None where they were not built."""

try:
    import dicedesign_kernels

    compiled = dicedesign_kernels if dicedesign_kernels.INTERFACE == INTERFACE else None
except ModuleNotFoundError:
    compiled = None
