"""Write mesh files in stable poses."""

from __future__ import annotations

import contextlib
import io
import warnings
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from dicedesign.errors import DiceError, InputError, MeshFileError
from dicedesign.fabricate.file_formats import (
    FILE_FORMATS,
    Contents,
    Part,
    file_bytes,
    rows,
)
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.gltf import read_beside
from dicedesign.geometry.meshes.reading import MESH_ENDINGS, quiet_trimesh, read_body
from dicedesign.palette import BLANK
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import atomic_write, read_file
from dicedesign.runtime.workers import run_in_batches

if TYPE_CHECKING:
    import trimesh


POINTS_ENDING = ".xyz"

TRIMESH_KINDS = ("glb", "ply", "off")
"""Formats that trimesh writes."""

Y_UP = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Rotation (4, 4) that turns z upward into y upward."""


def check_ending(ending: str, name: str) -> None:
    """Raise InputError for an ending, such as ".stl", whose format cannot be written.

    name: subject of the message.
    """
    endings = [f".{kind}" for kind in dict.fromkeys([*FILE_FORMATS.names, *TRIMESH_KINDS])]
    if ending.lower() not in (*endings, POINTS_ENDING):
        known = ", ".join([*endings, POINTS_ENDING])
        raise InputError(
            f"{name}: expected a format that can be written, {known}, got {ending!r}; choose one "
            "of them"
        )


def pose_bytes(path: Path, body: Body, transform: Floats, ending: str) -> bytes:
    """Content of a mesh file after a rigid motion, in the unit of length of the original.

    A GLB file keeps colors, materials, textures and part names, a PLY file colors. Other formats
    hold the shape alone.

    Parameters
    ----------
    path: mesh file; body: the body read from it.
    transform: (4, 4) rigid motion.
    ending: format to write, such as ".stl".

    Raises
    ------
    InputError: the format cannot be written, needs triangles that the body does not have, or cannot
        hold its coordinates.
    """
    check_ending(ending, str(path))
    kind = ending[1:].lower()
    points = body.points @ transform[:3, :3].T + transform[:3, 3]
    if ending.lower() == POINTS_ENDING:
        return rows("{!r} {!r} {!r}\n", points).encode()
    if body.triangles is None:
        raise InputError(
            f"{path}: expected triangles for a file ending in {ending}, got points alone; write "
            f"one ending in {POINTS_ENDING}"
        )
    if kind in TRIMESH_KINDS:
        scene = load_scene(path, body)
        scene.apply_transform(transform)
        posed: Any = scene if kind == "glb" else scene.to_geometry()
        content = posed.export(file_type=kind)
        return content.encode() if isinstance(content, str) else cast("bytes", content)
    part = Part(points, body.triangles, path.stem, BLANK)
    contents = Contents(path.stem, [part], unit="the unit of the mesh that was posed")
    return file_bytes(contents, FILE_FORMATS[kind], str(path))


SHAPE_ENDINGS = MESH_ENDINGS - {".ply", ".glb", ".gltf"}
"""Endings of formats without colors, or with colors that are not kept but in OBJ files."""

SAME_SHAPE = 1e-4
"""Largest difference of two bounding boxes, over the longest side, that counts as none."""


class _Beside:
    """Files beside a mesh, such as textures, for trimesh."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def get(self, name: str) -> bytes:
        return read_beside(self._path, name)

    __getitem__ = get


def load_scene(path: Path, body: Body) -> trimesh.Scene:
    """Scene of a mesh file that `read_body` has read.

    It has the materials of an OBJ, PLY, GLB or glTF file and of every format that trimesh alone
    reads. Where trimesh reads another shape, or none, it holds the shape alone.
    """
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    with quiet_trimesh():
        import trimesh

        ending = path.suffix.lower()
        data = read_file(path, "a mesh", error=MeshFileError)
        if ending not in SHAPE_ENDINGS or (ending == ".obj" and b"mtllib" in data):
            with contextlib.suppress(Exception):  # trimesh raises errors of any kind
                from PIL import Image

                # A texture beyond Pillow's limit is left out.
                warnings.simplefilter("error", Image.DecompressionBombWarning)
                resolver: Any = _Beside(path)
                loaded_scene: Any = trimesh.load(
                    io.BytesIO(data),
                    ending[1:],
                    resolver=resolver,
                    force="scene",
                    process=False,
                )
                for name, geometry in list(loaded_scene.geometry.items()):
                    if not isinstance(geometry, trimesh.Trimesh):
                        loaded_scene.delete_geometry(name)
                if (
                    np.abs(loaded_scene.bounds - [low, high]).max()
                    <= SAME_SHAPE * (high - low).max()
                ):
                    return cast("trimesh.Scene", loaded_scene)
        scene = trimesh.Scene()
        scene.add_geometry(trimesh.Trimesh(body.points, body.triangles, process=False), path.stem)
        return scene


@dataclass(frozen=True)
class PoseChoice:
    """Choice of a pose, and the options of the analysis that finds it.

    Attributes
    ----------
    number: rank of the rest; 1 is the most probable.
    facet: number of a facet of the hull, which counts before `number`.
    seed: draws the rest by its probability, and the heading at random; None takes `number`.
    center_of_mass, coplanar_tolerance: as in `rest_poses`; item: as in `read_body`.
    y_up: bodies stand on y = 0 instead of z = 0.
    """

    number: int = 1
    facet: int | None = None
    seed: int | None = None
    center_of_mass: tuple[float, float, float] | Literal["hull"] | None = None
    coplanar_tolerance: float | None = None
    item: int | None = None
    y_up: bool = False

    def choose(self, poses: RestPoses, name: str) -> tuple[int, Floats]:
        """Return a facet of the hull and its transform (4, 4).

        name: name of the body. The seed and the name determine the draw, so that it does not depend
        on the other bodies. Raises InputError: no rest or facet has that number.
        """
        rests, facets = len(poses.probabilities), len(poses.hull.normals)
        if self.seed is not None:
            seeds = [self.seed, zlib.crc32(name.encode("utf-8", "surrogateescape"))]
            transforms, sampled_rests = poses.sample(1, np.random.default_rng(seeds))
            facet, transform = poses.facets[sampled_rests[0]], transforms[0]
        elif self.facet is not None:
            if not 0 <= self.facet < facets:
                raise InputError(
                    f"{name}: expected a hull with a facet {self.facet}, got one of {facets}; "
                    f"choose a --facet from 0 to {facets - 1}"
                )
            facet, transform = self.facet, poses.stand_on(np.array([self.facet]))[0]
        elif self.number <= rests:
            facet, transform = poses.facets[self.number - 1], poses.transforms[self.number - 1]
        else:
            raise InputError(
                f"{name}: expected a body of at least {self.number} poses, got one of {rests}; "
                f"choose a --pose from 1 to {rests}"
            )
        return int(facet), Y_UP @ transform if self.y_up else transform


@dataclass(frozen=True)
class PoseJob:
    """Mesh file to read, its name among the others, and the file to write."""

    source: Path
    name: str
    target: Path


@dataclass(frozen=True)
class PoseResult:
    """Result of a `PoseJob`.

    Attributes
    ----------
    job: the job.
    facet: facet of the hull that the body stands on.
    rest: rest that it is, counted from 0, or None if it is unstable; rests: number of rests.
    probability: probability of that rest.
    transform: (4, 4) from the mesh to the written file, as tuples.
    notes: remarks about the body, one sentence each.
    error: why nothing was written, in one line; empty after success.
    """

    job: PoseJob
    facet: int = -1
    rest: int | None = None
    rests: int = 0
    probability: float = 0.0
    transform: tuple[tuple[float, ...], ...] = ()
    notes: tuple[str, ...] = ()
    error: str = ""


def write_pose(job: PoseJob, choice: PoseChoice) -> PoseResult:
    """Write a mesh in a pose.

    Raises as `read_body`, `rest_poses`, `PoseChoice.choose`, `pose_bytes` and `atomic_write`.
    """
    body = read_body(job.source, choice.item)
    poses = rest_poses(body, choice.center_of_mass, coplanar_tolerance=choice.coplanar_tolerance)
    facet, transform = choice.choose(poses, job.name)
    rest = next(iter(np.flatnonzero(poses.facets == facet).tolist()), None)
    data = pose_bytes(job.source, body, transform, job.target.suffix)
    atomic_write(job.target, data)
    return PoseResult(
        job,
        facet,
        rest,
        len(poses.probabilities),
        0.0 if rest is None else float(poses.probabilities[rest]),
        tuple(map(tuple, transform.tolist())),
        poses.notes,
    )


def write_each(jobs: Sequence[PoseJob], choice: PoseChoice) -> list[PoseResult]:
    """Write meshes in a worker process; a failed job records its error."""
    results = []
    for job in jobs:
        try:
            results.append(write_pose(job, choice))
        except Exception as error:
            # One file does not end a run over thousands, even if the bug is ours.
            results.append(PoseResult(job, error=error_line(error, job.source)))
    return results


def error_line(error: Exception, path: Path) -> str:
    """Message of an error on one line; an unexpected error names the file."""
    text = str(error) if isinstance(error, DiceError) else f"{path}: {error!r}"
    return " ".join(text.split())


def write_poses(
    jobs: Sequence[PoseJob],
    choice: PoseChoice,
    executor: Executor,
    workers: int,
    *,
    on_done: Callable[[int], None],
) -> list[PoseResult]:
    """Run many jobs; the results are in the order of the jobs.

    Parameters
    ----------
    jobs: jobs with different targets.
    executor: runs the jobs, at most `workers` batches at a time.
    on_done: called with the number of jobs in each finished batch.

    Raises DiceError: the executor is broken.
    """
    results: dict[Path, PoseResult] = {}

    def on_results(batch: list[PoseResult]) -> None:
        results.update((result.job.target, result) for result in batch)
        on_done(len(batch))

    lost_jobs = run_in_batches(
        jobs, lambda task: executor.submit(write_each, task, choice), workers, on_results
    )
    for job in lost_jobs:
        text = "expected workers that stay, but those that posed it were lost; see whether memory"
        results[job.target] = PoseResult(job, error=f"{job.source}: {text} suffices")
    return [results[job.target] for job in jobs]
