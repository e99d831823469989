"""time of a query and of a gradient, as multiples of the time of a convex hull

Measure how long a query and the gradient of a design's energy take, as multiples of
scipy.spatial.ConvexHull on the same points, in processor time of one thread; what a trial step of a
design takes; and whole programs on the wall: their start, memory, a folder of meshes by several
jobs. The picture has run times over 10 to 1,000,000 points on a sphere (1,000 with --quick).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import cycle
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from scipy.spatial import ConvexHull

from benchmarks.accuracy import lattice_directions, random_directions, stable_poses
from benchmarks.frame import Report, Watched, panels, time_in_turn
from dicedesign import (
    RestPoses,
    differentiable_rest,
    differentiable_rest_batch,
    read_body,
    rest_poses,
    sum_of_dice,
)
from dicedesign.energies import EnergyWeights
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.methods import FacetCoordinates, VertexCoordinates
from dicedesign.optimize.coordinates import ShapeEvaluator
from dicedesign.optimize.energy import Objective
from dicedesign.optimize.solvers.candidate import CandidateMaker
from dicedesign.runtime.arrays import Floats
from dicedesign.starts import hendecahedron
from tests.reference.extremes import large

PAPER = EnergyWeights()
"""The dice energy with the paper's three regularizers (eq. 16)."""

MOST_GRADIENT = 20_000
"""Points of which a gradient is still measured."""

FEW = 50_000
"""Points from which on one round is enough."""

MOST_TRIMESH = 2000
"""Corners of a hull for which trimesh is asked; it takes a second for 1,000."""

TRIMESH_SECONDS = 60.0
"""After which it is stopped."""

ROW = 2e-3
"""Seconds that a work is repeated when it has its turn."""

CPP = {
    "tetrahedron": (2.0, None),
    "corner of a cube": (2.0, None),
    "2d6 die of 11 facets": (None, 9.0),
    "100 on a sphere": (3.4, None),
    "1,000 on a sphere": (None, 25.0),
    "1,000 on an ellipsoid": (3.0, None),
    "spot": (1.9, 2.3),
    "bunny": (1.75, 1.4),
}
"""What the paper's public C++ implementation took for probabilities and for a gradient, times as
long as Qhull, measured earlier on another machine."""

ELLIPSOIDS = ((1.0, 1.2, 1.5), (1.0, 1.0, 3.0), (1.0, 2.0, 4.0))
"""Axes of ellipsoids, of which there are 1,000 to 1,000,000 points."""

SIZES = (10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
"""Points of the picture."""

FILES = 2000
"""Meshes of the folder."""

MEMORY_POINTS = 100_000


def add_options(parser: argparse.ArgumentParser) -> None:
    """What else is measured."""
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH")


def run(options: argparse.Namespace, report: Report) -> bool:
    """All tables."""
    rounds, seconds = (5, 0.0) if options.quick else (20, 1.0)
    cases = dict(built_in_cases(100 if options.quick else 1_000_000))
    # Rounded as an STL file is.
    cases |= {f"{name}, STL": x.astype(np.float32) for name, x in cases.items() if len(x) >= 100}
    cases |= {path.stem: read_body(path).points for path in options.meshes}
    row = report.table(
        "cases",
        "case 31s | points 8d | corners 7d | rests 6d | hull ms 9.4f | query 8.2f | C++ 8.2f | "
        "gradient 8.2f | C++ gradient 8.2f | trimesh 8.2f",
    )
    with Watched() as process:
        for name, points in cases.items():
            often = rounds if len(points) < FEW else 1
            hull, query, gradient, trimesh, poses = measure(points, often, seconds, process)
            cpp = CPP.get(name, (None, None))
            counts = (len(points), len(poses.hull.vertices), len(poses.normals))
            row(name, *counts, 1e3 * hull, query, cpp[0], gradient, cpp[1], trimesh)
        part = report.table("parts", "part of a design 32s | body 22s | ms 9.4f | hulls 8.2f")
        for body, corners, works in design_parts():
            actions: list[Callable[[], Any]] = [partial(ConvexHull, corners), *works.values()]
            hull, *others = time_in_turn(actions, seconds, rounds=rounds, row=ROW)
            for what, taken in zip(works, others, strict=True):
                part(what, body, 1e3 * taken, taken / hull)
        measure_programs(report, quick=options.quick)
        if options.out is not None:
            most = 1000 if options.quick else SIZES[-1]
            report.figure = draw([size for size in SIZES if size <= most], process)
    return True


def built_in_cases(most: int) -> Iterator[tuple[str, Floats]]:
    """Dice, dense hulls, and a surface with dents, of at most so many points."""
    cases = {
        "tetrahedron": random_directions(4, 0) * [1.0, 0.8, 0.7],
        "corner of a cube": np.concatenate([np.zeros((1, 3)), np.eye(3)]),
        **{f"{count} on a sphere": random_directions(count, 0) for count in (8, 12, 20)},
        "2d6 die of 11 facets": hendecahedron("bisymmetric").points,
        **{f"{count:,} on a sphere": random_directions(count, 0) for count in (100, 1000)},
        "1,000 on an ellipsoid": large(1000).points,
        "5,000 on a dented surface": dented_ball(5000),
        "100,000 on a sphere": random_directions(100_000, 0),
        **{
            f"{count:,} on {':'.join(map('{:g}'.format, axes))}": random_directions(count, 0) * axes
            for count in (1000, 10_000, 100_000, 1_000_000)
            for axes in ELLIPSOIDS
        },
    }
    yield from ((name, points) for name, points in cases.items() if len(points) <= most)


def dented_ball(count: int) -> Floats:
    """Points (n, 3) on a ball with six round bumps; what lies between these is inside the hull."""
    directions = lattice_directions(count, 0)
    height = np.exp(8.0 * (directions @ random_directions(6, 1).T - 1.0)).sum(axis=1)
    return directions * (0.5 + height)[:, None]


def measure(
    points: Floats, rounds: int, seconds: float, process: Watched
) -> tuple[float, float, float | None, float | None, RestPoses]:
    """Seconds of scipy's hull, multiples of it of a query, of a gradient and of trimesh, hulls
    included, and the rests."""
    poses = rest_poses(points)
    works: list[Callable[[], Any]] = [
        partial(ConvexHull, points),
        lambda: rest_poses(points).probabilities,
    ]
    is_large = len(points) > MOST_GRADIENT or points.dtype == np.float32
    if not is_large:
        is_die = len(poses.hull.vertices) <= 20
        directions = poses.normals if is_die else np.eye(3)
        target = np.full(len(directions), 1.0 / len(directions))
        objective = Objective(
            VertexCoordinates(np.zeros(3), 1.0), target, PAPER, ShapeEvaluator(None)
        )
        works.append(lambda: objective.evaluate(points.ravel(), directions).gradient)
    hull, query, *others = time_in_turn(
        works, seconds, rounds=rounds, row=0.0 if len(points) > MOST_GRADIENT else ROW
    )
    trimesh = None
    if len(poses.hull.vertices) <= MOST_TRIMESH:
        corners = poses.hull.vertices, poses.hull.triangles, poses.center_of_mass
        try:
            trimesh = process.call(TRIMESH_SECONDS, time_trimesh, *corners) / hull
        except Exception as error:
            print(f"note: trimesh: {error}", file=sys.stderr)
    return hull, query / hull, others[0] / hull if others else None, trimesh, poses


def time_trimesh(*corners: Any) -> float:
    """Processor seconds of trimesh, which computes the hull itself."""
    return time_in_turn([partial(stable_poses, *corners)], 0.0, rounds=3)[0]


def design_parts() -> Iterator[tuple[str, Floats, dict[str, Callable[[], Any]]]]:
    """Bodies, their corners, and the parts of a design that repeat most, by name."""
    rng = np.random.default_rng(0)
    start = hendecahedron("bisymmetric")
    facets, place = FacetCoordinates.of(start.points, np.zeros(3))
    places = [place + 1e-2 * rng.normal(size=place.shape)]
    places.append(places[0] + 1e-4 * rng.normal(size=place.shape))
    die = Objective(facets, sum_of_dice([6, 6]).probabilities, PAPER, ShapeEvaluator(None))
    maker, there = CandidateMaker(None), cycle(places)
    works = {
        **trial_steps(die, places, start.directions),
        "trial of the exact method": lambda: (
            maker.attempt(facets, next(there), start.directions).probabilities
        ),
        "trial and Jacobian of all probabilities": lambda: (
            maker.attempt(facets, next(there), start.directions).probability_jacobian
        ),
    }
    yield "2d6 die of 11 facets", facets.shape(places[0]).points, works
    for count in (14, 100):
        points = random_directions(count, 0) * [1.0, 0.9, 0.8]
        single = torch.tensor(points, requires_grad=True)
        yield f"{count} points", points, {"public gradient": partial(public_gradient, single)}
    bodies = [random_directions(14, seed) * [1.0, 0.9, 0.8] for seed in range(1000)]
    many = torch.tensor(np.stack(bodies), requires_grad=True)
    batch = {"public gradient of 1,000 bodies": partial(public_gradient, many)}
    yield "14 points each", bodies[0], batch
    points = large(500).points
    vertices, place = VertexCoordinates.of(points, np.zeros(3))
    places = [place, place + 1e-6 * rng.normal(size=place.shape)]
    dense = Objective(vertices, np.full(3, 1.0 / 3.0), PAPER, ShapeEvaluator(None))
    yield "500 on an ellipsoid", points, trial_steps(dense, places, np.eye(3))


def public_gradient(points: torch.Tensor) -> None:
    """Gradient of the sum of the squared probabilities of a body (n, 3), or of many (b, n, 3)."""
    rest = differentiable_rest if points.ndim == 2 else differentiable_rest_batch
    points.grad = None
    (rest(points)[1] ** 2).sum().backward()


def trial_steps(
    objective: Objective, places: list[Floats], directions: Floats
) -> dict[str, Callable[[], Any]]:
    """Energies at places near to each other, to and fro."""
    there, elsewhere = cycle(places), cycle(places)

    def fresh() -> float:
        forgetful = replace(objective, evaluator=ShapeEvaluator(None))
        return forgetful.evaluate(next(elsewhere), directions).value

    return {
        "trial step, edges known": lambda: objective.evaluate(next(there), directions).value,
        "trial step, new hull": fresh,
    }


def measure_programs(report: Report, *, quick: bool) -> None:
    """Starts on the wall, and unless it is to be quick memory and a folder of meshes."""
    row = report.table("programs", "whole program, on the wall 40s | s 8.3f | /s 8.0f")
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_meshes(folder, 1)
        for program, arguments in {
            "python": ("-c", "pass"),
            "python, import of scipy.spatial": ("-c", "import scipy.spatial"),
            "python, import of torch": ("-c", "import torch"),
            "dicedesign rest FILE": ("-m", "dicedesign", "rest", "0.stl"),
        }.items():
            row(program, median(wall_seconds(arguments, folder) for _ in range(5)), None)
        if quick:
            return
        write_meshes(folder / "meshes", FILES)
        for jobs in sorted({1, os.cpu_count() or 1}):
            table = str(folder / f"{jobs}.csv")
            command = ("-m", "dicedesign", "rest", "meshes", "--out", table, "--jobs", str(jobs))
            seconds = wall_seconds(command, folder)
            row(f"dicedesign rest FOLDER, {FILES} meshes, {jobs} jobs", seconds, FILES / seconds)
    memory = report.table("memory", "100,000 points, peak 30s | MB 8.0f")
    for work in ("points and libraries", "ConvexHull(points)", "rest_poses(points)"):
        memory(work, peak_memory(work if "(" in work else "pass"))


def write_meshes(folder: Path, count: int) -> None:
    """STL files of random hulls of 8 to 99 points."""
    folder.mkdir(exist_ok=True)
    for number in range(count):
        corners = int(np.random.default_rng(number).integers(8, 100))
        hull = convex_hull(random_directions(corners, number) * [1.0, 0.8, 0.7])
        (folder / f"{number}.stl").write_bytes(stl_bytes(hull.surface))


def wall_seconds(arguments: tuple[str, ...], folder: Path) -> float:
    """Seconds that Python takes with arguments in a folder."""
    start = time.perf_counter()
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, *arguments]
    subprocess.run(command, cwd=folder, env=paths, capture_output=True, check=True)
    return time.perf_counter() - start


def peak_memory(work: str) -> float:
    """Megabytes that a process held at most for a work with many points."""
    code = (
        "from scipy.spatial import ConvexHull; from dicedesign import rest_poses\n"
        "import numpy as np\n"
        f"points = np.random.default_rng(0).normal(size=({MEMORY_POINTS}, 3))\n"
        "points /= np.linalg.norm(points, axis=1, keepdims=True); rest_poses(points[:20])\n"
        # Not by getrusage, which counts the peak of the process that started it.
        f"{work}\nprint(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    return float(done.stdout) * 1024 / 1e6


def draw(sizes: list[int], process: Watched) -> Any:
    """Seconds over points on a sphere, on logarithmic axes."""
    curves: dict[str, list[tuple[int, float]]] = {}
    for size in sizes:
        hull, query, gradient, trimesh, _ = measure(random_directions(size, 0), 3, 0.0, process)
        for name, ratio in (
            ("scipy.spatial.ConvexHull", 1.0),
            ("all resting probabilities, hull included", query),
            ("energy and gradient, hull included", gradient),
            ("trimesh, stable poses, hull included", trimesh),
        ):
            if ratio is not None:
                curves.setdefault(name, []).append((size, ratio * hull))
    figure, (axis,) = panels(1, 1, (8.0, 5.5))
    for name, points in curves.items():
        axis.loglog(*zip(*points, strict=True), marker="o", label=name)
    axis.set(title="Random points on a sphere", xlabel="points", ylabel="seconds")
    axis.grid(alpha=0.3)
    axis.legend()
    return figure
