"""Design solid objects by the odds with which they come to rest."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.gradient.differentiable_rest import differentiable_rest
    from dicedesign.rest.poses import RestPoses, rest_poses
    from dicedesign.rest.roll import RollStep, roll
    from dicedesign.throws.momentum.momentum_odds import thrown_odds
    from dicedesign.throws.rigid_body import RigidBody, rigid_body
    from dicedesign.throws.simulation.simulation import Throws, simulate
    from dicedesign.throws.tables import Table, table_named

__all__ = [
    "Body",
    "RestPoses",
    "RigidBody",
    "RollStep",
    "Table",
    "Throws",
    "differentiable_rest",
    "read_body",
    "rest_poses",
    "rigid_body",
    "roll",
    "simulate",
    "table_named",
    "thrown_odds",
]

__version__ = "0.1.0"

_HOME = {
    "Body": "dicedesign.geometry.meshes.body",
    "RestPoses": "dicedesign.rest.poses",
    "RigidBody": "dicedesign.throws.rigid_body",
    "RollStep": "dicedesign.rest.roll",
    "Table": "dicedesign.throws.tables",
    "Throws": "dicedesign.throws.simulation.simulation",
    "differentiable_rest": "dicedesign.gradient.differentiable_rest",
    "read_body": "dicedesign.geometry.meshes.reading",
    "rest_poses": "dicedesign.rest.poses",
    "rigid_body": "dicedesign.throws.rigid_body",
    "roll": "dicedesign.rest.roll",
    "simulate": "dicedesign.throws.simulation.simulation",
    "table_named": "dicedesign.throws.tables",
    "thrown_odds": "dicedesign.throws.momentum.momentum_odds",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that a query of a mesh never loads torch."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
