"""What whole programs cost: memory, the start of a query, and a folder of meshes by several jobs.

Seconds here are those of a clock on the wall.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import ClassVar, Final

import numpy as np

from dicedesign.batch.file_batches import FEWEST_TASKS_PER_JOB
from dicedesign.bench.measures.processes import in_new_process
from dicedesign.bench.rows import Row, column, hidden, percent
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.formats import stl_bytes
from tests.reference.sampled import random_directions

__all__ = [
    "FolderRow",
    "Memory",
    "cold_starts",
    "job_counts",
    "peak_memory",
    "throughput",
    "wall_seconds",
]

FEW_FILES: Final = 4 * FEWEST_TASKS_PER_JOB
"""Meshes for each job in the folder that tells the time until all jobs are at work."""

FOLDER_ROUNDS: Final = 3

MESH_POINTS: Final = (8, 100)
"""Corners of a mesh in the folder, and one more than the most."""

_COLD: Final = {
    "python": ("-c", "pass"),
    "python, import of scipy.spatial": ("-c", "import scipy.spatial"),
    "dicedesign rest FILE": ("-m", "dicedesign", "rest", "die.stl"),
}
"""Programs whose whole time is measured."""

_POINTS: Final = """
from scipy.spatial import ConvexHull
from dicedesign import rest_poses
from tests.reference.sampled import random_directions
rest_poses(random_directions(20, 0))
points = random_directions({count}, 0)
"""


@dataclass(frozen=True)
class Memory:
    """Peaks of memory in MB with many points: with the libraries, after scipy's hull, and after the
    query; see `in_new_process`."""

    points: int
    points_and_libraries_mb: float
    scipy_hull_mb: float
    query_mb: float


def peak_memory(points: int) -> Memory | None:
    """Peaks with so many points, each in a process of its own; None where the system does not
    tell."""
    setting = _POINTS.format(count=points)
    works = [(setting, work) for work in ("pass", "ConvexHull(points)", "rest_poses(points)")]
    with TemporaryDirectory() as name:
        before, hull, query = (peak for _, peak in in_new_process(works, Path(name), 1))
    if before is None or hull is None or query is None:
        return None
    return Memory(points, before, hull, query)


def cold_starts(rounds: int) -> dict[str, float]:
    """Median seconds from the start of a new process to its end, for each program, in turn."""
    taken: dict[str, list[float]] = {name: [] for name in _COLD}
    with TemporaryDirectory() as name:
        folder = Path(name)
        _write_mesh(folder / "die.stl", 0)
        for _ in range(rounds):
            for program, arguments in _COLD.items():
                taken[program].append(wall_seconds(arguments, folder))
    return {program: median(times) for program, times in taken.items()}


@dataclass(frozen=True)
class FolderRow(Row):
    """A folder of meshes by so many jobs.

    Attributes
    ----------
    name: of the row.
    seconds: from the start of the program to its end.
    files_per_second: the start of the program and of the jobs included; efficiency: for each job,
        beside that of a single one.
    running_files_per_second, running_efficiency: the same once all jobs are at work.
    jobs: processes side by side; files: meshes in the folder.
    few_files, few_seconds: the same of a folder with few files for each job.
    """

    table: ClassVar[str | None] = "throughput"

    name: str = column("dicedesign rest FOLDER", -36)
    seconds: float = column("s", 11, ".2f")
    files_per_second: float = column("files/s", 11, ".0f")
    efficiency: float = column("a job %", 11, percent(0))
    running_files_per_second: float = column("running/s", 11, ".0f")
    running_efficiency: float = column("a job %", 11, percent(0))
    jobs: int = hidden()
    files: int = hidden()
    few_files: int = hidden()
    few_seconds: float = hidden()

    @classmethod
    def of(
        cls,
        jobs: int,
        files: int,
        seconds: float,
        few_files: int,
        few_seconds: float,
        alone: FolderRow | None,
    ) -> FolderRow:
        """A row beside the one of a single job, or that one."""
        rate, running = files / seconds, (files - few_files) / (seconds - few_seconds)
        rates = rate, running
        if alone is not None:
            rates = alone.files_per_second, alone.running_files_per_second
        return cls(
            name=f"{files} meshes, {jobs} jobs",
            seconds=seconds,
            files_per_second=rate,
            efficiency=rate / (jobs * rates[0]),
            running_files_per_second=running,
            running_efficiency=running / (jobs * rates[1]),
            jobs=jobs,
            files=files,
            few_files=few_files,
            few_seconds=few_seconds,
        )


def job_counts(cores: int) -> list[int]:
    """Powers of two up to the number of cores, and that number."""
    powers = [2**k for k in range(cores.bit_length()) if 2**k < cores]
    return [*powers, cores]


def throughput(
    files: int,
    jobs: Sequence[int] | None = None,
    *,
    rounds: int = FOLDER_ROUNDS,
    few_files: int = FEW_FILES,
    rest_seconds: Callable[[Path, int], float] | None = None,
) -> Iterator[FolderRow]:
    """`dicedesign rest FOLDER --jobs J` by several numbers of jobs, medians.

    files: meshes of the folder beside the `few_files` for each job, at least 1.
    jobs: the first is 1; None for `job_counts` of this machine.
    rest_seconds: tells how long the program takes for a folder by so many jobs.
    """
    alone: FolderRow | None = None
    measure = rest_seconds or _rest_seconds
    with TemporaryDirectory() as name:
        root = Path(name)
        for count in jobs or job_counts(os.cpu_count() or 1):
            few = few_files * count
            folders = {size: root / str(size) for size in (few, few + files)}
            for size, folder in folders.items():
                _fill(folder, size)
            taken: dict[int, list[float]] = {size: [] for size in folders}
            for _ in range(rounds):
                for size, folder in folders.items():
                    taken[size].append(measure(folder, count))
            (first, less), (last, most) = ((size, median(t)) for size, t in taken.items())
            row = FolderRow.of(count, last, most, first, less, alone)
            alone = alone or row
            yield row


def _rest_seconds(folder: Path, jobs: int) -> float:
    with TemporaryDirectory() as name:
        table = str(Path(name) / "rests.csv")
        arguments = ("-m", "dicedesign", "rest", str(folder), "--out", table, "--jobs", str(jobs))
        return wall_seconds(arguments, folder)


def _fill(folder: Path, files: int) -> None:
    if not folder.exists():
        folder.mkdir()
        for number in range(files):
            _write_mesh(folder / f"{number}.stl", number)


def _write_mesh(path: Path, seed: int) -> None:
    """A closed mesh with random corners on a sphere that is pulled out of shape."""
    rng = np.random.default_rng(seed)
    corners = random_directions(int(rng.integers(*MESH_POINTS)), seed)
    hull = convex_hull(corners * [1.0, 0.8, 0.7])
    path.write_bytes(stl_bytes(hull.vertices, hull.triangles))


def wall_seconds(arguments: Sequence[str], folder: Path) -> float:
    """Seconds that Python takes with arguments in a folder. Raises RuntimeError if it fails."""
    command = [sys.executable, *arguments]
    begun = time.perf_counter()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - begun
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(arguments)} failed:\n{done.stderr}")
    return seconds
