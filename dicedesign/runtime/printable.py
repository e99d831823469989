"""Names of files and other texts from outside as everybody can read them."""

from __future__ import annotations

__all__ = ["printable"]


def printable(text: object) -> str:
    """A text, or the text of a path, in one line of UTF-8: whatever cannot be printed, such as a
    line feed or a byte of a file's name that is not UTF-8, as an escape of Python's."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in str(text))
