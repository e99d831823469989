"""Scatter bodies on a floor, each in a pose drawn by its probability."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial import ConvexHull

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import quiet_trimesh, read_body
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.scenes.posing import Y_UP, error_line, load_scene


@dataclass(frozen=True, eq=False)
class Footprint:
    """Convex polygon.

    Attributes
    ----------
    corners: (m, 2), counterclockwise.
    normals: (e, 2) outward unit normals of the edges.
    offsets: (e,) support function of the polygon at the normals.
    area: area of the polygon.
    """

    corners: Floats
    normals: Floats
    offsets: Floats
    area: float

    @classmethod
    def under(cls, points: Floats) -> Footprint:
        """Return the convex hull of points (n, 2), which must not lie on one line."""
        hull = ConvexHull(points)
        corners, normals = points[hull.vertices], hull.equations[:, :2]
        # The maximum is over all corners: rounding gives very short edges any direction.
        return cls(corners, normals, (corners @ normals.T).max(axis=0), float(hull.volume))


def gap(first: Footprint, second: Footprint, shift: Floats) -> float:
    """Width of the widest separating strip along an edge; 0 or less if the polygons intersect.

    shift: (2,) translation of the second polygon. Disjoint convex polygons always have a separating
    line parallel to one of their edges.
    """
    along_first = (second.corners @ first.normals.T).min(axis=0) + first.normals @ shift
    along_second = (first.corners @ second.normals.T).min(axis=0) - second.normals @ shift
    return float(max((along_first - first.offsets).max(), (along_second - second.offsets).max()))


CLEARANCE = 1e-6
"""Least distance between two footprints over the largest radius, far above rounding errors."""

RANDOM_ROUNDS, PLACES_PER_ROUND = 8, 24
"""Random places tried for each body before the grid."""

GRID_PLACES = 24
"""Grid places along each side of the floor."""

COVERED_PART = 0.35
"""Part of the floor that is covered, if its size is free; `pack` can cover up to two thirds."""

FLOOR_GROWTH = 1.1
"""Factor on the sides of the floor after a failed attempt."""


def pack(
    footprints: Sequence[Footprint], floor: tuple[float, float], chance: np.random.Generator
) -> Floats:
    """Shifts (n, 2) that place footprints on a floor without intersections; NaN if none fits.

    The largest footprints come first. Each is tried at random places, then at all places of a grid
    in random order.

    floor: sides along x and y; the center is the origin.
    """
    sides, shifts = np.array(floor), np.full((len(footprints), 2), np.nan)
    # Discs around the footprints separate most pairs, and the cells of a grid limit the pairs.
    corners = [footprint.corners for footprint in footprints]
    centers = np.array([(p.min(axis=0) + p.max(axis=0)) / 2.0 for p in corners])
    arms = [p - center for p, center in zip(corners, centers, strict=True)]
    radii = np.sqrt([(arm * arm).sum(-1).max() for arm in arms])
    clearance = CLEARANCE * float(radii.max())
    cell_size = 2.0 * float(radii.max()) + clearance
    cells: dict[tuple[int, int], list[int]] = {}

    def is_free(k: int, shift: Floats, column: int, row: int) -> bool:
        """Whether a footprint, shifted into a cell, meets no other."""
        neighbors = ((column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1))
        others = np.array([n for cell in neighbors for n in cells.get(cell, ())], dtype=np.int64)
        between = shift + centers[k] - (shifts[others] + centers[others])
        squared = (between * between).sum(-1)
        near = squared < (radii[k] + radii[others] + clearance) ** 2
        # The nearest are the most likely to intersect.
        return all(
            gap(footprints[k], footprints[n], shifts[n] - shift) > clearance
            for n in others[near][np.argsort(squared[near])].tolist()
        )

    for k in np.argsort(-radii, kind="stable").tolist():
        room = sides - np.ptp(corners[k], axis=0)
        if (room < 0.0).any():
            continue
        for place in _places_to_try(chance):
            shift = place * room - sides / 2.0 - corners[k].min(axis=0)
            column, row = np.floor((shift + centers[k]) / cell_size).astype(int).tolist()
            if is_free(k, shift, column, row):
                shifts[k] = shift
                cells.setdefault((column, row), []).append(k)
                break
    return shifts


def _places_to_try(chance: np.random.Generator) -> Iterator[Floats]:
    """Yield places (2,) in the unit square."""
    for _ in range(RANDOM_ROUNDS):
        yield from chance.random((PLACES_PER_ROUND, 2))
    grid = (np.arange(GRID_PLACES) + chance.random()) / GRID_PLACES
    yield from chance.permutation(np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2))


def fit_floor(
    footprints: Sequence[Footprint],
    chance: np.random.Generator,
    proportions: tuple[float, float] = (4.0, 3.0),
) -> tuple[tuple[float, float], Floats]:
    """Floor with room for all footprints, and their shifts (n, 2) on it.

    proportions: ratio of the sides. About a third of the floor is covered.
    """
    extents = np.array([np.ptp(footprint.corners, axis=0) for footprint in footprints])
    covered = sum(footprint.area for footprint in footprints)
    unit = np.array(proportions) / np.sqrt(proportions[0] * proportions[1])
    scale = max(np.sqrt(covered / COVERED_PART), float((extents / unit).max()))
    while True:
        floor = (_round_up(scale * unit[0]), _round_up(scale * unit[1]))
        shifts = pack(footprints, floor, chance)
        if not np.isnan(shifts).any():
            return floor, shifts
        scale *= FLOOR_GROWTH


def _round_up(length: float) -> float:
    """Round up to three digits, for messages."""
    place = math.floor(math.log10(length)) - 2
    return float(f"{math.ceil(length / 10.0**place)}e{place}")


MAX_SIZE_RATIO = 100.0
"""Limit of the ratio between the sizes of two meshes that are not scaled."""


@dataclass(frozen=True, eq=False)
class Model:
    """Mesh of which a room has one or more copies.

    Attributes
    ----------
    name: path within the folder; path: full path.
    body, poses: the mesh and its rests, in the unit of the file.
    scale: from the unit of the file to the unit of the room.
    """

    name: str
    path: Path
    body: Body
    poses: RestPoses
    scale: float = 1.0

    @property
    def size(self) -> float:
        """Longest side of the bounding box, in the unit of the file."""
        return float(np.ptp(self.poses.hull.vertices, axis=0).max())


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """Body on the floor.

    Attributes
    ----------
    model: index of its mesh in the room; rest: rest that it stands on, counted from 0.
    transform: (4, 4) similarity from the mesh file to the room.
    """

    model: int
    rest: int
    transform: Floats

    def to_room(self, points: Floats) -> Floats:
        """Transform points (n, 3) of the mesh file into the room."""
        return np.asarray(points @ self.transform[:3, :3].T + self.transform[:3, 3])


FLOOR_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


@dataclass(frozen=True, eq=False)
class Room:
    """Floor at z = 0, centered at the origin, with bodies whose footprints do not intersect.

    Attributes
    ----------
    models: meshes of the bodies.
    bodies: bodies in the order of sampling.
    floor: sides along x and y.
    """

    models: tuple[Model, ...]
    bodies: tuple[PlacedBody, ...]
    floor: tuple[float, float]

    @property
    def floor_corners(self) -> Floats:
        """(4, 3) corners of the floor; `FLOOR_TRIANGLES` refers to them."""
        signs = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        return signs * [*self.floor, 0.0] / 2.0

    def plain(self) -> dict[str, Any]:
        """Plain data for JSON."""
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
    """Scatter bodies from a folder on a floor.

    The meshes take turns in random order. A mesh that cannot be read is skipped.

    Parameters
    ----------
    folder, names: folder, and mesh files by their paths within it, at least one.
    count: number of bodies, above 0; seed: random seed, at least 0.
    floor: sides along x and y, above 0; None makes room for all bodies.
    size: longest side of the bounding box of each mesh after scaling; None does not scale.
    on_mesh: called for each mesh with its error message, or with "" after success.

    Raises
    ------
    InputError: no mesh can be read, sizes differ by more than `MAX_SIZE_RATIO` times, or the floor
        has no room for all bodies.
    """
    order, draws, places = (np.random.default_rng([seed, k]) for k in range(3))
    models: list[Model] = []
    for name in (names[k] for k in order.permutation(len(names)).tolist()):
        if len(models) == count:
            break
        path, message = folder / name, ""
        try:
            mesh = read_body(path)
            if mesh.triangles is None:
                raise InputError(f"{path}: expected triangles, got points alone; leave it out")
            model = Model(name, path, mesh, rest_poses(mesh))
        except Exception as error:
            # One file does not end the run, even if the bug is ours.
            message = error_line(error, path)
        else:
            models.append(model if size is None else replace(model, scale=size / model.size))
        on_mesh(message)
    if not models:
        raise InputError(
            f"{folder}: expected a mesh that can be read, got {len(names)} that cannot; see the "
            "notes above"
        )
    small, large = (pick(models, key=lambda model: model.size) for pick in (min, max))
    if size is None and large.size > MAX_SIZE_RATIO * small.size:
        raise InputError(
            f"{folder}: expected meshes whose sizes differ at most {MAX_SIZE_RATIO:g} times, got "
            f"{small.size:.3g} of {small.name} and {large.size:.3g} of {large.name}; scale all to "
            "one size with --size"
        )
    bodies, footprints = [], []
    for k in range(count):
        model = models[k % len(models)]
        transforms, rests = model.poses.sample(1, draws)
        transform = np.diag([model.scale] * 3 + [1.0]) @ transforms[0]
        body = PlacedBody(k % len(models), int(rests[0]), transform)
        bodies.append(body)
        footprints.append(Footprint.under(body.to_room(model.poses.hull.vertices)[:, :2]))
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
    for body, shift in zip(bodies, shifts, strict=True):
        body.transform[:2, 3] += shift
    return Room(tuple(models), tuple(bodies), floor)


def room_glb(room: Room) -> bytes:
    """Content of a GLB file; it depends on the room alone.

    The node "room" turns z upward into y upward. Its children are the nodes "floor" and "body 0",
    "body 1", ..., whose matrices are the transforms of the bodies. Meshes keep their materials.
    """
    with quiet_trimesh():
        import trimesh

        scene = trimesh.Scene()
        scene.graph.update(frame_to="room", matrix=Y_UP)
        floor = trimesh.Trimesh(room.floor_corners, FLOOR_TRIANGLES, process=False)
        scene.geometry["floor"] = floor
        scene.graph.update(frame_to="floor", frame_from="room", matrix=np.eye(4), geometry="floor")
        # The file holds the geometry of each model once.
        parts = []
        for model in room.models:
            source: Any = load_scene(model.path, model.body)
            for name, geometry in source.geometry.items():
                scene.geometry[f"{model.name}: {name}"] = geometry
            nodes = [source.graph[node] for node in source.graph.nodes_geometry]
            parts.append([(f"{model.name}: {name}", matrix) for matrix, name in nodes])
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
        return cast("bytes", scene.export(file_type="glb"))
