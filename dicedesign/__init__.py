"""Design solid objects by the probabilities with which they come to rest.

`__init__.pyi` lists the public names. Each is imported on first use, so that a query of a mesh
never loads torch. Names for special uses are in `energies`, `methods`, `starts` and `extensions`.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_HOME = {
    name.name: statement.module
    for statement in ast.parse(Path(__file__).with_suffix(".pyi").read_text()).body
    if isinstance(statement, ast.ImportFrom)
    for name in statement.names
}

__all__ = [*_HOME, "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("dicedesign")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if _HOME[name] == __name__:
        return import_module(f"{__name__}.{name}")
    return getattr(import_module(str(_HOME[name])), name)


def __dir__() -> list[str]:
    return __all__
