"""What is said where an optional dependency is missing."""

from __future__ import annotations

from dicedesign.errors import InputError

__all__ = ["missing_extra"]


def missing_extra(extra: str, wanted: str, error: ImportError) -> InputError:
    """The error about an extra of this package without which something wanted cannot be done."""
    return InputError(
        f"{wanted}: expected the optional extra {extra!r}, but {error}; "
        f"pip install 'dicedesign[{extra}]'"
    )
