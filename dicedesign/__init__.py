"""Design solid objects by the probabilities with which they come to rest.

`__init__.pyi` lists the public names. Each is imported on first use, so that a query of a mesh
never loads torch. Names for special uses are in `energies`, `methods`, `starts`,
`figures` and `extensions`.
"""

from typing import Any

import lazy_loader

_load, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("dicedesign")
    return _load(name)


def __dir__() -> list[str]:
    return __all__
