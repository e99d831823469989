"""Times of a query and of a gradient, as multiples of scipy's convex hull of the same points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run, machine_description
from dicedesign.bench.options import meshes
from dicedesign.bench.rows import Row, column

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = ["Extent"]

SIZES: Final = (10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
"""Points of the figure."""

EFFORTS: Final = (
    (1000, (20, 0.2)),
    (30_000, (5, 0.0)),
    (100_000, (3, 0.0)),
    (1_000_000, (1, 0.0)),
)
"""Rounds and seconds of measuring for up to so many points of the figure."""

KEY: Final = """
hull: scipy.spatial.ConvexHull of the same points. query: from points in memory to probabilities.
gradient: dice energy with the paper's three regularizers and its gradient. Both compute the hull.
C++: ratio to Qhull of the paper's public implementation, measured earlier on another machine, where
it is known; that of the bunny with 35,000 vertices. trimesh: its stable poses of the hull.
"""

FOLDER_KEY: Final = """\
running: once all jobs are at work. a job: files per second for each job, beside a single job's."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    rounds: how often each work has its turn, at least; seconds: how long the turns of a case go on,
        at least.
    most_points: of the built-in cases; most_drawn: of those of the figure.
    cold_starts: of each program.
    memory_points: with which memory is measured; files: of the folder; 0 for neither.
    """

    rounds: int
    seconds: float
    most_points: int
    most_drawn: int
    cold_starts: int
    memory_points: int
    files: int


@dataclass(frozen=True)
class ProgramRow(Row):
    """Seconds on the wall of a whole program."""

    table: ClassVar[str | None] = None

    program: str = column("whole programs, on the wall", -36)
    seconds: float = column("s", 9, ".3f")


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.designs.design_steps import speed_parts
    from dicedesign.bench.measures.queries.other_methods import TrimeshTimer
    from dicedesign.bench.measures.queries.query_speed import Effort, speed_row
    from dicedesign.bench.reference.speed_cases import built_in_cases, mesh_case
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.meshes.reading import read_body

    extent: Extent = run.extent
    effort, cases = Effort(extent.rounds, extent.seconds), list(built_in_cases(extent.most_points))
    for path in run.options.meshes:
        body = read_body(path)
        convex_hull(body.points)
        cases.append(mesh_case(path.name, path.stem, body))
    with TrimeshTimer() as time_trimesh:
        for case in cases:
            run.begin(case.name)
            yield speed_row(case, effort, time_trimesh)
            run.advance()
        yield KEY
        run.begin("parts of a design")
        for row in speed_parts(effort):
            run.advance()
            yield row
        yield from _programs(run)
        if run.options.figure is not None or run.options.out is not None:
            yield from _growth(run, time_trimesh)
    return True


def _programs(run: Run) -> Items:
    """Whole programs: their start, and unless it is to be quick their memory and throughput."""
    from dicedesign.bench.measures.programs import cold_starts, peak_memory, throughput

    extent: Extent = run.extent
    run.begin("start of programs")
    starts = cold_starts(extent.cold_starts)
    for program, seconds in starts.items():
        yield ProgramRow(program, seconds)
    yield {"cold_start_seconds": starts}
    if extent.memory_points > 0:
        run.begin("memory")
        memory = peak_memory(extent.memory_points)
        yield {"memory": memory}
        if memory is None:
            yield "\npeak memory: not told by this system\n"
        else:
            yield (
                f"\npeak memory with {memory.points:,} points on a sphere: "
                f"{memory.points_and_libraries_mb:.0f} MB with points and libraries, "
                f"{memory.scipy_hull_mb:.0f} MB with scipy's hull, {memory.query_mb:.0f} MB with "
                "the query\n"
            )
    if extent.files > 0:
        run.begin("folder of meshes")
        for row in throughput(extent.files):
            run.advance()
            yield row
        yield FOLDER_KEY
    return True


def _growth(run: Run, time_trimesh: Any) -> Items:
    """Rows of the figure."""
    from dicedesign.bench.measures.queries.query_speed import Effort, GrowthRow, speed_row
    from dicedesign.bench.reference.speed_cases import sphere_case

    for size in SIZES:
        if size > run.extent.most_drawn:
            break
        run.begin(f"figure: {size:,} points")
        effort = next(Effort(*effort) for most, effort in EFFORTS if size <= most)
        yield speed_row(sphere_case(size), effort, time_trimesh, row=GrowthRow)
        run.advance()
    return True


def _figure(rows: Sequence[Any], run: Run) -> Paper:
    """Seconds against points on a sphere, on logarithmic axes, a curve for each work."""
    from dicedesign.report.charts.series import Curve
    from dicedesign.report.charts.time_curves import time_against_size_figure

    curves = []
    for label, name in (
        ("scipy.spatial.ConvexHull", "scipy_hull_seconds"),
        ("all resting probabilities, hull included", "query_seconds"),
        ("energy and gradient, hull included", "gradient_seconds"),
        ("trimesh, stable poses, hull included", "trimesh_seconds"),
    ):
        taken = {row.points: getattr(row, name) for row in rows if row.table == "growth"}
        known = {points: seconds for points, seconds in taken.items() if seconds is not None}
        if known:
            curves.append(Curve(list(known), list(known.values()), label=label))
    described = machine_description("dicedesign")
    note = (
        f"{described['machine']}; processor time, one thread; dicedesign "
        f"{described['dicedesign']}, {described['date']}"
    )
    return time_against_size_figure(curves, "Random points on a sphere", "points", note)


BENCHES.register(
    Bench(
        name="speed",
        line="time of a query and of a gradient, as multiples of a convex hull's",
        description="Measure how long a query and the gradient of a design's energy take, as "
        "multiples of scipy.spatial.ConvexHull on the same points. Seconds of the first two tables "
        "are processor time of all threads together, of which there is one: medians of at least 20 "
        "turns, in random order. Those of whole programs are on the wall. The figure has run times "
        "over 10 to 1,000,000 points on a sphere (10 to 1,000 with --quick).",
        rows=_rows,
        full=Extent(20, 1.0, 100_000, 1_000_000, 5, 100_000, 2000),
        quick=Extent(5, 0.0, 100, 1000, 2, 0, 0),
        options=(meshes(),),
        packages=("numpy", "scipy", "torch", "trimesh"),
        figure=_figure,
    )
)
