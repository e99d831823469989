"""`dicedesign bench table`: the geometric model against simulated throws of many shapes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_json_option,
    json_text,
    print_row,
    progress_bar,
    require_figure_folder,
)
from dicedesign.cli.options import add_worker_options, check_worker_options, workers_of
from dicedesign.errors import InputError
from dicedesign.runtime.workers import Workers

if TYPE_CHECKING:
    from dicedesign.bench.measures.engine_speed import EngineSpeed, StepHalving
    from dicedesign.bench.measures.simulator_odds import Extent, ShapeOdds
    from dicedesign.bench.simulators import EngineTotals, PublishedCorrelation, Summary
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.geometry.surfaces.surface import Surface
    from dicedesign.throws.statistics.odds_comparison import Distance

__all__ = ["add_parser"]

NAME_WIDTH = 48

MODELS_WIDTH = 28

DISTANCE_WIDTH = 18

SUMMARY_WIDTHS = (8, 14, 8, 14, 8)

KEY = """\
W: Wasserstein distance on the sphere, in radians, ± the sampling error. TV: total variation. Means
over the shapes. floor: the mean distance of two right predictions at these numbers of drops, as if
the drops were independent; the paper's directions, spread evenly, scatter less. r: Pearson's
correlation of W with the asymmetry rho of equation 20, with its 95 % interval."""


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "table",
        help="geometric odds of many shapes against simulated throws, as in the paper's figure 10",
        description="Cut boxes, spheres and models into pieces by planes and Voronoi cells, throw "
        "each piece onto two tables, without momentum and as in a board game, in the package's own "
        "simulator, MuJoCo and Bullet, and compare all odds with each other. The package's own "
        "throws each shape from the paper's 1,212 directions, weighted by area. Before that, the "
        "throughput of each simulator, and what half the time step changes. Simulators that are "
        "not installed are left out. Seconds are processor time.",
    )
    parser.add_argument(
        "models",
        nargs="*",
        type=Path,
        metavar="MODEL",
        help="closed mesh to cut: STL, OBJ, PLY, OFF, GLB, ... (default: surfaces that the package "
        "builds itself)",
    )
    parser.add_argument(
        "--distances",
        type=Path,
        metavar="FILE.csv",
        help="the table of distances that the paper's authors published, to show beside",
    )
    parser.add_argument(
        "--drops",
        type=int,
        metavar="N",
        help="of each shape on each table in MuJoCo and in Bullet; from the paper's directions if "
        "a multiple of 1212, else from random ones (default: 202, or 40 with --quick)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="few shapes and few drops, in less than a minute"
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE.png", help="draw W against rho on each table"
    )
    add_worker_options(parser, "shapes at a time (default: one for each core)")
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    from dicedesign.bench.machine import machine_description
    from dicedesign.bench.measures.simulator_odds import installed_engines, table_shapes
    from dicedesign.bench.reference.published_distances import read_published_distances
    from dicedesign.bench.simulators import (
        engine_totals,
        published_correlations,
        shape_record,
        summaries,
        table_figure,
    )

    check_worker_options(options)
    require_figure_folder(options.figure)
    extent = _extent(options)
    published = None if options.distances is None else read_published_distances(options.distances)
    bodies = table_shapes(_surfaces(options.models), extent)
    engines, notes = installed_engines()
    for note in notes:
        print(f"note: left out: {note}", file=sys.stderr)
    speeds = _measure_speeds(bodies, engines, extent, show=not options.json)
    with workers_of(options, "shapes", len(bodies)) as workers:
        halving = _halve_step(engines, extent, workers.executor, show=not options.json)
        shapes = _compare(bodies, engines, extent, workers, show=not options.json)
    totals, rows = list(engine_totals(shapes)), list(summaries(shapes))
    paper = published_correlations(published)
    if options.json:
        record = {
            **machine_description("numpy", "scipy", "mujoco", "pybullet"),
            **asdict(extent),
            "left_out": notes,
            "throughput": [
                {**asdict(speed), "drops_per_second": speed.drops_per_second} for speed in speeds
            ],
            "half_step": None if halving is None else asdict(halving),
            "engines": [asdict(total) for total in totals],
            "summaries": [asdict(row) for row in rows],
            "paper": [asdict(row) for row in paper],
            "shapes": [shape_record(shape) for shape in shapes],
        }
        print(json_text(record))
    else:
        _print_totals(totals)
        _print_summaries(rows, paper)
    if options.figure is not None:
        from dicedesign.report.charts.png import png_bytes
        from dicedesign.runtime.files import atomic_write

        figure = table_figure(shapes, published, _drops_of(shapes[0]))
        atomic_write(options.figure, png_bytes(figure))
        print(f"wrote {options.figure}", file=sys.stderr if options.json else sys.stdout)
    return 0


def _extent(options: argparse.Namespace) -> Extent:
    from dicedesign.bench.measures.simulator_odds import FULL, QUICK

    extent = QUICK if options.quick else FULL
    if options.drops is None:
        return extent
    if options.drops < 1:
        raise InputError(f"--drops: expected a whole number above 0, got {options.drops}; raise it")
    return replace(extent, drops=options.drops)


def _surfaces(paths: Sequence[Path]) -> dict[str, Surface]:
    """The models in files, named without their folders."""
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.geometry.surfaces.closed_surface import make_surface

    return {path.name: make_surface(read_body(path))[0] for path in paths}


def _measure_speeds(
    bodies: Sequence[Body], engines: Sequence[str], extent: Extent, *, show: bool
) -> list[EngineSpeed]:
    """Of a die of 11 facets and of the shape whose hull has the most corners."""
    from dicedesign.bench.measures.engine_speed import GOAL, SPEED_TABLE, die_of_11, speeds
    from dicedesign.bench.measures.simulator_odds import ENGINE_NAMES
    from dicedesign.geometry.hulls.hull import convex_hull

    densest = max(bodies, key=lambda body: len(convex_hull(body.points).vertices))
    found = []
    with progress_bar("throughputs") as bar:
        for speed in speeds([die_of_11(), densest], engines, extent.speed_seconds):
            bar.update()
            found.append(speed)
    if show:
        names = "".join(f"{ENGINE_NAMES[engine]:>9}" for engine in engines)
        print_row(
            f"drops a second on one core, onto {SPEED_TABLE} (goal: {GOAL:g} for a die of 11 "
            f"facets)\n{'':<{NAME_WIDTH}}{'facets':>8}{'corners':>9}{names}"
        )
        for body, group in groupby(found, lambda speed: (speed.body, speed.facets, speed.vertices)):
            cells = "".join(f"{speed.drops_per_second:>9.0f}" for speed in group)
            print_row(f"{body[0]:<{NAME_WIDTH}}{body[1]:>8}{body[2]:>9}{cells}")
    return found


def _halve_step(
    engines: Sequence[str], extent: Extent, executor: Executor, *, show: bool
) -> StepHalving | None:
    """What half the step changes in the package's own simulator, if it can throw here."""
    from dicedesign.bench.measures.engine_speed import die_of_11, halve_step

    if "native" not in engines:
        return None
    halving = halve_step(die_of_11(), extent.halving_drops, executor)
    if show:
        changed = halving.comparison.total_variation
        print_row(
            f"half the time step, {halving.drops} drops of the die at each: total variation "
            f"{_measured(changed)}, {changed.noise_floor:.3f} for equal odds; chi-square p = "
            f"{halving.p_value:.2g}\n"
        )
    return halving


def _compare(
    bodies: Sequence[Body],
    engines: Sequence[str],
    extent: Extent,
    workers: Workers,
    *,
    show: bool,
) -> list[ShapeOdds]:
    from dicedesign.bench.measures.simulator_odds import compare_shapes

    shapes: list[ShapeOdds] = []
    for shape in compare_shapes(bodies, engines, extent, workers.executor):
        workers.advance(1)
        if show:
            if not shapes:
                print_row(_shape_heading(shape))
            print_row(_shape_rows(shape))
        shapes.append(shape)
    return shapes


def _short(models: tuple[str, str]) -> str:
    """Two models' names in a narrow column."""
    return "-".join(name.split()[0] for name in models)


def _shape_heading(shape: ShapeOdds) -> str:
    """Of the first shape, from whose tables the columns are taken."""
    from dicedesign.bench.measures.simulator_odds import ENGINE_NAMES

    table = next(iter(shape.tables.values()))
    names = "".join(f"{_short(models):>{DISTANCE_WIDTH}}" for models in table.comparisons)
    lost = ", ".join(ENGINE_NAMES[engine] for engine in table.throws)
    return f"{'W of each shape':<{MODELS_WIDTH}}{names}  unresolved: {lost}"


def _shape_rows(shape: ShapeOdds) -> str:
    """The shape, and a line for each table."""
    lines = [
        f"{shape.name}: {shape.vertices} corners, {shape.rests} rests, rho {shape.asymmetry:.3f}"
    ]
    for name, table in shape.tables.items():
        cells = "".join(
            f"{_measured(found.wasserstein):>{DISTANCE_WIDTH}}"
            for found in table.comparisons.values()
        )
        lost = ", ".join(str(throws.unresolved) for throws in table.throws.values())
        lines.append(f"  {name:<{MODELS_WIDTH - 2}}{cells}  {lost}")
    return "\n".join(lines)


def _measured(distance: Distance) -> str:
    return f"{distance.value:.3f}±{distance.error:.3f}"


def _drops_of(shape: ShapeOdds) -> str:
    from dicedesign.bench.measures.simulator_odds import ENGINE_NAMES

    throws = next(iter(shape.tables.values())).throws
    return ", ".join(f"{ENGINE_NAMES[engine]} {t.drops}" for engine, t in throws.items())


def _print_totals(totals: Sequence[EngineTotals]) -> None:
    from dicedesign.bench.measures.simulator_odds import ENGINE_NAMES

    print_row(
        f"\n{'table':<12}{'simulator':<12}{'drops':>9}{'unresolved':>12}{'most of a shape':>17}"
        f"{'drops a second':>16}"
    )
    for total in totals:
        print_row(
            f"{total.table:<12}{ENGINE_NAMES[total.engine]:<12}{total.drops:>9}"
            f"{total.unresolved:>12}{total.largest_share:>17.1%}"
            f"{total.drops / total.seconds:>16.0f}"
        )


def _print_summaries(rows: Sequence[Summary], paper: Sequence[PublishedCorrelation]) -> None:
    print_row(f"\n{_summary_line('', 'shapes', 'W', 'floor', 'TV', 'floor', 'r')}")
    for table, group in groupby(rows, lambda row: row.table):
        print_row(table)
        for row in group:
            print_row(
                _summary_line(
                    f"  {' vs '.join(row.models)}",
                    str(row.shapes),
                    _measured(row.wasserstein),
                    f"{row.wasserstein.noise_floor:.3f}",
                    _measured(row.total_variation),
                    f"{row.total_variation.noise_floor:.3f}",
                    str(row.correlation),
                )
            )
    print_row("the paper")
    for line in paper:
        again = line.recomputed
        rows_say = "" if again is None else f"; its {again.pairs} shapes give {again}"
        print_row(
            f"  {line.models}: printed r = {line.printed:.2f}, p = {line.printed_p_value:.1g}"
            f"{rows_say}"
        )
    print_row(f"\n{KEY}")


def _summary_line(name: str, *cells: str) -> str:
    *numbers, last = cells
    values = "".join(f"{c:>{w}}" for c, w in zip(numbers, SUMMARY_WIDTHS, strict=True))
    return f"{name:<{MODELS_WIDTH}}{values}  {last}".rstrip()
