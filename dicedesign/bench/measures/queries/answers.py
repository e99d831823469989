"""Error of resting probabilities over the time they take, by this model and by other methods."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np

from dicedesign.bench.measures.processes import CrashError, HangError, Watchdog
from dicedesign.bench.measures.queries.other_methods import (
    TrimeshRequest,
    matched,
    solid_angle_probabilities,
    trimesh_poses,
)
from dicedesign.bench.reference.bodies_with_answers import Subject
from dicedesign.bench.reference.precision import evaluated_probabilities
from dicedesign.bench.rows import Row, column
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats
from tests.reference.sampled import (
    lattice_directions,
    random_directions,
    sampled_probabilities,
)

__all__ = [
    "FLOAT32",
    "FLOAT64",
    "LATTICE",
    "MONTE_CARLO",
    "SEED",
    "SOLID_ANGLES",
    "SPREAD",
    "TRIMESH",
    "TRIMESH_SPREAD",
    "Answer",
    "answers",
    "timed_trimesh",
]

TimedShares = tuple[tuple[Floats, float], float]
"""Probabilities by facet (m,), the largest of a rest that is none of the facets, and the seconds
it took."""

FLOAT64: Final = "this model, float64"

FLOAT32: Final = "this model, float32"

MONTE_CARLO: Final = "traced random directions"

LATTICE: Final = "traced lattice directions"

SOLID_ANGLES: Final = "solid angles of facets"

TRIMESH: Final = "trimesh, exact center"

TRIMESH_SPREAD: Final = "trimesh, spread centers"
"""trimesh's stable poses for the center of mass, and for several drawn around it."""

DIRECTIONS: Final = (100, 1000, 10_000, 100_000, 1_000_000)
"""How many directions are traced."""

CENTERS: Final = (10, 100, 1000)
"""How many centers of mass trimesh draws."""

SPREAD: Final = 0.01
"""Spread of these centers along each axis, in units of half the body's thickness: trimesh draws
until it has as many inside of the hull as it was asked for."""

SAME_NORMAL: Final = np.radians(3.0)
"""A rest that trimesh finds belongs to the hull's nearest facet, if that is turned by no more."""

SEED: Final = 0
"""Of random directions, of the lattice's orientation and of trimesh's centers of mass."""

REPETITIONS: Final = 40
"""Run times are medians of so many runs, or of as many as fit into `REPEAT_SECONDS`."""

REPEAT_SECONDS: Final = 0.5

WORKER_SECONDS: Final = 120.0
"""In which a process that runs trimesh must be ready."""

SECONDS_PER_FACET: Final = {SOLID_ANGLES: 1e-3, TRIMESH: 2e-4}
"""What a method may take for each facet of a dense hull on a common machine, roughly; solid angles
mostly where facets are so small that rolling off them is decided in exact arithmetic."""


@dataclass(frozen=True)
class Answer(Row):
    """One method's answer.

    Attributes
    ----------
    method: one of this module's names.
    samples: directions or centers of mass; None for methods that take none.
    seconds: from the points and the center of mass to the probabilities, hull included; None where
        there is no answer.
    error: largest error of a facet's probability; None where there is none or it is not known.
    note: why not.
    """

    table: ClassVar[str | None] = None

    method: str = column("method", -27)
    samples: int | None = column("samples", 9, none="", default=None)
    seconds: float | None = column("s", 12, ".5f", default=None)
    error: float | None = column("error", 10, ".1e", default=None)
    note: str = column("", 0, default="")


def answers(
    subject: Subject,
    *,
    most_directions: int,
    seconds: float,
    centers: Sequence[int] = CENTERS,
    spread: float = SPREAD,
    ask_trimesh: Callable[[TrimeshRequest], Any] | None = None,
) -> Iterator[Answer]:
    """The answers of all methods.

    most_directions: tracing takes no more. centers, spread: of trimesh.
    ask_trimesh: as `timed_trimesh`, and importable by name.
    seconds: an answer that takes longer, or is expected to, is left out and says so. trimesh is
        stopped then; the others keep to what is expected of them.
    """
    yield from _model(subject)
    counts = [count for count in DIRECTIONS if count <= most_directions]
    ways = ((MONTE_CARLO, random_directions), (LATTICE, lattice_directions))
    base = _traced(subject, lattice_directions, 1)[1]
    for method, directions in ways:
        trace = partial(_traced, subject, directions)
        yield from _growing(subject, method, counts, trace, seconds, base, 0.0)
    yield _solid_angles(subject, seconds)
    yield from _trimesh_answers(subject, seconds, centers, spread, ask_trimesh or timed_trimesh)


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a call returns, and the median of its seconds in a few runs."""
    taken: list[float] = []
    while len(taken) < REPETITIONS and sum(taken) < REPEAT_SECONDS:
        started = time.perf_counter()
        result = run()
        taken.append(time.perf_counter() - started)
    return result, float(np.median(taken))


def _model(subject: Subject) -> Iterator[Answer]:
    """This model as it is, and the same run after which coordinates and areas are evaluated again
    in float32, in NumPy."""
    poses, seconds = timed(lambda: rest_poses(subject.body, subject.center))
    shares = np.zeros(len(subject.hull.normals))
    shares[poses.facets] = poses.probabilities
    if subject.oracle:
        yield Answer(FLOAT64, None, seconds, subject.error(shares))
    else:
        yield Answer(FLOAT64, None, seconds, None, "taken as exact")

    def in_single_precision() -> Floats:
        basins = rest_poses(subject.body, subject.center).basins
        return evaluated_probabilities(subject.hull, basins, np.float32)

    shares, seconds = timed(in_single_precision)
    yield Answer(FLOAT32, None, seconds, subject.error(shares))


def _growing(
    subject: Subject,
    method: str,
    counts: Sequence[int],
    ask: Callable[[int], TimedShares],
    limit: float,
    base: float,
    each: float,
) -> Iterator[Answer]:
    """Answers with growing sample counts, until one is expected to take too long. At first base is
    expected for all samples together and each for each of them; then as the last answers took."""
    taken, done, stopped = base, 0, False
    for count in counts:
        expected = taken + each * (count - done)
        if stopped:
            yield Answer(method, count, note="left out, as with fewer samples")
            continue
        if expected > limit:
            yield _left_out(method, count, expected)
            continue
        before = taken
        try:
            (shares, lost), taken = ask(count)
        except (HangError, CrashError) as error:
            stopped = True
            hung = isinstance(error, HangError)
            note = f"left out, took more than {limit:g} s" if hung else f"failed: {error}"
            yield Answer(method, count, note=note)
            continue
        each, done = max(taken - before, 0.0) / (count - done), count
        yield Answer(method, count, taken, max(subject.error(shares), lost))


def _solid_angles(subject: Subject, limit: float) -> Answer:
    expected = SECONDS_PER_FACET[SOLID_ANGLES] * len(subject.hull.normals)
    if expected > limit:
        return _left_out(SOLID_ANGLES, None, expected)
    shares, taken = timed(lambda: solid_angle_probabilities(subject.classified()))
    return Answer(SOLID_ANGLES, None, taken, subject.error(shares))


def _left_out(method: str, samples: int | None, expected: float) -> Answer:
    return Answer(method, samples, note=f"left out, some {expected:.0f} s expected")


def _traced(subject: Subject, directions: Callable[[int, int], Floats], count: int) -> TimedShares:
    shares, seconds = timed(
        lambda: sampled_probabilities(subject.classified(), directions(count, SEED))
    )
    return (shares, 0.0), seconds


def _trimesh_answers(
    subject: Subject,
    limit: float,
    centers: Sequence[int],
    spread: float,
    ask_trimesh: Callable[[TrimeshRequest], Any],
) -> Iterator[Answer]:
    each = SECONDS_PER_FACET[TRIMESH] * len(subject.hull.normals)
    if each > limit:
        yield _left_out(TRIMESH, 1, each)
        yield from (_left_out(TRIMESH_SPREAD, count, each * count) for count in centers)
        return
    with Watchdog(ask_trimesh) as dog:

        def ask(variance: float, count: int) -> TimedShares:
            hull = subject.hull
            triangles = hull.source[hull.triangles]
            request = TrimeshRequest(
                subject.body.points, triangles, subject.center, variance, count, SEED
            )
            (normals, shares), seconds = dog.call(request, limit + REPEAT_SECONDS)
            return matched(hull, normals, shares, SAME_NORMAL), seconds

        def ask_at_first(count: int) -> TimedShares:
            dog.call(_simplex_request(), WORKER_SECONDS)
            return ask(0.0, count)

        (exact,) = _growing(subject, TRIMESH, (1,), ask_at_first, limit, 0.0, each)
        yield exact
        if exact.seconds is None:
            for count in centers:
                yield Answer(TRIMESH_SPREAD, count, note="left out, as with the exact center")
            return
        around = partial(ask, (spread * _thickness(subject.hull.vertices) / 2.0) ** 2)
        yield from _growing(subject, TRIMESH_SPREAD, centers, around, limit, 0.0, exact.seconds)


def timed_trimesh(request: TrimeshRequest) -> tuple[tuple[Floats, Floats], float]:
    """What trimesh answers, and the seconds."""
    return timed(partial(trimesh_poses, request))


def _simplex_request() -> TrimeshRequest:
    """One that is answered as soon as all that is needed has been imported."""
    hull = convex_hull(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    return TrimeshRequest(hull.vertices, hull.triangles, hull.centroid)


def _thickness(points: Floats) -> float:
    """Smallest extent of points (n, 3) along their principal axes."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    return float(np.ptp(points @ axes.T, axis=0).min())
