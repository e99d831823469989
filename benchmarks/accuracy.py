"""error against run time, for this model and others

Ask several methods for the resting probabilities of bodies, and compare them with the 60-digit
oracle: this model in double precision and with its coordinates rounded to single, many directions
traced, solid angles of facets, and trimesh. The last two take a body to land on the facet that it
falls toward, however it would roll on the way. The picture has errors over seconds: medians, and
nine in ten of the bodies of a kind.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from benchmarks.frame import Report, Watched, panels
from dicedesign import Body, make_body, read_body, rest_poses
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import signed_solid_angle, unit_vectors
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.morse import basin_references, separatrix_points, signed_areas, wraps
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.tracing import slide, trace_to_rests
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.starts import hendecahedron
from tests.reference.extremes import large
from tests.reference.measurement import ORACLE_FACETS
from tests.reference.oracle import OracleError, hull_probabilities
from tests.reference.stiff import random_body

DIRECTIONS = (100, 1000, 10_000, 100_000, 1_000_000)
"""How many directions are traced."""

CENTERS = (10, 100, 1000)
"""How many centers of mass trimesh draws around the given one."""

SPREAD = 0.01
"""Of these along each axis, over half the body's thickness."""

SAME_NORMAL = np.radians(3.0)
"""A rest that trimesh finds belongs to the hull's nearest facet, if that is turned by no more."""

SEED = 0

BODIES = 10
"""Of each kind."""

MOST_RUNS, RUN_SECONDS = 40, 0.5
"""Run times are medians of so many runs, or of as many as fit into so many seconds."""


@dataclass(frozen=True)
class Subject:
    """A body with its exact probabilities.

    Attributes
    ----------
    exact: (m,) of each facet, mpmath numbers; this model's own for hulls too large for the oracle.
    is_oracle: whether they are the oracle's.
    """

    body: Body
    poses: RestPoses
    exact: list[Any]
    is_oracle: bool

    @classmethod
    def of(cls, body: Body) -> Subject:
        """A body as every method gets it."""
        poses = rest_poses(body)
        centers = [side.equilibria.center_of_mass for side in poses.basins]
        if len(poses.hull.normals) <= ORACLE_FACETS:
            with suppress(OracleError):
                return cls(body, poses, hull_probabilities(poses.hull, centers), True)
        return cls(body, poses, by_facet(poses).tolist(), False)

    def error(self, shares: Floats) -> float:
        """Largest error of probabilities (m,) by facet."""
        return max(abs(float(p - q)) for p, q in zip(self.exact, shares.tolist(), strict=True))

    def classified(self) -> Equilibria:
        """Hull and elements found afresh, as every method needs them."""
        hull = convex_hull(self.body.points, single_precision=self.body.single_precision)
        return classify(hull, self.poses.center_of_mass)


@dataclass(frozen=True)
class Answer:
    """What a method needed and how wrong it is; samples: directions or centers, if it takes any."""

    method: str
    samples: int | None
    seconds: float
    error: float | None


Answers = dict[tuple[str, int | None], list[Answer]]
"""Of bodies of one kind, by method and number of samples."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is asked for."""
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH")
    parser.add_argument(
        "--seconds", type=float, metavar="S", help="longest answer (default: 30; quick: 1)"
    )


def run(options: argparse.Namespace, report: Report) -> bool:
    """All answers to each body."""
    limit = options.seconds or (1.0 if options.quick else 30.0)
    kinds = {path.stem: [read_body(path)] for path in options.meshes}
    kinds = kinds or built_in_bodies(2 if options.quick else BODIES)
    row = report.table(
        "answers",
        "bodies 24s | method 27s | samples 9d | s 10.5f | error 10 % 9.1e | median 9.1e | "
        "error 90 % 9.1e",
    )
    answers: dict[str, Answers] = {}
    for kind, bodies in kinds.items():
        of_kind: Answers = {}
        for body in bodies:
            subject = Subject.of(body)
            for one in ask(subject, limit):
                of_kind.setdefault((one.method, one.samples), []).append(one)
        answers[kind] = of_kind
        for (method, samples), ones in of_kind.items():
            row(kind, method, samples, *summary(ones))
    columns = "".join(f" | {kind}: s 9.2g | {kind}: error 9.0e" for kind in answers)
    row = report.table("methods", f"method 37s{columns}")
    most = {method: samples for of_kind in answers.values() for method, samples in of_kind}
    for method, samples in most.items():
        cells: list[float | None] = []
        for of_kind in answers.values():
            ones = of_kind.get((method, samples))
            cells += summary(ones)[::2][:2] if ones else [None, None]
        row(f"{samples:,} {method}" if (samples or 1) > 1 else method, *cells)
    if options.out is not None:
        report.figure = draw(answers)
    return True


def built_in_bodies(count: int) -> dict[str, list[Body]]:
    """So many of each kind: a die on which every facet, edge and corner carries an equilibrium, as
    it stands and rotated, bodies with facets that they roll off, and dense hulls."""
    die = hendecahedron("bisymmetric").points
    points: dict[str, list[Floats]] = {
        "hendecahedron": [
            die @ (Rotation.random(random_state=seed).as_matrix() if seed else np.eye(3))
            for seed in range(count)
        ],
        "20 random points": [random_body(seed, 20).points for seed in range(count)],
        "1,000 on an ellipsoid": [large(1000, seed).points for seed in range(count)],
    }
    return {
        kind: [make_body(one, name=kind) for one in of_kind] for kind, of_kind in points.items()
    }


def summary(answers: list[Answer]) -> list[float | None]:
    """Median seconds, and the quantiles .1, .5 and .9 of the errors that are known."""
    errors = [one.error for one in answers if one.error is not None]
    quantiles = np.quantile(errors, (0.1, 0.5, 0.9)).tolist() if errors else [None] * 3
    return [float(np.median([one.seconds for one in answers])), *quantiles]


def ask(subject: Subject, limit: float) -> Iterator[Answer]:
    """The answers of all methods; what is expected to take longer than the limit is left out."""

    def answer(method: str, samples: int | None, work: Callable[[], Floats]) -> Answer:
        shares, seconds = timed(work)
        return Answer(method, samples, seconds, subject.error(shares))

    body, center = subject.body, subject.poses.center_of_mass
    exact = answer("this model, float64", None, lambda: by_facet(rest_poses(body, center)))
    yield exact if subject.is_oracle else Answer(exact.method, None, exact.seconds, None)
    yield answer("this model, float32", None, lambda: in_single_precision(rest_poses(body, center)))
    for name, directions in (
        ("traced random directions", random_directions),
        ("traced lattice directions", lattice_directions),
    ):
        last = 0.0
        for count in DIRECTIONS:
            if 10.0 * last <= limit:
                traced = partial(trace, subject, directions, count)
                yield (latest := answer(name, count, traced))
                last = latest.seconds
    yield answer("solid angles of facets", None, lambda: solid_angles(subject.classified()))
    yield from ask_trimesh(subject, limit)


def trace(subject: Subject, directions: Callable[[int, int], Floats], count: int) -> Floats:
    """Share of directions (m,) that end on each facet."""
    return sampled_probabilities(subject.classified(), directions(count, SEED))


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a call returns, and the median of its seconds in a few runs."""
    taken: list[float] = []
    while len(taken) < MOST_RUNS and sum(taken) < RUN_SECONDS:
        start = time.perf_counter()
        result = work()
        taken.append(time.perf_counter() - start)
    return result, float(np.median(taken))


def by_facet(poses: RestPoses) -> Floats:
    """(m,) probabilities of all facets of the hull."""
    shares = np.zeros(len(poses.hull.normals))
    shares[poses.facets] = poses.probabilities
    return shares


def in_single_precision(poses: RestPoses) -> Floats:
    """(m,) with combinatorics as found, and coordinates and areas in float32: the body is put in
    the middle of its box and scaled to half extent 1, so that no power of a length overflows."""
    hull = poses.hull
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    middle, scale = (low + high) / 2.0, float((high - low).max()) / 2.0
    vertices = ((hull.vertices - middle) / scale).astype(np.float32)
    shares = np.zeros(len(hull.normals))
    for side in poses.basins:
        paths = side.paths
        center = ((side.equilibria.center_of_mass - middle) / scale).astype(np.float32)
        points = separatrix_points(paths, vertices, center, np)
        references = basin_references(paths, points, hull.normals[paths.rests].astype(np.float32))
        signed = signed_areas(paths, points, references)
        areas = signed / (4.0 * np.pi) + wraps(signed)
        shares[paths.rests] += (areas if len(paths.rests) > 1 else 1.0) / len(poses.basins)
    return shares


def solid_angles(equilibria: Equilibria) -> Floats:
    """Share of the solid angle (m,) that each facet covers as seen from the center of mass, passed
    on to the facet on which a body comes to rest that is let go on it."""
    hull = equilibria.hull
    corners = equilibria.radii[hull.triangles]
    angles = signed_solid_angle(corners[:, 0], corners[:, 1], corners[:, 2], np)
    facets = np.arange(len(hull.normals))
    owner = np.repeat(facets, np.diff(hull.facet_start) - 2)
    shares = np.bincount(owner, angles / (4.0 * np.pi), len(facets))
    return np.bincount(trace_to_rests(equilibria, facets), shares, len(facets))


def ask_trimesh(subject: Subject, limit: float) -> Iterator[Answer]:
    """trimesh's stable poses, in a process of its own, as it may hang: for the exact center, and
    the mean over centers drawn around it."""
    hull, center = subject.poses.hull, subject.poses.center_of_mass
    axes = np.linalg.svd(hull.vertices - hull.centroid, full_matrices=False)[2]
    thickness = float(np.ptp(hull.vertices @ axes.T, axis=0).min())
    spread = SPREAD * thickness / 2.0
    last = 0.0
    with Watched() as process, suppress(Exception):
        for method, samples, sigma in (
            ("trimesh, exact center", 1, 0.0),
            *(("trimesh, spread centers", count, spread) for count in CENTERS),
        ):
            if 10.0 * last > limit:
                return
            work = partial(stable_poses, hull.vertices, hull.triangles, center, sigma, samples)
            (normals, shares), last = process.call(limit + 60.0, timed, work)
            frequencies, lost = match_shares(hull, normals, shares)
            yield Answer(method, samples, last, max(subject.error(frequencies), lost))


def stable_poses(
    points: Floats, triangles: Integers, center: Floats, sigma: float = 0.0, samples: int = 1
) -> tuple[Floats, Floats]:
    """Normals (k, 3) that point down and probabilities (k,) of trimesh's stable poses.

    sigma: spread of the center of mass along each axis. trimesh knows lengths too small to count,
    so it is given the body at a size of about 1.
    """
    import trimesh

    # A power of two, which rounds nothing.
    size = 2.0 ** int(np.frexp(np.ptp(points, axis=0).max())[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        transforms, shares = trimesh.poses.compute_stable_poses(
            trimesh.Trimesh(points / size, triangles, process=False),
            center_mass=center / size,
            sigma=(sigma / size) ** 2,
            n_samples=samples,
        )
    return -np.asarray(transforms)[:, 2, :3], np.asarray(shares)


def match_shares(hull: ConvexHull, normals: Floats, shares: Floats) -> tuple[Floats, float]:
    """Shares (k,) put on the facets with the nearest normals, (m,), and the largest that found
    none."""
    distances, nearest = cKDTree(hull.normals).query(normals)
    near = distances <= 2.0 * np.sin(SAME_NORMAL / 2.0)
    matched_shares = np.bincount(nearest[near], shares[near], len(hull.normals))
    return matched_shares, float(shares[~near].max(initial=0.0))


def draw(answers: dict[str, Answers]) -> Any:
    """Errors over seconds, a panel for each kind of bodies."""
    figure, axes = panels(len(answers), len(answers))
    for axis, (name, of_kind) in zip(axes, answers.items(), strict=True):
        for method in dict.fromkeys(method for method, _ in of_kind):
            known = [summary(ones) for (which, _), ones in of_kind.items() if which == method]
            if None not in known[0]:
                seconds, low, middle, high = np.maximum(np.transpose(known), 1e-17)
                bars = np.array([middle - low, high - middle])
                axis.errorbar(seconds, middle, bars, marker="o", markersize=4, label=method)
        axis.loglog()
        axis.set(title=name, xlabel="seconds", ylabel="largest error")
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=7)
    return figure


MOST_AT_ONCE = 20_000

MOST_HEIGHTS = 10_000_000
"""Limit on the heights of corners in memory, 80 MB."""

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def sampled_probabilities(
    equilibria: Equilibria, directions: Floats, most_at_once: int = MOST_AT_ONCE
) -> Floats:
    """Share of a set of directions from which a body comes to rest on each facet.

    The lowest corner is the lowest of all corners. Paths that rounding could change are followed as
    rounded; these start within rounding of the border of a basin.

    equilibria: the classified hull; directions: (n, 3) unit start directions that point down;
    most_at_once: number of directions that are traced together.
    Returns (m,), 0 for facets that are no rests. Source: algorithm 1.
    """
    facets = len(equilibria.hull.normals)
    at_once = min(most_at_once, max(1, MOST_HEIGHTS // len(equilibria.radii)))
    reached = np.zeros(facets, dtype=np.int64)
    for first in range(0, len(directions), at_once):
        down = directions[first : first + at_once]
        lowest = np.argmax(down @ equilibria.radii.T, axis=1)
        touched, _ = slide(equilibria, lowest, down, np.zeros(len(down)))
        reached += np.bincount(touched, minlength=facets)
    start = np.flatnonzero(reached)
    ends = trace_to_rests(equilibria, start)
    return np.bincount(ends, weights=reached[start], minlength=facets) / len(directions)


def random_directions(count: int, seed: int) -> Floats:
    """(count, 3) independent unit vectors, uniform on the sphere."""
    return unit_vectors(np.random.default_rng(seed).normal(size=(count, 3)))


def lattice_directions(count: int, seed: int) -> Floats:
    """(count, 3) unit vectors on a spherical Fibonacci lattice, in a random orientation.

    Each point stands for a zone of equal area, and successive ones are a golden angle apart. Unlike
    Sobol points it is as even for any number of points, and it has no seam where a square was
    wrapped around the sphere. The rotation keeps its axis off a body's axes of symmetry.
    Source: R. Swinbank and R. J. Purser, Q. J. R. Meteorol. Soc. 132 (2006) 1769-1793.
    """
    place = np.arange(count)
    z = 1.0 - (2.0 * place + 1.0) / count
    radius, angle = np.sqrt(1.0 - z * z), GOLDEN_ANGLE * place
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    return points @ Rotation.random(random_state=seed).as_matrix().T
