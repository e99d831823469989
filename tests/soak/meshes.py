"""Analyze a folder of many meshes by `dicedesign rest`, while processes are killed."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from statistics import median

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from dicedesign.batch.rest_table import COLUMNS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers
from tests.reference.oracle import hull_probabilities
from tests.reference.random_hulls import random_hull
from tests.reference.solids import PLATONIC, antiprism, bipyramid, box, platonic, prism
from tests.soak.frame import JOBS, before_main

BROKEN_EVERY = 50
"""Every fiftieth mesh is invalid."""

PER_FOLDER = 1000

ENDINGS = (".stl", ".text.stl", ".obj", ".off", ".xyz", ".ply")

SINGLE_TOLERANCE, DOUBLE_TOLERANCE = 2e-4, 1e-8
"""Tolerances on probabilities for coordinates in single and in double precision."""

POLL_SECONDS = 0.25

KILL_SECONDS = 20.0
"""Time between two kills of a worker."""

MIN_LIFE_SECONDS = 40.0
"""Least life of a worker whose memory is judged; imports increase it at first."""

MAX_GROWTH = 0.1
"""Limit on the relative growth of the memory of a worker."""

MESHES_PER_KILL = 500
"""Limit on the rate of kills: a file that loses its worker too often is given up."""


LIMIT_SECONDS, SECONDS_PER_MESH = 120.0, 0.2
"""Timeout of a batch: a constant and a part per mesh."""


def mesh_file(ending: str, points: Floats, triangles: Integers) -> bytes:
    """Content of a mesh file with points (n, 3) and triangles (t, 3).

    ending: .stl, .text.stl, .obj, .off, .ply, .xyz, .glb or .3mf.
    """
    if ending == ".stl":
        return stl_bytes(Surface(points, triangles))
    if ending == ".xyz":
        return "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist()).encode()
    kind = {".text.stl": "stl_ascii"}.get(ending, ending[1:])
    options = {"digits": 17} if ending in (".obj", ".off") else {}
    mesh = trimesh.Trimesh(points, triangles, process=False)
    content: bytes | str = mesh.export(file_type=kind, **options)
    return content.encode() if isinstance(content, str) else content


def broken_files(points: Floats, triangles: Integers) -> list[tuple[str, bytes]]:
    """Endings and contents of invalid files, made from a valid mesh."""
    stl, ply, obj, xyz = (
        mesh_file(ending, points, triangles) for ending in (".stl", ".ply", ".obj", ".xyz")
    )
    return [
        (".stl", b""),
        (".stl", stl[:80] + b"\xff\xff\xff\x7f" + stl[84:]),
        (".stl", b"solid\nfacet\nvertex 1 2 three\n"),
        (".ply", ply[:60]),
        (".3mf", b"PK\3\4" + b"\0" * 60),
        (".obj", obj + b"f 1 2 1000000000\n"),
        (".off", b"OFF\n1000000000 4 0\n1 2 3\n"),
        (".off", mesh_file(".off", np.round(points) * [1.0, 1.0, 0.0], triangles)),
        (".xyz", mesh_file(".xyz", points[:3], triangles)),
        (".xyz", xyz + b"nan 0 0\n"),
        (".xyz", xyz + b"1 2 \x00\n"),
    ]


def known_bodies() -> list[tuple[Floats, Integers, Floats]]:
    """Corners (n, 3), triangles (t, 3) and ascending resting probabilities of many bodies.

    The probabilities come from closed forms or 60-digit arithmetic.
    """
    problems = [platonic(name) for name in PLATONIC]
    problems += [prism(sides, 0.6 + 0.2 * sides) for sides in range(3, 9)]
    problems += [antiprism(sides) for sides in range(4, 7)]
    problems += [bipyramid(sides) for sides in range(3, 8)]
    problems += [box(1.0, 1.0 - 0.05 * k, 0.5 + 0.03 * k) for k in range(12)]
    problems += [random_hull(k)[1] for k in range(24)]
    bodies = []
    for problem in problems:
        hull, shares = convex_hull(problem.points), problem.shares
        if shares is None:
            exact = np.array(hull_probabilities(hull, [hull.centroid]), dtype=np.float64)
            shares = exact[exact > 0.0]
        bodies.append((hull.vertices, hull.triangles, np.sort(shares)))
    return bodies


def make_meshes(folder: Path, count: int, seed: int) -> dict[str, Floats | None]:
    """Fill a folder with known bodies, rotated, moved and scaled at random.

    Returns the probabilities of each file by its path within the folder; None if it is invalid.
    """
    known, answers = known_bodies(), dict[str, Floats | None]()
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        corners, triangles, shares = known[rng.integers(len(known))]
        rotated = Rotation.random(random_state=int(rng.integers(2**31))).apply(corners)
        points = (rotated + rng.uniform(-1.0, 1.0, 3)) * 10.0 ** rng.uniform(-2.0, 2.0)
        ending = ENDINGS[rng.integers(len(ENDINGS))]
        content: bytes | str | None = None
        is_broken = number % BROKEN_EVERY == 0
        if is_broken:
            links = [(".stl", content) for content in ("", "gone", ".")]
            variants = [*broken_files(points, triangles), *links]
            ending, content = variants[rng.integers(len(variants))]
        else:
            content = mesh_file(ending, points, triangles)
        path = folder / str(number // PER_FOLDER) / f"{number}{ending}"
        path.parent.mkdir(exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif content:
            # A dangling link, or a link to itself.
            path.symlink_to(path.name if content == "." else "nowhere.stl")
        else:
            os.mkfifo(path)
        answers[str(path.relative_to(folder))] = None if is_broken else shares
    return answers


def run_batches(folder: Path, table: Path, files: int, seed: int) -> list[str]:
    """Run the command three times: killed, interrupted, and to its end; list the faults.

    Workers are killed during all runs. files: number of files.
    """
    rng, faults = np.random.default_rng(seed), []
    for sent in (signal.SIGKILL, signal.SIGINT, None):
        log = table.with_suffix(".txt")
        command = [sys.executable, "-m", "dicedesign", "rest", str(folder), "--out", str(table)]
        with (
            log.open("wb") as out,
            subprocess.Popen(
                [*command, "--jobs", str(JOBS)], stdout=out, stderr=out, start_new_session=True
            ) as process,
        ):
            try:
                code, growth = _watch(rng, process, sent, files)
            finally:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
        output = log.read_text("utf-8", "replace")
        expected = {0} if sent is None else {0, 130 if sent == signal.SIGINT else -sent}
        if (code not in expected or "Traceback" in output) and not before_main(output):
            # The code is None after a timeout.
            faults.append(f"exit code {code}: {' '.join(output.split())[-300:]}")
        if sent is not None and table.exists():
            faults += read_rows(table)[1]
    if growth > MAX_GROWTH:
        faults.append(f"the memory of a worker grew by {growth:.0%}")
    return faults


def _watch(
    rng: np.random.Generator,
    process: subprocess.Popen[bytes],
    sent: signal.Signals | None,
    files: int,
) -> tuple[int | None, float]:
    """Wait for the end, or send a signal before.

    Returns the exit code, None after a timeout, and the relative growth of the memory of the worker
    that lived longest, from the second quarter of its life to the last.
    """
    limit = time.monotonic() + LIMIT_SECONDS + SECONDS_PER_MESH * files
    early = float(rng.uniform(0.25, 0.75)) * KILL_SECONDS
    signal_at = kill_at = float("inf")
    kills, pages, code = 0, dict[int, list[int]](), None
    while code is None and (now := time.monotonic()) < limit:
        workers = _workers(process.pid)
        for worker, count in workers.items():
            pages.setdefault(worker, []).append(count)
        if pages or sys.platform != "linux":
            # The clock starts with the first workers.
            signal_at, kill_at = min(signal_at, now + early), min(kill_at, now + KILL_SECONDS)
        if now >= signal_at and sent is not None:
            process.send_signal(sent)
            sent = None
        if now >= kill_at and workers and kills <= files / MESHES_PER_KILL:
            kill_at, kills = float("inf"), kills + 1
            with suppress(ProcessLookupError):
                os.kill(int(rng.choice(list(workers))), signal.SIGKILL)
        with suppress(subprocess.TimeoutExpired):
            code = process.wait(POLL_SECONDS)
    series = max(pages.values(), key=len, default=[])
    quarter = len(series) // 4
    if len(series) * POLL_SECONDS < MIN_LIFE_SECONDS:
        return code, 0.0
    return code, median(series[-quarter:]) / median(series[quarter : 2 * quarter]) - 1.0


def _workers(pid: int) -> dict[int, int]:
    """Memory pages of each worker of a process by its id, if there is a /proc."""
    pages = {}
    with suppress(OSError):
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            with suppress(OSError, IndexError):
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                    pages[int(child)] = int(Path(f"/proc/{child}/statm").read_text().split()[1])
    return pages


def read_rows(table: Path) -> tuple[list[dict[str, str]], list[str]]:
    """Read the rows of a table, and list its faults."""
    try:
        with table.open(encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file, strict=True)
            rows = list(reader)
    except (OSError, ValueError, csv.Error) as error:
        return [], [f"the table cannot be read: {error}"]
    if reader.fieldnames != list(COLUMNS) or any(None in (*row, *row.values()) for row in rows):
        return [], ["the table or a row has other columns"]
    return rows, []


def batch_faults(table: Path, answers: dict[str, Floats | None]) -> list[str]:
    """List faults in the table of a batch. answers: as returned by `make_meshes`."""
    rows, faults = read_rows(table)
    faults += [f"{path.name} was left beside the table" for path in table.parent.glob(".*")]
    probabilities, errors = dict[str, list[float]](), dict[str, str]()
    for row in rows:
        errors[row["file"]] = row["error"]
        if row["rest"]:
            probabilities.setdefault(row["file"], []).append(float(row["probability"]))
    faults += [
        f"{file}: missing in the table, or not in the folder"
        for file in answers.keys() ^ errors.keys()
    ]
    for file in answers.keys() & errors.keys():
        shares, got = answers[file], np.sort(probabilities.get(file, []))
        if shares is None:
            is_right = bool(errors[file]) and len(got) == 0
        else:
            tolerance = SINGLE_TOLERANCE if file.endswith((".stl", ".ply")) else DOUBLE_TOLERANCE
            is_right = (
                not errors[file]
                and len(got) == len(shares)
                and bool(np.abs(got - shares).max() <= tolerance)
            )
        if not is_right:
            faults.append(f"{file}: expected probabilities {shares}, got {got} {errors[file]}")
    return faults
