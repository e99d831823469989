"""The engines that can simulate throws, by name."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Final, Literal, get_args

from dicedesign.errors import InputError

__all__ = ["ENGINES", "Engine", "require_engine"]

Engine = Literal["native", "mujoco", "bullet"]

ENGINES: Final[tuple[Engine, ...]] = get_args(Engine)

_MODULES: Final[dict[str, str]] = {
    "native": "dicedesign.throws.engines.native",
    "mujoco": "dicedesign.throws.engines.mujoco_engine",
    "bullet": "dicedesign.throws.engines.bullet_engine",
}


def engine_module(engine: str) -> ModuleType:
    """The module of an engine. Raises InputError where there is no such engine."""
    if engine not in _MODULES:
        raise InputError(f"engine: expected {', '.join(ENGINES)}, got {engine!r}; take one of them")
    return import_module(_MODULES[engine])


def require_engine(engine: str) -> ModuleType:
    """The module of an engine. Raises InputError where there is no such engine, or it is not
    installed."""
    module = engine_module(engine)
    module.require()
    return module
