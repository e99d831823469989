"""Checks of numbers that people give, with one wording."""

from __future__ import annotations

from dicedesign.errors import InputError

__all__ = ["check_whole"]


def check_whole(name: str, value: int, least: int = 1) -> None:
    """Raise InputError, naming what the number is, where it is below the least that is allowed."""
    if value < least:
        wanted = "above 0" if least == 1 else f"of at least {least}"
        raise InputError(f"{name}: expected a whole number {wanted}, got {value}; raise it")
