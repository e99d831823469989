"""Texts as cells of CSV files that no spreadsheet takes for formulas."""

from __future__ import annotations

import re
from typing import Any

FORMULA = re.compile(r"'*[=+\-@\t\r\n]")
"""Start of a cell that a spreadsheet runs, or of one that `guard_cell` has changed."""

NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
"""A number, which is no formula."""


def guard_cell(value: Any) -> Any:
    """Put an apostrophe before a text that a spreadsheet would run; numbers, also as texts such as
    "-1", and all other values stay as they are."""
    if isinstance(value, str) and FORMULA.match(value) and not NUMBER.fullmatch(value):
        return f"'{value}"
    return value


def plain_cell(cell: str) -> str:
    """Text before `guard_cell`."""
    return cell[1:] if cell.startswith("'") and FORMULA.match(cell) else cell
