"""Simulators of throws, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol

from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension

if TYPE_CHECKING:
    from dicedesign.runtime.arrays import Floats, Integers
    from dicedesign.throws.rigid_body import RigidBody
    from dicedesign.throws.tables import Table

__all__ = ["ENGINES", "Engine", "ThrowStates", "require_engine"]


class ThrowStates(Protocol):
    """Throws of one body."""

    def __call__(
        self, body: RigidBody, table: Table, states: Floats, refinement: float = 1.0
    ) -> Integers:
        """The rests (n,) of bodies let go in states (n, 13), positions in m, quaternions w, x, y,
        z, velocities in m/s and spins in rad/s about the principal axes; -1 for those that found
        none in time. refinement: divides the time step."""


@dataclass(frozen=True, kw_only=True)
class Engine(Extension):
    """A simulator.

    Attributes
    ----------
    title: what tables call it.
    phrase: what sentences call it, if not so.
    require: raises InputError where it is not installed.
    throw_states: throws a body; may raise the same.
    """

    title: str
    phrase: str | None = None
    require: Callable[[], Any]
    throw_states: ThrowStates


ENGINES: Final = FolderRegistry[Engine]("engine", "dicedesign.throws.engines", Engine)


def require_engine(name: str) -> Engine:
    """The engine of a name. Raises InputError where there is no such engine, or it is not
    installed."""
    engine = ENGINES[name]
    engine.require()
    return engine
