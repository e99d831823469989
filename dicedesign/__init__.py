"""Design solid objects by the odds with which they come to rest."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dicedesign.design.rest_function import differentiable_rest
    from dicedesign.geometry.body import Body
    from dicedesign.geometry.mesh_file import read_body
    from dicedesign.rest.poses import RestPoses, rest_poses
    from dicedesign.rest.roll import RollStep, roll

__all__ = [
    "Body",
    "RestPoses",
    "RollStep",
    "differentiable_rest",
    "read_body",
    "rest_poses",
    "roll",
]

__version__ = "0.1.0"

_HOME = {
    "Body": "dicedesign.geometry.body",
    "RestPoses": "dicedesign.rest.poses",
    "RollStep": "dicedesign.rest.roll",
    "differentiable_rest": "dicedesign.design.rest_function",
    "read_body": "dicedesign.geometry.mesh_file",
    "rest_poses": "dicedesign.rest.poses",
    "roll": "dicedesign.rest.roll",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that a query of a mesh never loads torch."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
