"""What whole programs cost: memory, the start of a query, and a folder of meshes by several jobs.

Seconds here are those of a clock on the wall.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from dicedesign.batch.file_batches import FEWEST_TASKS_PER_JOB
from dicedesign.bench.measures.processes import in_new_process
from dicedesign.bench.reference.sampled import random_directions
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.stl import stl_bytes

__all__ = ["Memory", "Throughput", "cold_starts", "job_counts", "peak_memory", "throughput"]

MANY_POINTS: Final = 100_000
"""On the sphere whose peak of memory is measured."""

FILES: Final = 2000
"""Meshes that a folder has beside the few."""

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

_POINTS: Final = f"""
from scipy.spatial import ConvexHull
from dicedesign import rest_poses
from dicedesign.bench.reference.sampled import random_directions
rest_poses(random_directions(20, 0))
points = random_directions({MANY_POINTS}, 0)
"""


@dataclass(frozen=True)
class Memory:
    """Peaks of memory in MB, see `in_new_process`.

    Attributes
    ----------
    points: how many there are.
    before: with the points and the libraries.
    hull: of scipy's hull.
    query: of the query.
    """

    points: int
    before: float
    hull: float
    query: float

    def plain(self) -> dict[str, Any]:
        """The row as plain data."""
        return {
            "points": self.points,
            "points_and_libraries_mb": self.before,
            "scipy_hull_mb": self.hull,
            "query_mb": self.query,
        }


def peak_memory() -> Memory | None:
    """Peaks with many points, each in a process of its own; None where the system does not tell."""
    works = [(_POINTS, "pass"), (_POINTS, "ConvexHull(points)"), (_POINTS, "rest_poses(points)")]
    with TemporaryDirectory() as name:
        peaks = [peak for _, peak in in_new_process(works, Path(name), 1)]
    before, hull, query = peaks
    if before is None or hull is None or query is None:
        return None
    return Memory(MANY_POINTS, before, hull, query)


def cold_starts(rounds: int) -> dict[str, float]:
    """Median seconds from the start of a new process to its end, for each program, in turn."""
    taken: dict[str, list[float]] = {name: [] for name in _COLD}
    with TemporaryDirectory() as name:
        folder = Path(name)
        _write_mesh(folder / "die.stl", 0)
        for _ in range(rounds):
            for program, arguments in _COLD.items():
                taken[program].append(_wall_seconds(arguments, folder))
    return {program: median(times) for program, times in taken.items()}


@dataclass(frozen=True)
class Throughput:
    """A folder of meshes by so many jobs.

    Attributes
    ----------
    jobs: processes side by side.
    files: meshes in the folder.
    seconds: from the start of the program to its end.
    few_files, few_seconds: the same of a folder with `FEW_FILES` for each job.
    """

    jobs: int
    files: int
    seconds: float
    few_files: int
    few_seconds: float

    @property
    def rate(self) -> float:
        """Files per second, the start of the program and of the jobs included."""
        return self.files / self.seconds

    @property
    def running_rate(self) -> float:
        """Files per second once all jobs are at work."""
        return (self.files - self.few_files) / (self.seconds - self.few_seconds)

    def plain(self, alone: Throughput) -> dict[str, Any]:
        """The row as plain data, beside the one of a single job."""
        return {
            **asdict(self),
            "files_per_second": self.rate,
            "efficiency": self.rate / (self.jobs * alone.rate),
            "running_files_per_second": self.running_rate,
            "running_efficiency": self.running_rate / (self.jobs * alone.running_rate),
        }


def job_counts(cores: int) -> list[int]:
    """Powers of two up to the number of cores, and that number."""
    powers = [2**k for k in range(cores.bit_length()) if 2**k < cores]
    return [*powers, cores]


def throughput(
    jobs: Sequence[int] | None = None,
    *,
    files: int = FILES,
    rounds: int = FOLDER_ROUNDS,
    on_jobs: Callable[[int], None] = lambda jobs: None,
) -> Iterator[Throughput]:
    """`dicedesign rest FOLDER --jobs J` by several numbers of jobs, medians.

    jobs: each at least 1; None for `job_counts` of this machine.
    files: meshes of the folder beside the `FEW_FILES` for each job, at least 1.
    on_jobs: is told each number before it is measured.
    """
    with TemporaryDirectory() as name:
        root = Path(name)
        for count in jobs or job_counts(os.cpu_count() or 1):
            on_jobs(count)
            few = FEW_FILES * count
            folders = {size: root / str(size) for size in (few, few + files)}
            for size, folder in folders.items():
                _fill(folder, size)
            taken: dict[int, list[float]] = {size: [] for size in folders}
            for _ in range(rounds):
                for size, folder in folders.items():
                    taken[size].append(_rest_seconds(folder, count))
            (first, less), (last, most) = ((size, median(t)) for size, t in taken.items())
            yield Throughput(count, last, most, first, less)


def _rest_seconds(folder: Path, jobs: int) -> float:
    with TemporaryDirectory() as name:
        table = str(Path(name) / "rests.csv")
        arguments = ("-m", "dicedesign", "rest", str(folder), "--out", table, "--jobs", str(jobs))
        return _wall_seconds(arguments, folder)


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


def _wall_seconds(arguments: Sequence[str], folder: Path) -> float:
    """Seconds that Python takes with arguments in a folder. Raises RuntimeError if it fails."""
    command = [sys.executable, *arguments]
    begun = time.perf_counter()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - begun
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(arguments)} failed:\n{done.stderr}")
    return seconds
