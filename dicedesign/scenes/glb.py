"""A room as GLB: one mesh for each file, one node for each body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.geometry.meshes.reading import quiet_trimesh
from dicedesign.runtime.arrays import Floats
from dicedesign.scenes.posed_file import Y_UP, load_scene

if TYPE_CHECKING:
    from dicedesign.scenes.room import Model, Room

__all__ = ["room_glb"]


def room_glb(room: Room) -> bytes:
    """The content of a GLB file, the same for the same room.

    The node "room" turns z upward into the y of the format; below it are the nodes "floor" and
    "body 0", "body 1", ..., whose matrices are the bodies' transforms. Meshes keep their materials.
    """
    with quiet_trimesh():
        import trimesh

        scene = trimesh.Scene()
        scene.graph.update(frame_to="room", matrix=Y_UP)
        wide, deep = (side / 2.0 for side in room.floor)
        corners = [[-wide, -deep, 0.0], [wide, -deep, 0.0], [wide, deep, 0.0], [-wide, deep, 0.0]]
        plane = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
        scene.geometry["floor"] = plane
        scene.graph.update(frame_to="floor", frame_from="room", matrix=np.eye(4), geometry="floor")
        parts = [_parts(scene, model) for model in room.models]
        for k, body in enumerate(room.bodies):
            node = f"body {k}"
            scene.graph.update(frame_to=node, frame_from="room", matrix=body.transform)
            for number, (geometry, matrix) in enumerate(parts[body.model]):
                scene.graph.update(
                    frame_to=f"{node} part {number}",
                    frame_from=node,
                    matrix=matrix,
                    geometry=geometry,
                )
        data: bytes = scene.export(file_type="glb")
        return data


def _parts(scene: Any, model: Model) -> list[tuple[str, Floats]]:
    """Put the meshes of a model into a scene once; their names and places (4, 4) in the model."""
    own: Any = load_scene(model.path, model.body)
    names = {name: f"{model.name}: {name}" for name in own.geometry}
    for name, geometry in own.geometry.items():
        scene.geometry[names[name]] = geometry
    placed = [own.graph[node] for node in own.graph.nodes_geometry]
    return [(names[name], np.asarray(matrix, dtype=np.float64)) for matrix, name in placed]
