"""`dicedesign bench speed`: how long a query and a gradient take, beside scipy's convex hull."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_json_option,
    json_text,
    print_row,
    progress_bar,
    require_figure_folder,
)

if TYPE_CHECKING:
    from dicedesign.bench.measures.design_steps import Part
    from dicedesign.bench.measures.programs import Memory, Throughput
    from dicedesign.bench.measures.query_speed import SpeedRow
    from dicedesign.bench.reference.speed_cases import Case

__all__ = ["add_parser"]

NAME_WIDTH = 28

WIDTHS = (9, 9, 7, 10, 10, 7, 6, 6, 10, 7, 6, 6, 10, 7)

PART_WIDTH = 36

KEY = """\
hull: scipy.spatial.ConvexHull of the same points. query: from points in memory to probabilities.
gradient: dice energy with the paper's three regularizers and its gradient. Both compute the hull.
C++: ratio to Qhull of the paper's public implementation, measured earlier on another machine, where
it is known; that of the bunny with 35,000 vertices. trimesh: its stable poses of the hull."""

FOLDER_KEY = """\
running: once all jobs are at work. a job: files per second for each job, beside a single job's."""

COLD_STARTS = 5

QUICK_COLD_STARTS = 2

QUICK_SIZE = 1000
"""The most points in the figure of a short run."""


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "speed",
        help="time of a query and of a gradient, as multiples of a convex hull's",
        description="Measure how long a query and the gradient of a design's energy take, as "
        "multiples of scipy.spatial.ConvexHull on the same points. Seconds of the first two tables "
        "are processor time of all threads together, of which there is one: medians of at least 20 "
        "turns, in random order. Those of whole programs are on the wall.",
    )
    parser.add_argument(
        "meshes", nargs="*", type=Path, metavar="MESH", help="STL, OBJ, PLY, OFF, GLB, XYZ, ..."
    )
    parser.add_argument(
        "--quick", action="store_true", help="small cases and few turns, in some seconds"
    )
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="FILE.png",
        help="draw run times over 10 to 1,000,000 points on a sphere (10 to 1,000 with --quick)",
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    import torch

    from dicedesign.bench.machine import machine_description
    from dicedesign.bench.measures.other_methods import TrimeshTimer

    # The only library here that would take more threads than one.
    torch.set_num_threads(1)
    require_figure_folder(options.figure)
    cases = _cases(options)
    record: dict[str, Any] = machine_description("numpy", "scipy", "torch", "trimesh")
    with progress_bar("rows") as bar, TrimeshTimer() as time_trimesh:
        report = _Report(bar, show=not options.json)
        record["rows"] = _time_cases(report, cases, options.quick, time_trimesh)
        record["parts"] = _time_parts(report, options.quick)
        record |= _time_programs(report, options.quick)
        if options.figure is not None:
            record["growth"] = _draw_growth(report, options, record, time_trimesh)
    if options.json:
        print(json_text(record))
    if options.figure is not None:
        print(f"wrote {options.figure}", file=sys.stderr if options.json else sys.stdout)
    return 0


class _Report:
    """Rows as they come, above a bar that says what is being measured."""

    def __init__(self, bar: Any, *, show: bool) -> None:
        self._bar = bar
        self._show = show

    def begin(self, name: str) -> None:
        """What is measured from now on."""
        self._bar.set_description_str(name)

    def row(self, text: str) -> None:
        """One more row of a table."""
        self.advance()
        self.text(text)

    def advance(self) -> None:
        """One more measurement."""
        self._bar.update()

    def text(self, text: str) -> None:
        """Lines of a table that are no row, unless JSON is asked for."""
        if self._show:
            print_row(text)


def _cases(options: argparse.Namespace) -> list[Case]:
    """All point sets; a file that is no mesh, or spans no solid, is said at once."""
    from dicedesign.bench.reference.speed_cases import built_in_cases, mesh_case
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.meshes.reading import read_body

    cases = list(built_in_cases(quick=options.quick))
    for path in options.meshes:
        body = read_body(path)
        convex_hull(body.points)
        cases.append(mesh_case(path.name, path.stem, body))
    return cases


def _time_cases(
    report: _Report, cases: Sequence[Case], quick: bool, time_trimesh: Any
) -> list[dict[str, Any]]:
    from dicedesign.bench.measures.query_speed import speed_row
    from dicedesign.bench.speed import FULL, QUICK

    rows = []
    report.text(
        _line(
            "case",
            "points",
            "corners",
            "rests",
            "hull ms",
            "query ms",
            "ratio",
            "goal",
            "C++",
            "grad. ms",
            "ratio",
            "goal",
            "C++",
            "trimesh",
            "ratio",
        )
    )
    for case in cases:
        report.begin(case.name)
        row = speed_row(case, QUICK if quick else FULL, time_trimesh)
        report.row(_case_row(row))
        rows.append(row.plain())
    report.text(f"\n{KEY}\n")
    return rows


def _time_parts(report: _Report, quick: bool) -> list[dict[str, Any]]:
    from dicedesign.bench.measures.design_steps import speed_parts
    from dicedesign.bench.speed import FULL, QUICK

    report.begin("parts of a design")
    report.text(_part_line("part of a design", "body", "ms", "hulls"))
    rows = []
    for part in speed_parts(QUICK if quick else FULL):
        report.row(_part_row(part))
        rows.append(part.plain())
    return rows


def _time_programs(report: _Report, quick: bool) -> dict[str, Any]:
    """Whole programs: their start, and unless it is to be quick their memory and throughput."""
    from dicedesign.bench.measures.programs import cold_starts, peak_memory, throughput

    report.begin("start of programs")
    starts = cold_starts(QUICK_COLD_STARTS if quick else COLD_STARTS)
    report.text(f"\n{'whole programs, on the wall':<{PART_WIDTH}}{'s':>9}")
    for program, seconds in starts.items():
        report.row(f"{program:<{PART_WIDTH}}{seconds:>9.3f}")
    record: dict[str, Any] = {"cold_start_seconds": starts}
    if quick:
        return record
    report.begin("memory")
    memory = peak_memory()
    report.row(_memory_text(memory))
    rows: list[Throughput] = []
    report.text(
        _folder_line("dicedesign rest FOLDER", "s", "files/s", "a job", "running/s", "a job")
    )
    for row in throughput(on_jobs=lambda jobs: report.begin(f"folder by {jobs} jobs")):
        rows.append(row)
        report.row(_folder_row(row, rows[0]))
    report.text(FOLDER_KEY)
    return {
        **record,
        "memory": None if memory is None else memory.plain(),
        "throughput": [row.plain(rows[0]) for row in rows],
    }


def _draw_growth(
    report: _Report, options: argparse.Namespace, described: dict[str, Any], time_trimesh: Any
) -> list[dict[str, Any]]:
    from dicedesign.bench.speed_growth import SIZES, growth_figure, growth_rows
    from dicedesign.report.charts.png import png_bytes
    from dicedesign.runtime.files import atomic_write

    sizes = [size for size in SIZES if not options.quick or size <= QUICK_SIZE]
    rows = []
    for row in growth_rows(
        sizes, time_trimesh, lambda size: report.begin(f"figure: {size:,} points")
    ):
        report.advance()
        rows.append(row)
    atomic_write(options.figure, png_bytes(growth_figure(rows, described)))
    return [row.plain() for row in rows]


def _case_row(row: SpeedRow) -> str:
    line = _line(
        row.name,
        str(row.points),
        str(row.corners),
        str(row.rests),
        _milliseconds(row.hull_seconds),
        _milliseconds(row.query_seconds),
        _ratio(row.ratios.query),
        _known(row.goal.query),
        _known(row.cpp.query),
        _milliseconds(row.gradient_seconds),
        _ratio(row.ratios.gradient),
        _known(row.goal.gradient),
        _known(row.cpp.gradient),
        _milliseconds(row.trimesh_seconds),
        _ratio(row.trimesh_ratio),
    )
    return f"{line}  {row.note}".rstrip()


def _part_row(part: Part) -> str:
    return _part_line(part.part, part.body, _milliseconds(part.seconds), _ratio(part.ratio))


def _memory_text(memory: Memory | None) -> str:
    if memory is None:
        return "peak memory: not told by this system"
    return (
        f"\npeak memory with {memory.points:,} points on a sphere: {memory.before:.0f} MB with "
        f"points and libraries, {memory.hull:.0f} MB with scipy's hull, {memory.query:.0f} MB with "
        "the query\n"
    )


def _folder_row(row: Throughput, alone: Throughput) -> str:
    plain = row.plain(alone)
    return _folder_line(
        f"{row.files} meshes, {row.jobs} jobs",
        f"{row.seconds:.2f}",
        f"{plain['files_per_second']:.0f}",
        f"{100.0 * plain['efficiency']:.0f} %",
        f"{plain['running_files_per_second']:.0f}",
        f"{100.0 * plain['running_efficiency']:.0f} %",
    )


def _line(name: str, *cells: str) -> str:
    values = "".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=True))
    return f"{name:<{NAME_WIDTH}}{values}"


def _part_line(part: str, body: str, *cells: str) -> str:
    return f"{part:<{PART_WIDTH}}{body:<{NAME_WIDTH}}" + "".join(f"{cell:>9}" for cell in cells)


def _folder_line(name: str, *cells: str) -> str:
    return f"{name:<{PART_WIDTH}}" + "".join(f"{cell:>11}" for cell in cells)


def _milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1e3 * seconds:.4g}"


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _known(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"
