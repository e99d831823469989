"""How far odds and angles are from what will do."""

from __future__ import annotations

__all__ = ["shortfall"]


def shortfall(error: float, tolerance: float, *angles: tuple[float, float]) -> float:
    """What is missing over what will do, summed; 0 where nothing is.

    error: largest |p - q|, which may be as large as the tolerance; angles: each with the least that
    will do, in one unit.
    """
    missing = max(error / tolerance - 1.0, 0.0)
    return missing + sum(1.0 - angle / least for angle, least in angles if angle < least)
