"""Bodies lying about on a floor, each in a pose drawn by its probability."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import quiet_trimesh, read_body
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.scenes.packing import Footprint, fitting_floor, pack
from dicedesign.scenes.posing import Y_UP, load_scene, reason

LARGEST_RATIO = 100.0
"""Between the sizes of two meshes that may stand in one room as they are."""


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh file of which a room has one or more.

    Attributes
    ----------
    name: within its folder; path: of the file.
    body: what it holds; poses: how that comes to rest, in the file's unit.
    scale: from the file's unit to that of the room.
    """

    name: str
    path: Path
    body: Body
    poses: RestPoses
    scale: float = 1.0

    @property
    def size(self) -> float:
        """The longest side of the box around it, in the file's unit."""
        return float(np.ptp(self.poses.hull.vertices, axis=0).max())


@dataclass(frozen=True, eq=False)
class Lying:
    """A body on the floor.

    Attributes
    ----------
    model: its number in the room; rest: in which it lies, counted from 0.
    transform: (4, 4) from the mesh file to the room: a turn, a scale and a shift.
    """

    model: int
    rest: int
    transform: Floats

    def placed(self, points: Floats) -> Floats:
        """Points (n, 3) of the mesh file in the room."""
        return np.asarray(points @ self.transform[:3, :3].T + self.transform[:3, 3])


@dataclass(frozen=True, eq=False)
class Room:
    """A floor, z = 0 around the origin, with bodies on it whose footprints do not meet.

    Attributes
    ----------
    models: the meshes that there are.
    bodies: on the floor, in the order in which they were drawn.
    floor: its sides along x and y.
    """

    models: tuple[Model, ...]
    bodies: tuple[Lying, ...]
    floor: tuple[float, float]

    def plain(self) -> dict[str, Any]:
        """All there is to know, as plain data."""
        return {
            "floor": self.floor,
            "bodies": [
                {
                    "file": self.models[body.model].name,
                    "pose": body.rest + 1,
                    "probability": float(self.models[body.model].poses.probabilities[body.rest]),
                    "scale": self.models[body.model].scale,
                    "transform": body.transform.tolist(),
                }
                for body in self.bodies
            ],
        }


def scattered(
    folder: Path,
    names: Sequence[str],
    count: int,
    seed: int,
    *,
    floor: tuple[float, float] | None = None,
    size: float | None = None,
    on_mesh: Callable[[str], None] = lambda error: None,
) -> Room:
    """Bodies from a folder on a floor.

    The meshes take turns in an order drawn by lot, so that none comes twice before all came once.
    One that cannot be read is left out.

    Parameters
    ----------
    folder, names: the mesh files by their paths within the folder, at least one.
    count: of bodies, above 0; seed: of all chance, at least 0.
    floor: its sides along x and y, above 0, or None for one with room for all.
    size: to which the longest side of the box around each mesh is scaled; None leaves the meshes
        as they are.
    on_mesh: called after each mesh is read, with what is wrong with it, or "".

    Raises
    ------
    InputError: no mesh can be read; sizes differ more than `LARGEST_RATIO` times; not all bodies
        find a place on the floor.
    """
    order, draws, places = (np.random.default_rng([seed, k]) for k in range(3))
    shuffled = [names[k] for k in order.permutation(len(names)).tolist()]
    models = tuple(_models(folder, shuffled, count, size, on_mesh))
    if not models:
        raise InputError(
            f"{folder}: expected a mesh that can be read, got {len(names)} that cannot; see the "
            "notes above"
        )
    small, large = (find(models, key=lambda model: model.size) for find in (min, max))
    if size is None and large.size > LARGEST_RATIO * small.size:
        raise InputError(
            f"{folder}: expected meshes whose sizes differ at most {LARGEST_RATIO:g} times, got "
            f"{small.size:.3g} of {small.name} and {large.size:.3g} of {large.name}; scale all to "
            "one size with --size"
        )
    lying = []
    for k in range(count):
        number = k % len(models)
        model = models[number]
        transforms, rests = model.poses.sample(1, draws)
        transform = np.diag([model.scale] * 3 + [1.0]) @ transforms[0]
        lying.append(Lying(number, int(rests[0]), transform))
    footprints = [
        Footprint.under(body.placed(models[body.model].poses.hull.vertices)[:, :2])
        for body in lying
    ]
    if floor is None:
        floor, shifts = fitting_floor(footprints, places)
    else:
        shifts = pack(footprints, floor, places)
        missing = int(np.isnan(shifts[:, 0]).sum())
        if missing:
            enough, _ = fitting_floor(footprints, places, floor)
            raise InputError(
                f"--floor: expected room for {count} bodies, but only {count - missing} found a "
                f"place on {floor[0]:g} by {floor[1]:g}; take --floor {enough[0]:g},{enough[1]:g}, "
                "or fewer"
            )
    for body, shift in zip(lying, shifts, strict=True):
        body.transform[:2, 3] += shift
    return Room(models, tuple(lying), floor)


def _models(
    folder: Path,
    names: Sequence[str],
    count: int,
    size: float | None,
    on_mesh: Callable[[str], None],
) -> Iterator[Model]:
    """The first meshes that can be read, at most so many."""
    for name in names:
        if count == 0:
            return
        path, said = folder / name, ""
        try:
            body = read_body(path)
            if body.triangles is None:
                raise InputError(f"{path}: expected triangles, got points alone; leave it out")
            model = Model(name, path, body, rest_poses(body))
        except Exception as error:
            # A room is not given up for one file, even where the fault is ours.
            said = reason(error, path)
        else:
            count -= 1
            yield model if size is None else replace(model, scale=size / model.size)
        on_mesh(said)


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
        # The meshes of each model once, their names and places in the model.
        parts = []
        for model in room.models:
            own: Any = load_scene(model.path, model.body)
            for name, geometry in own.geometry.items():
                scene.geometry[f"{model.name}: {name}"] = geometry
            placed = [own.graph[node] for node in own.graph.nodes_geometry]
            parts.append([(f"{model.name}: {name}", matrix) for matrix, name in placed])
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
