"""Rows of tables: each field says once its heading, its width and how it is written."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from typing import Any, ClassVar, TypeAlias

import numpy as np

__all__ = ["Row", "column", "hidden", "milliseconds", "percent", "plain"]

Form: TypeAlias = str | Callable[[Any], str]
"""A format specification, or what writes a value."""


@dataclasses.dataclass(frozen=True)
class _Column:
    title: str
    width: int
    form: Form
    none: str

    def cell(self, value: Any) -> str:
        """A value as it is written."""
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            return self.none
        return format(value, self.form) if isinstance(self.form, str) else self.form(value)


def column(title: str, width: int, form: Form = "", none: str = "-", **settings: Any) -> Any:
    """A field of a row that is a column of its table.

    title: of the column.
    width: in characters, values to the right; negative for values to the left; 0 for text of any
        length, at the end of the line.
    form: how values are written; none: None, and what is no finite number.
    settings: of `dataclasses.field`.
    """
    return dataclasses.field(metadata={"column": _Column(title, width, form, none)}, **settings)


def hidden(**settings: Any) -> Any:
    """A field of a row that only JSON has; settings: of `dataclasses.field`."""
    return dataclasses.field(**settings)


class Row:
    """A row of a bench: a dataclass whose fields by `column` are printed, and all are in JSON.

    Attributes
    ----------
    table: name of the list of such rows in JSON; None to leave them out.
    printed: whether such rows are in a table.
    computed: properties that JSON has beside the fields.
    """

    table: ClassVar[str | None] = "rows"
    printed: ClassVar[bool] = True
    computed: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def heading(cls) -> str:
        """The titles of the columns."""
        return _line((one, one.title) for _, one in cls._columns())

    def line(self) -> str:
        """The row as a line of the table."""
        return _line((one, one.cell(getattr(self, name))) for name, one in self._columns())

    @classmethod
    def _columns(cls) -> Iterator[tuple[str, _Column]]:
        for field in dataclasses.fields(cls):  # type: ignore[arg-type]
            if "column" in field.metadata:
                yield field.name, field.metadata["column"]


def milliseconds(seconds: float) -> str:
    """Seconds in milliseconds, to four digits."""
    return f"{1e3 * seconds:.4g}"


def percent(digits: int) -> Callable[[float], str]:
    """What writes a share in percent, without the sign."""
    return lambda share: f"{100.0 * share:.{digits}f}"


def plain(value: Any) -> Any:
    """A value as data for JSON: dataclasses become mappings, with what a row computes, arrays and
    tuples lists, statuses their names, and what is no finite number None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        names += getattr(value, "computed", ())
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _line(cells: Iterator[tuple[_Column, str]]) -> str:
    line = ""
    for column, text in cells:
        if column.width == 0:
            line += f"  {text}" if text else ""
        else:
            line += f"{text:{'>' if column.width > 0 else '<'}{abs(column.width)}}"
    return line.rstrip()
