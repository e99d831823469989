"""HTML of the page, from the macros of `templates/parts.html.j2`; texts are escaped."""

from __future__ import annotations

from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


@cache
def _macros() -> Any:
    environment = Environment(
        loader=PackageLoader("dicedesign.view"), autoescape=True, undefined=StrictUndefined
    )
    return environment.get_template("parts.html.j2").module


def html_part(name: str, *values: object) -> str:
    """The element that the macro of a name makes of its values."""
    return str(getattr(_macros(), name)(*values))
