"""What all option classes share."""

from __future__ import annotations

from typing import Final

__all__ = ["STRICT"]

STRICT: Final = {"extra": "forbid", "strict": True}
"""Class attribute `__pydantic_config__` of every option dataclass: when a recipe is read into it,
unknown keys and wrong types are errors. Nothing else in those classes knows of pydantic."""
