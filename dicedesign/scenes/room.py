"""Bodies lying about on a floor, each in a pose drawn by its probability."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import quiet_trimesh, read_body
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.scenes.posing import Y_UP, load_scene, reason


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex polygon.

    Attributes
    ----------
    corners: (m, 2), counter-clockwise.
    outward: (e, 2) outward unit normals of its edges.
    reach: (e,) how far it reaches along them.
    area: of it.
    """

    corners: Floats
    outward: Floats
    reach: Floats
    area: float

    @classmethod
    def under(cls, points: Floats) -> Footprint:
        """The convex hull of points (n, 2) that are not all on one line."""
        hull = ConvexHull(points)
        corners, outward = points[hull.vertices], hull.equations[:, :2]
        # Beyond all corners, not just the edge's own: the shortest edges have any direction.
        return cls(corners, outward, (corners @ outward.T).max(axis=0), float(hull.volume))


def gap(one: Footprint, other: Footprint, shift: Floats) -> float:
    """The widest strip beside an edge of one of two footprints, the other of them shifted by (2,),
    that has them on different sides; 0 or less where they meet.

    Convex polygons that do not meet always have such a strip beside one of their edges.
    """
    beside_one = (other.corners @ one.outward.T).min(axis=0) + one.outward @ shift - one.reach
    beside_other = (one.corners @ other.outward.T).min(axis=0) - other.outward @ shift - other.reach
    return float(max(beside_one.max(), beside_other.max()))


CLEARANCE = 1e-6
"""Least distance between two footprints, over the largest radius: far more than rounding."""

ROUNDS, TRIES = 8, 24
"""Times that so many random places are drawn for each body before all of the floor is looked at."""

MESH = 24
"""Places along each side when all of the floor is looked at."""

FILLED = 0.35
"""Part of a floor of our choice that is covered; up to two thirds can be."""

WIDER = 1.1
"""Each side of the next floor that is tried over that of the last."""


def pack(
    footprints: Sequence[Footprint], floor: tuple[float, float], chance: np.random.Generator
) -> Floats:
    """Shifts (n, 2) of footprints to places on a floor where no two meet; NaN for those that found
    none.

    The largest come first. Each is tried at random places, then at those of a mesh over all of the
    floor in random order.

    floor: its sides along x and y, around the origin.
    """
    sides, shifts = np.array(floor), np.full((len(footprints), 2), np.nan)
    # Discs about the middles of their boxes tell most pairs that do not meet, and those that are
    # far away are not looked at: they are in cells that are no neighbors.
    corners = [footprint.corners for footprint in footprints]
    middles = np.array([(p.min(axis=0) + p.max(axis=0)) / 2.0 for p in corners])
    arms = [p - m for p, m in zip(corners, middles, strict=True)]
    outer = np.sqrt([(arm * arm).sum(-1).max() for arm in arms])
    clearance = CLEARANCE * float(outer.max())
    size = 2.0 * float(outer.max()) + clearance
    cells: dict[tuple[int, int], list[int]] = {}

    def is_free(k: int, shift: Floats, column: int, row: int) -> bool:
        """Whether a footprint that is shifted into a cell meets no other."""
        around = ((column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1))
        others = np.array([n for cell in around for n in cells.get(cell, ())], dtype=np.int64)
        between = shift + middles[k] - (shifts[others] + middles[others])
        squared = (between * between).sum(-1)
        near = squared < (outer[k] + outer[others] + clearance) ** 2
        # The nearest are the likeliest to be met.
        return all(
            gap(footprints[k], footprints[n], shifts[n] - shift) > clearance
            for n in others[near][np.argsort(squared[near])].tolist()
        )

    for k in np.argsort(-outer, kind="stable").tolist():
        room = sides - np.ptp(corners[k], axis=0)
        if (room < 0.0).any():
            continue
        for part in _tries(chance):
            shift = part * room - sides / 2.0 - corners[k].min(axis=0)
            column, row = np.floor((shift + middles[k]) / size).astype(int).tolist()
            if is_free(k, shift, column, row):
                shifts[k] = shift
                cells.setdefault((column, row), []).append(k)
                break
    return shifts


def _tries(chance: np.random.Generator) -> Iterator[Floats]:
    """Places (2,) as parts of the room there is, from 0 to 1, in the order of trying."""
    for _ in range(ROUNDS):
        yield from chance.random((TRIES, 2))
    grid = (np.arange(MESH) + chance.random()) / MESH
    yield from chance.permutation(np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2))


def fit_floor(
    footprints: Sequence[Footprint],
    chance: np.random.Generator,
    proportions: tuple[float, float] = (4.0, 3.0),
) -> tuple[tuple[float, float], Floats]:
    """A floor with room for all footprints, and their shifts on it, as of `pack`.

    proportions: of its sides. It is not the smallest: about a third of it is covered.
    """
    extents = np.array([np.ptp(footprint.corners, axis=0) for footprint in footprints])
    covered = sum(footprint.area for footprint in footprints)
    unit = np.array(proportions) / np.sqrt(proportions[0] * proportions[1])
    scale = max(np.sqrt(covered / FILLED), float((extents / unit).max()))
    while True:
        floor = (_rounded_up(scale * unit[0]), _rounded_up(scale * unit[1]))
        shifts = pack(footprints, floor, chance)
        if not np.isnan(shifts).any():
            return floor, shifts
        scale *= WIDER


def _rounded_up(length: float) -> float:
    """A length in three digits, so that it can be told."""
    place = math.floor(math.log10(length)) - 2
    return float(f"{math.ceil(length / 10.0**place)}e{place}")


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
class PlacedBody:
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
    bodies: tuple[PlacedBody, ...]
    floor: tuple[float, float]

    def plain(self) -> dict[str, Any]:
        """All there is to know, as plain data."""
        bodies = [(body, self.models[body.model]) for body in self.bodies]
        return {
            "floor": self.floor,
            "bodies": [
                {
                    "file": model.name,
                    "pose": body.rest + 1,
                    "probability": float(model.poses.probabilities[body.rest]),
                    "scale": model.scale,
                    "transform": body.transform.tolist(),
                }
                for body, model in bodies
            ],
        }


def scatter_bodies(
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
    models: list[Model] = []
    for name in (names[k] for k in order.permutation(len(names)).tolist()):
        if len(models) == count:
            break
        path, said = folder / name, ""
        try:
            mesh = read_body(path)
            if mesh.triangles is None:
                raise InputError(f"{path}: expected triangles, got points alone; leave it out")
            model = Model(name, path, mesh, rest_poses(mesh))
        except Exception as error:
            # A room is not given up for one file, even where the fault is ours.
            said = reason(error, path)
        else:
            models.append(model if size is None else replace(model, scale=size / model.size))
        on_mesh(said)
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
    lying, footprints = [], []
    for k in range(count):
        model = models[k % len(models)]
        transforms, rests = model.poses.sample(1, draws)
        transform = np.diag([model.scale] * 3 + [1.0]) @ transforms[0]
        body = PlacedBody(k % len(models), int(rests[0]), transform)
        lying.append(body)
        footprints.append(Footprint.under(body.placed(model.poses.hull.vertices)[:, :2]))
    if floor is None:
        floor, shifts = fit_floor(footprints, places)
    else:
        shifts = pack(footprints, floor, places)
        missing = int(np.isnan(shifts[:, 0]).sum())
        if missing:
            enough, _ = fit_floor(footprints, places, floor)
            raise InputError(
                f"--floor: expected room for {count} bodies, but only {count - missing} found a "
                f"place on {floor[0]:g} by {floor[1]:g}; take --floor {enough[0]:g},{enough[1]:g}, "
                "or fewer"
            )
    for body, shift in zip(lying, shifts, strict=True):
        body.transform[:2, 3] += shift
    return Room(tuple(models), tuple(lying), floor)


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
