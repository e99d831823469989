"""Mesh files stood in poses."""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.fabricate.file_formats import (
    BODY_COLOR,
    FILE_FORMATS,
    Contents,
    Part,
    file_bytes,
    rows,
)
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import OWN_ENDINGS, quiet_trimesh, read_body, without_solids
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.workers import run_in_batches

if TYPE_CHECKING:
    import trimesh


POINTS = ".xyz"
"""Ending of files of points."""

Y_UP = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""The turn (4, 4) that makes y upward where z was."""


def check_ending(ending: str, name: str) -> None:
    """Raise InputError for an ending, such as ".stl", of files that cannot be written.

    name: what the message begins with.
    """
    if ending.lower() != POINTS and ending[1:].lower() not in FILE_FORMATS:
        known = ", ".join([*(f".{known}" for known in FILE_FORMATS.names), POINTS])
        raise InputError(
            f"{name}: expected a format that can be written, {known}, got {ending!r}; choose one "
            "of them"
        )


def pose_bytes(path: Path, body: Body, transform: Floats, ending: str) -> bytes:
    """The content of a file of a format: a mesh file's body, moved, in its own unit of length.

    Colors, materials, textures and the names of parts are kept where a GLB file is written, and
    the colors of a PLY file in another; all else holds the shape alone.

    Parameters
    ----------
    path: the mesh file; body: what was read from it.
    transform: (4, 4) rigid motion.
    ending: of the file to be written, such as ".stl".

    Raises
    ------
    InputError: as `check_ending`; the body has no triangles for a format that needs some; or
        coordinates that the format cannot hold.
    """
    check_ending(ending, str(path))
    kind = ending[1:].lower()
    points = body.points @ transform[:3, :3].T + transform[:3, 3]
    if ending.lower() == POINTS:
        return rows("{!r} {!r} {!r}\n", points).encode()
    if body.triangles is None:
        raise InputError(
            f"{path}: expected triangles for a file ending in {ending}, got points alone; write "
            f"one ending in {POINTS}"
        )
    if kind == "glb":
        scene = load_scene(path, body)
        scene.apply_transform(transform)
        data: bytes = scene.export(file_type="glb")
        return data
    if kind == "ply" and path.suffix.lower() == ".ply":
        mesh: Any = load_scene(path, body).to_geometry()
        if mesh.visual.kind in ("vertex", "face"):
            data = mesh.apply_transform(transform).export(file_type="ply")
            return data
    part = Part(path.stem, BODY_COLOR, points, body.triangles)
    contents = Contents(path.stem, [part], unit="the unit of the mesh that was posed")
    return file_bytes(contents, FILE_FORMATS[kind], str(path))


def load_scene(path: Path, body: Body) -> trimesh.Scene:
    """The scene of a mesh file that `read_body` has read: with its materials where trimesh reads
    files of its kind, or it is an OBJ file that names some, and else its body's shape alone."""
    with quiet_trimesh():
        import trimesh

        ending = path.suffix.lower()
        if ending not in OWN_ENDINGS or (ending == ".obj" and b"mtllib" in path.read_bytes()):
            with contextlib.suppress(Exception):  # its readers raise whatever they run into
                loaded: Any = trimesh.load(str(path), force="scene", process=False)
                for name, geometry in list(loaded.geometry.items()):
                    if not isinstance(geometry, trimesh.Trimesh):
                        loaded.delete_geometry(name)
                if loaded.geometry:
                    return cast("trimesh.Scene", loaded)
        scene = trimesh.Scene()
        scene.add_geometry(trimesh.Trimesh(body.points, body.triangles, process=False), path.stem)
        return scene


@dataclass(frozen=True)
class PoseChoice:
    """Which pose of a body, and how its rests are found.

    Attributes
    ----------
    number: of the rest, the most probable being 1.
    seed: to draw a rest by its probabilities instead, and a heading; None draws nothing.
    center_of_mass, coplanar_tolerance: as in `rest_poses`.
    y_up: whether bodies stand on y = 0 instead of z = 0.
    """

    number: int = 1
    seed: int | None = None
    center_of_mass: tuple[float, float, float] | Literal["hull"] | None = None
    coplanar_tolerance: float | None = None
    y_up: bool = False

    def of(self, poses: RestPoses, name: str) -> tuple[int, Floats]:
        """A rest, counted from 0, and its transform (4, 4).

        name: of the body. One seed draws for each name on its own, so that it does not matter
        which other bodies there are. Raises InputError: there is no rest of that number.
        """
        rests = len(poses.probabilities)
        if self.seed is not None:
            own = [self.seed, zlib.crc32(name.encode("utf-8", "surrogateescape"))]
            transforms, drawn = poses.sample(1, np.random.default_rng(own))
            rest, transform = int(drawn[0]), transforms[0]
        elif self.number <= rests:
            rest, transform = self.number - 1, poses.transforms[self.number - 1]
        else:
            raise InputError(
                f"{name}: expected a body of at least {self.number} poses, got one of {rests}; "
                f"choose a --pose from 1 to {rests}"
            )
        return rest, Y_UP @ transform if self.y_up else transform


@dataclass(frozen=True)
class PoseJob:
    """A file to be read, its name among the others, and the file to be written."""

    source: Path
    name: str
    target: Path


@dataclass(frozen=True)
class PoseResult:
    """What became of a job.

    Attributes
    ----------
    job: what was to be done.
    rest: in which it stands, counted from 0; rests: how many there are.
    probability: of that rest.
    transform: (4, 4) from the mesh to the file, as lists.
    notes: about the body, one sentence each.
    error: why nothing was written, in one line, or empty.
    """

    job: PoseJob
    rest: int = -1
    rests: int = 0
    probability: float = 0.0
    transform: tuple[tuple[float, ...], ...] = ()
    notes: tuple[str, ...] = ()
    error: str = ""


def write_pose(job: PoseJob, choice: PoseChoice) -> PoseResult:
    """Write a mesh file's body in a pose. Raises as `read_body`, `rest_poses`, `PoseChoice.of`,
    `pose_bytes` and `atomic_write`."""
    with without_solids():
        body = read_body(job.source)
        poses = rest_poses(
            body, choice.center_of_mass, coplanar_tolerance=choice.coplanar_tolerance
        )
        rest, transform = choice.of(poses, job.name)
        data = pose_bytes(job.source, body, transform, job.target.suffix)
    atomic_write(job.target, data)
    return PoseResult(
        job,
        rest,
        len(poses.probabilities),
        float(poses.probabilities[rest]),
        tuple(map(tuple, transform.tolist())),
        poses.notes,
    )


def write_each(jobs: Sequence[PoseJob], choice: PoseChoice) -> list[PoseResult]:
    """A worker's task: each file on its own; one that cannot be done says why."""
    stood = []
    for job in jobs:
        try:
            stood.append(write_pose(job, choice))
        except Exception as error:
            # Thousands of files are not given up for one, even where the fault is ours.
            stood.append(PoseResult(job, error=reason(error, job.source)))
    return stood


def reason(error: Exception, path: Path) -> str:
    """Why a file could not be used, in one line."""
    text = str(error) if isinstance(error, DiceError) else f"{path}: {error!r}"
    return " ".join(text.split())


def write_poses(
    jobs: Sequence[PoseJob],
    choice: PoseChoice,
    executor: Executor,
    workers: int,
    *,
    on_done: Callable[[int], None],
    on_quiet: Callable[[], None] | None = None,
) -> list[PoseResult]:
    """What became of many jobs, in their order.

    Parameters
    ----------
    jobs: with different targets.
    executor: runs them, so many `workers` at a time.
    on_done: told how many ended; on_quiet: called whenever none has for some seconds.

    Raises DiceError: the executor cannot go on.
    """
    done: dict[Path, PoseResult] = {}

    def on_stood(stood: list[PoseResult]) -> None:
        done.update((one.job.target, one) for one in stood)
        on_done(len(stood))

    lost = run_in_batches(
        jobs, lambda task: executor.submit(write_each, task, choice), workers, on_stood, on_quiet
    )
    for job in lost:
        text = "expected workers that stay, but those that posed it were lost; see whether memory"
        done[job.target] = PoseResult(job, error=f"{job.source}: {text} suffices")
    return [done[job.target] for job in jobs]
