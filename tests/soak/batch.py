"""A folder of many meshes by `dicedesign rest`, whose workers and whose self are killed on the
way."""

from __future__ import annotations

import contextlib
import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.batch.rest_table import COLUMNS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.runtime.arrays import Floats, Integers
from tests.reference.oracle import hull_probabilities
from tests.reference.problem import Problem
from tests.reference.random_hulls import random_hull
from tests.reference.solids import PLATONIC, antiprism, bipyramid, box, platonic, prism
from tests.soak.commands import Fault, before_main
from tests.soak.mesh_files import BROKEN, mesh_file

BROKEN_EVERY: Final = 50
"""One mesh in so many has no answer."""

PER_FOLDER: Final = 1000

RANDOM_BODIES: Final = 24

ENDINGS: Final = (".stl", ".obj", ".off", ".xyz", ".ply")

TOLERANCE: Final = {".stl": 2e-4}
"""Of odds, where coordinates are rounded to single precision."""

EXACT_TOLERANCE: Final = 1e-8

HAS_PROC: Final = Path("/proc/self/statm").exists()
"""Whether the system tells of processes as Linux does."""

LOOK: Final = 0.25
"""Seconds between looks at the processes."""

LEAST_LIFE: Final = 40.0
"""Seconds that a worker lives whose memory tells something; at first it grows by what is
imported."""

MESHES_PER_KILL: Final = 500
"""No more workers are killed than one for so many meshes, and one: a file that often loses its
worker is given up."""

SECONDS_PER_MESH: Final = 0.2
"""A batch that takes longer hangs."""

LEAST_SECONDS: Final = 120.0


@dataclass(frozen=True)
class _Body:
    """points: (n, 3) corners; triangles: (t, 3); shares: (k,) odds of its rests, ascending."""

    points: Floats
    triangles: Integers
    shares: Floats


@dataclass
class Batch:
    """What a batch did.

    Attributes
    ----------
    workers: memory in units of 10^6 bytes of each worker of the last session, by its id, at looks
        `LOOK` seconds apart; empty where the system does not tell.
    faults: hangs, unforeseen errors, and tables that cannot be read.
    """

    workers: dict[int, list[float]] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)

    @property
    def growth(self) -> float | None:
        """Growth of the memory of the worker that lived longest, from the second quarter of its
        life to the last, as a part; None for lives too short to tell."""
        series = max(self.workers.values(), key=len, default=[])
        quarter = len(series) // 4
        if len(series) * LOOK < LEAST_LIFE:
            return None
        return median(series[-quarter:]) / median(series[quarter : 2 * quarter]) - 1.0


def _bodies() -> list[_Body]:
    """Bodies whose odds are known: by closed forms, or in 60 digits."""
    problems = [platonic(name) for name in PLATONIC]
    problems += [prism(sides, 0.6 + 0.2 * sides) for sides in range(3, 9)]
    problems += [antiprism(sides) for sides in range(4, 7)]
    problems += [bipyramid(sides) for sides in range(3, 8)]
    problems += [box(1.0, 1.0 - 0.05 * k, 0.5 + 0.03 * k) for k in range(12)]
    return [*map(_known, problems), *(_known(random_hull(k)[1]) for k in range(RANDOM_BODIES))]


def _known(problem: Problem) -> _Body:
    hull = convex_hull(problem.points)
    shares = problem.shares
    if shares is None:
        exact = [float(one) for one in hull_probabilities(hull, [hull.centroid])]
        shares = np.array([one for one in exact if one > 0.0])
    return _Body(hull.vertices, hull.triangles, np.sort(shares))


def make_meshes(folder: Path, count: int, seed: int) -> dict[str, Floats | None]:
    """Fill a folder with meshes, each a known body turned, moved and sized at random.

    Returns the odds of each file, by its path within the folder; None
    for a broken one.
    """
    known, answers = _bodies(), dict[str, Floats | None]()
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        body = known[int(rng.integers(len(known)))]
        turn = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
        moved = body.points @ turn.T + rng.uniform(-1.0, 1.0, 3)
        points = moved * 10.0 ** rng.uniform(-2.0, 2.0)
        within = folder / str(number // PER_FOLDER)
        within.mkdir(exist_ok=True)
        if number % BROKEN_EVERY == 0:
            name = _write_broken(rng, within, str(number), points, body.triangles)
            answers[name] = None
        else:
            ending = ENDINGS[int(rng.integers(len(ENDINGS)))]
            name = f"{within.name}/{number}{ending}"
            data = mesh_file(ending, points, body.triangles, text=bool(rng.integers(2)))
            (folder / name).write_bytes(data)
            answers[name] = body.shares
    return answers


def _write_broken(
    rng: np.random.Generator, within: Path, stem: str, points: Floats, triangles: Integers
) -> str:
    """Write a file that has no answer; its path within the folder."""
    which = int(rng.integers(len(BROKEN) + 3))
    ending, content = BROKEN[which] if which < len(BROKEN) else (".stl", None)
    path = within / f"{stem}{ending}"
    if content is not None:
        path.write_bytes(content(points, triangles))
    elif which == len(BROKEN):
        os.mkfifo(path)
    elif which == len(BROKEN) + 1:
        path.symlink_to("nowhere.stl")
    else:
        path.symlink_to(path.name)
    return f"{within.name}/{path.name}"


def run_batches(
    folder: Path, table: Path, jobs: int, files: int, seed: int, kill_seconds: float
) -> Batch:
    """Run the command over a folder, killed once, interrupted once, then to its end, with a worker
    killed at an interval.

    table: to be written; files: how many meshes there are. Processes are gone when it returns or
    raises.
    """
    batch, rng = Batch(), np.random.default_rng(seed)
    for sent in (signal.SIGKILL, signal.SIGINT, None):
        early = None if sent is None else float(rng.uniform(0.5, 1.5)) * kill_seconds / 2.0
        with _begun(folder, table, jobs) as (process, printed):
            code = _watch(batch, rng, process, sent, early, kill_seconds, files)
        said = printed.read_text("utf-8", "replace")
        expected = {0} if sent is None else {0, 130 if sent == signal.SIGINT else -sent}
        last = " ".join(said.split())[-300:]
        if code is None:
            batch.faults.append(Fault("hang", f"no end of the batch: {last}"))
        elif (code not in expected or "Traceback" in said) and not before_main(said):
            batch.faults.append(Fault("traceback", f"exit code {code}: {last}"))
        if sent is not None and table.exists():
            batch.faults += _unreadable(table)
    return batch


@contextlib.contextmanager
def _begun(folder: Path, table: Path, jobs: int) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """The command, and where it prints; it and its workers are gone at the end."""
    printed = table.with_suffix(".txt")
    command = [sys.executable, "-m", "dicedesign", "rest", str(folder), "--out", str(table)]
    with (
        printed.open("wb") as out,
        subprocess.Popen(
            [*command, "--jobs", str(jobs)], stdout=out, stderr=out, start_new_session=True
        ) as process,
    ):
        try:
            yield process, printed
        finally:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)


def _watch(
    batch: Batch,
    rng: np.random.Generator,
    process: subprocess.Popen[bytes],
    sent: signal.Signals | None,
    early: float | None,
    kill_seconds: float,
    files: int,
) -> int | None:
    """Wait for the end, or send a signal before; the exit code, None if there is no end."""
    limit = time.monotonic() + LEAST_SECONDS + SECONDS_PER_MESH * files
    signal_at = kill_at = float("inf")
    kills, batch.workers = 0, {}
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(LOOK)
        now, workers = time.monotonic(), _workers(process.pid)
        if now >= limit:
            return None
        if workers or not HAS_PROC:
            # The time until there are workers is that of the machine.
            signal_at = min(signal_at, now + (early or 0.0))
            kill_at = min(kill_at, now + kill_seconds)
        for worker in workers:
            batch.workers.setdefault(worker, []).extend(_megabytes(worker))
        if now >= signal_at and sent is not None:
            process.send_signal(sent)
            sent = None
        if now >= kill_at and workers and kills <= files / MESHES_PER_KILL:
            kill_at = float("inf")
            with contextlib.suppress(ProcessLookupError):
                os.kill(workers[int(rng.integers(len(workers)))], signal.SIGKILL)
                kills += 1


def _workers(pid: int) -> list[int]:
    """Ids of a process's workers; none where the system has no /proc."""
    found = []
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    for child in children:
        with contextlib.suppress(OSError):
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
    return found


def _megabytes(pid: int) -> list[float]:
    """Memory that a process holds, in units of 10^6 bytes; nothing if that is not known."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return []
    return [pages * os.sysconf("SC_PAGE_SIZE") / 1e6]


def _rows(table: Path) -> Iterator[dict[str, Any]]:
    with table.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file, strict=True)
        if rows.fieldnames != list(COLUMNS):
            raise ValueError(f"columns {rows.fieldnames}")
        for row in rows:
            if None in row or None in row.values():
                raise ValueError(f"a row with other columns: {row}")
            yield row


def _unreadable(table: Path) -> list[Fault]:
    try:
        for _ in _rows(table):
            pass
    except (ValueError, csv.Error) as error:
        return [Fault("lost", f"a table that cannot be read: {error}")]
    return []


def batch_faults(table: Path, answers: dict[str, Floats | None]) -> Iterator[Fault]:
    """What is wrong with the table of a batch. answers: see `make_meshes`."""
    for path in table.parent.glob(".*"):
        yield Fault("lost", f"{path.name} was left beside the table")
    odds, errors = dict[str, list[float]](), dict[str, str]()
    try:
        for row in _rows(table):
            errors[row["file"]] = row["error"]
            if row["rest"]:
                odds.setdefault(row["file"], []).append(float(row["probability"]))
    except (OSError, ValueError, csv.Error) as error:
        yield Fault("lost", f"a table that cannot be read: {error}")
        return
    for file in answers.keys() ^ errors.keys():
        yield Fault("lost", f"{file}: rows {'missing' if file in answers else 'of no mesh'}")
    for file in answers.keys() & errors.keys():
        shares, got = answers[file], np.sort(odds.get(file, []))
        if shares is None:
            if not errors[file] or len(got):
                yield Fault("wrong", f"{file}: expected an error, got odds {got}")
        elif errors[file]:
            yield Fault("wrong", f"{file}: {errors[file]}")
        elif len(got) != len(shares) or np.abs(got - shares).max() > _tolerance(file):
            yield Fault("wrong", f"{file}: expected odds {shares}, got {got}")


def _tolerance(file: str) -> float:
    return TOLERANCE.get(Path(file).suffix, EXACT_TOLERANCE)
