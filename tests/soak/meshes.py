"""A folder of many meshes by `dicedesign rest`, whose workers and whose self are killed on the
way."""

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
from dicedesign.runtime.arrays import Floats, Integers
from tests.reference.oracle import hull_probabilities
from tests.reference.random_hulls import random_hull
from tests.reference.solids import PLATONIC, antiprism, bipyramid, box, platonic, prism
from tests.soak.frame import JOBS, before_main

BROKEN_EVERY = 50
"""One mesh in so many has no answer."""

PER_FOLDER = 1000

ENDINGS = (".stl", ".text.stl", ".obj", ".off", ".xyz", ".ply")

SINGLE, DOUBLE = 2e-4, 1e-8
"""Largest error of probabilities, where coordinates are rounded to single precision, and else."""

LOOK = 0.25
"""Seconds between looks at the processes."""

KILL_SECONDS = 20.0
"""After which a worker is killed, again and again."""

LEAST_LIFE = 40.0
"""Seconds that a worker lives whose memory tells something; at first it grows by what is
imported."""

MOST_GROWTH = 0.1
"""Part by which the memory of a worker that counts as flat may grow."""

MESHES_PER_KILL = 500
"""No more workers are killed than one for so many meshes, and one: a file that often loses its
worker is given up."""


LIMIT_SECONDS, SECONDS_PER_MESH = 120.0, 0.2
"""A batch that takes longer than their sum hangs."""


def mesh_file(ending: str, points: Floats, triangles: Integers) -> bytes:
    """The content of a mesh file: .stl, .text.stl, .obj, .off, .ply, .xyz, .glb or .3mf, with
    points (n, 3) and triangles (t, 3)."""
    if ending == ".stl":
        return stl_bytes(points, triangles)
    if ending in (".glb", ".3mf"):
        return trimesh.Trimesh(points, triangles, process=False).export(file_type=ending[1:])
    rows = [" ".join(map(repr, point)) for point in points.tolist()]
    sides = [f"3 {a} {b} {c}" for a, b, c in triangles.tolist()]
    if ending == ".text.stl":
        lines = ["solid body"]
        for triangle in triangles:
            corners = [f"vertex {rows[corner]}" for corner in triangle]
            lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
        lines.append("endsolid body")
    elif ending == ".obj":
        lines = [f"v {row}" for row in rows]
        lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    elif ending == ".off":
        lines = ["OFF", f"{len(rows)} {len(sides)} 0", *rows, *sides]
    elif ending == ".ply":
        lines = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
        lines += [f"property double {axis}" for axis in "xyz"]
        lines += [f"element face {len(sides)}", "property list uchar int vertex_indices"]
        lines += ["end_header", *rows, *sides]
    else:
        lines = rows
    return "".join(f"{line}\n" for line in lines).encode()


def broken_files(points: Floats, triangles: Integers) -> list[tuple[str, bytes]]:
    """Ending and content of files that have no answer, made from a sound mesh."""
    stl, ply, obj, xyz = (
        mesh_file(ending, points, triangles) for ending in (".stl", ".ply", ".obj", ".xyz")
    )
    return [
        (".stl", b""),
        (".stl", stl[:-7]),
        (".stl", stl[:80] + b"\xff\xff\xff\x7f" + stl[84:]),
        (".stl", b"solid\nfacet\nvertex 1 2 three\n"),
        (".ply", ply[:60]),
        (".glb", b"glTF\2\0\0\0" + b"\xff" * 40),
        (".3mf", b"PK\3\4" + b"\0" * 60),
        (".obj", obj + b"f 1 2 1000000000\n"),
        (".obj", obj + b"f 1 2 1" + b"0" * 30),
        (".off", b"OFF\n1000000000 4 0\n1 2 3\n"),
        (".off", mesh_file(".off", np.round(points) * [1.0, 1.0, 0.0], triangles)),
        (".xyz", mesh_file(".xyz", points[:3], triangles)),
        (".xyz", xyz + b"nan 0 0\n"),
        (".xyz", xyz + b"1e999 0 0\n"),
        (".xyz", xyz + b"1 2 \x00\n"),
        (".xyz", b"\xff\xfe\x00\x01" * 99),
    ]


def known_bodies() -> list[tuple[Floats, Integers, Floats]]:
    """Corners (n, 3), triangles (t, 3) and the ascending probabilities of their rests, by closed
    forms or in 60 digits, of many bodies."""
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
    """Fill a folder with meshes, each a known body turned, moved and sized at random.

    Returns the probabilities of each file, by its path within the folder; None for a broken one.
    """
    known, answers = known_bodies(), dict[str, Floats | None]()
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        corners, triangles, shares = known[rng.integers(len(known))]
        turned = Rotation.random(random_state=int(rng.integers(2**31))).apply(corners)
        points = (turned + rng.uniform(-1.0, 1.0, 3)) * 10.0 ** rng.uniform(-2.0, 2.0)
        ending = ENDINGS[rng.integers(len(ENDINGS))]
        content: bytes | str | None = None
        is_broken = number % BROKEN_EVERY == 0
        if is_broken:
            ways = [*broken_files(points, triangles), *((".stl", way) for way in ("", "gone", "."))]
            ending, content = ways[rng.integers(len(ways))]
        else:
            content = mesh_file(ending, points, triangles)
        path = folder / str(number // PER_FOLDER) / f"{number}{ending}"
        path.parent.mkdir(exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif content:
            # A link to nothing, or to itself.
            path.symlink_to(path.name if content == "." else "nowhere.stl")
        else:
            os.mkfifo(path)
        answers[str(path.relative_to(folder))] = None if is_broken else shares
    return answers


def run_batches(folder: Path, table: Path, files: int, seed: int) -> list[str]:
    """Run the command over a folder of so many files, killed once, interrupted once, then to its
    end, with workers killed on the way; what went wrong."""
    rng, faults = np.random.default_rng(seed), []
    for sent in (signal.SIGKILL, signal.SIGINT, None):
        printed = table.with_suffix(".txt")
        command = [sys.executable, "-m", "dicedesign", "rest", str(folder), "--out", str(table)]
        with (
            printed.open("wb") as out,
            subprocess.Popen(
                [*command, "--jobs", str(JOBS)], stdout=out, stderr=out, start_new_session=True
            ) as process,
        ):
            try:
                code, growth = _watch(rng, process, sent, files)
            finally:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
        said = printed.read_text("utf-8", "replace")
        expected = {0} if sent is None else {0, 130 if sent == signal.SIGINT else -sent}
        if (code not in expected or "Traceback" in said) and not before_main(said):
            # None is that of a batch that came to no end.
            faults.append(f"exit code {code}: {' '.join(said.split())[-300:]}")
        if sent is not None and table.exists():
            faults += read_rows(table)[1]
    if growth > MOST_GROWTH:
        faults.append(f"the memory of a worker grew by {growth:.0%}")
    return faults


def _watch(
    rng: np.random.Generator,
    process: subprocess.Popen[bytes],
    sent: signal.Signals | None,
    files: int,
) -> tuple[int | None, float]:
    """Wait for the end, or send a signal before: the exit code, None if there is no end, and the
    growth of the memory of the worker that lived longest, from the second quarter of its life to
    the last."""
    limit = time.monotonic() + LIMIT_SECONDS + SECONDS_PER_MESH * files
    early = float(rng.uniform(0.25, 0.75)) * KILL_SECONDS
    signal_at = kill_at = float("inf")
    kills, pages, code = 0, dict[int, list[int]](), None
    while code is None and (now := time.monotonic()) < limit:
        workers = _workers(process.pid)
        for worker, held in workers.items():
            pages.setdefault(worker, []).append(held)
        if pages or sys.platform != "linux":
            # The time until there are workers is that of the machine.
            signal_at, kill_at = min(signal_at, now + early), min(kill_at, now + KILL_SECONDS)
        if now >= signal_at and sent is not None:
            process.send_signal(sent)
            sent = None
        if now >= kill_at and workers and kills <= files / MESHES_PER_KILL:
            kill_at, kills = float("inf"), kills + 1
            with suppress(ProcessLookupError):
                os.kill(int(rng.choice(list(workers))), signal.SIGKILL)
        with suppress(subprocess.TimeoutExpired):
            code = process.wait(LOOK)
    series = max(pages.values(), key=len, default=[])
    quarter = len(series) // 4
    if len(series) * LOOK < LEAST_LIFE:
        return code, 0.0
    return code, median(series[-quarter:]) / median(series[quarter : 2 * quarter]) - 1.0


def _workers(pid: int) -> dict[int, int]:
    """Pages of memory that each worker of a process holds, by its id, where there is a /proc."""
    found = {}
    with suppress(OSError):
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            with suppress(OSError, IndexError):
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found[int(child)] = int(Path(f"/proc/{child}/statm").read_text().split()[1])
    return found


def read_rows(table: Path) -> tuple[list[dict[str, str]], list[str]]:
    """The rows of a table, and what is wrong with it."""
    try:
        with table.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file, strict=True)
            found = list(rows)
    except (OSError, ValueError, csv.Error) as error:
        return [], [f"a table that cannot be read: {error}"]
    if rows.fieldnames != list(COLUMNS) or any(None in (*row, *row.values()) for row in found):
        return [], ["a table with other columns, or a row with others"]
    return found, []


def batch_faults(table: Path, answers: dict[str, Floats | None]) -> list[str]:
    """What is wrong with the table of a batch. answers: see `make_meshes`."""
    rows, faults = read_rows(table)
    faults += [f"{path.name} was left beside the table" for path in table.parent.glob(".*")]
    probabilities, errors = dict[str, list[float]](), dict[str, str]()
    for row in rows:
        errors[row["file"]] = row["error"]
        if row["rest"]:
            probabilities.setdefault(row["file"], []).append(float(row["probability"]))
    faults += [f"{file}: no rows, or rows of no mesh" for file in answers.keys() ^ errors.keys()]
    for file in answers.keys() & errors.keys():
        shares, got = answers[file], np.sort(probabilities.get(file, []))
        if shares is None:
            is_right = bool(errors[file]) and len(got) == 0
        else:
            most = SINGLE if file.endswith(".stl") else DOUBLE
            is_right = (
                not errors[file]
                and len(got) == len(shares)
                and bool(np.abs(got - shares).max() <= most)
            )
        if not is_right:
            faults.append(f"{file}: expected probabilities {shares}, got {got} {errors[file]}")
    return faults
