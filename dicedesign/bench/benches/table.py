"""Geometric odds of many shapes against simulated throws, without momentum and with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, Option, meshes
from dicedesign.bench.rows import Row, plain
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.bench.measures.throws.simulator_odds import ShapeOdds
    from dicedesign.bench.reference.published_distances import PublishedDistances
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.report.charts.paper import Paper

__all__ = [
    "Extent",
    "ShapeRow",
    "table_figure",
    "table_shapes",
]

MODELS_WIDTH: Final = 28

DISTANCE_WIDTH: Final = 18

KEY: Final = """
W: Wasserstein distance on the sphere, in radians, ± the sampling error. TV: total variation. Means
over the shapes. floor: the mean distance of two right predictions at these numbers of drops, as if
the drops were independent; the paper's directions, spread evenly, scatter less. r: Pearson's
correlation of W with the asymmetry rho of equation 20, with its 95 % interval."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    every: one of so many shapes is thrown.
    drops: of each shape on each table in MuJoCo and in Bullet. The package's own simulator takes
        the paper's directions; so do they at a multiple of their number, else uniform orientations.
    draws: for each sampling error and noise floor.
    speed_seconds: of processor time for each simulator's throughput.
    halving_drops: at each of two time steps.
    models: whether the shapes include pieces of the models that the package builds.
    engines: those that are tried; those that are not installed are left out.
    """

    every: int
    drops: int
    draws: int
    speed_seconds: float
    halving_drops: int
    models: bool
    engines: tuple[str, ...] = ("native", "mujoco", "bullet")


@dataclass(frozen=True)
class ShapeRow(Row):
    """A shape, whose lines in the table are not those of a row."""

    table: ClassVar[str | None] = None
    printed: ClassVar[bool] = False

    odds: ShapeOdds


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.throws.simulator_odds import compare_shapes, installed_engines
    from dicedesign.bench.measures.throws.simulator_summary import (
        engine_totals,
        published_correlations,
        summaries,
    )
    from dicedesign.bench.reference.published_distances import read_published_distances

    extent: Extent = run.extent
    path = run.options.distances
    published = None if path is None else read_published_distances(path)
    bodies = table_shapes(run.options.meshes, extent)
    engines, notes = installed_engines(extent.engines)
    yield {"left_out": notes}
    for note in notes:
        run.note(f"left out: {note}")
    yield from _speeds(bodies, engines, extent)
    shapes: list[ShapeOdds] = []
    with run.workers("shapes", len(bodies)) as workers:
        yield from _halved_step(engines, extent, workers)
        for shape in compare_shapes(bodies, engines, extent.drops, extent.draws, workers):
            run.advance()
            if not shapes:
                yield _shape_heading(shape)
            yield _shape_lines(shape)
            yield ShapeRow(shape)
            shapes.append(shape)
    yield {"shapes": [_shape_record(shape) for shape in shapes]}
    yield ""
    yield from engine_totals(shapes)
    yield from summaries(shapes)
    paper = published_correlations(published)
    yield {"paper": paper}
    yield "\n".join(["the paper", *map(str, paper), KEY])
    return True


def table_shapes(files: Sequence[Path], extent: Extent) -> list[Body]:
    """Shapes to throw: pieces of boxes, spheres and the models in files, named without their
    folders, or those of the package.

    Raises InputError: as `cut_shapes`, or a file is no closed mesh.
    """
    from dicedesign.bench.bodies.cut_shapes import cut_shapes, made_models
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.geometry.surfaces.closed_surface import make_surface

    given = {path.name: make_surface(read_body(path))[0] for path in files}
    own = made_models() if extent.models else {}
    return cut_shapes(given or own)[:: extent.every]


def _speeds(bodies: Sequence[Body], engines: Sequence[str], extent: Extent) -> Items:
    """Of a die of 11 facets and of the shape whose hull has the most corners."""
    from dicedesign.bench.measures.throws.engine_speed import GOAL, SPEED_TABLE, die_of_11, speeds
    from dicedesign.geometry.hulls.hull import convex_hull

    densest = max(bodies, key=lambda body: len(convex_hull(body.points).vertices))
    yield (
        f"drops a second on one core, onto {SPEED_TABLE} (goal: {GOAL:g} for a die of 11 facets)"
    )
    yield from speeds([die_of_11(), densest], engines, extent.speed_seconds)
    return True


def _halved_step(engines: Sequence[str], extent: Extent, workers: Any) -> Items:
    """What half the step changes in the package's own simulator, if it can throw here."""
    from dicedesign.bench.measures.throws.engine_speed import die_of_11, halve_step
    from dicedesign.bench.measures.throws.simulator_summary import measured

    halving = None
    if "native" in engines:
        halving = halve_step(die_of_11(), extent.halving_drops, workers)
        changed = halving.comparison.total_variation
        yield (
            f"half the time step, {halving.drops} drops of the die at each: total variation "
            f"{measured(changed)}, {changed.noise_floor:.3f} for equal odds; chi-square p = "
            f"{halving.p_value:.2g}\n"
        )
    yield {"half_step": halving}
    return True


def _shape_heading(shape: ShapeOdds) -> str:
    """Of the first shape, from whose tables the columns are taken."""
    from dicedesign.bench.measures.throws.simulator_odds import ENGINE_NAMES

    table = next(iter(shape.tables.values()))
    short = ["-".join(name.split()[0] for name in models) for models in table.comparisons]
    names = "".join(f"{both:>{DISTANCE_WIDTH}}" for both in short)
    lost = ", ".join(ENGINE_NAMES[engine] for engine in table.throws)
    return f"{'W of each shape':<{MODELS_WIDTH}}{names}  unresolved: {lost}"


def _shape_lines(shape: ShapeOdds) -> str:
    """The shape, and a line for each table."""
    from dicedesign.bench.measures.throws.simulator_summary import measured

    lines = [
        f"{shape.name}: {shape.vertices} corners, {shape.rests} rests, rho {shape.asymmetry:.3f}"
    ]
    for name, table in shape.tables.items():
        cells = "".join(
            f"{measured(comparison.wasserstein):>{DISTANCE_WIDTH}}"
            for comparison in table.comparisons.values()
        )
        lost = ", ".join(str(throws.unresolved) for throws in table.throws.values())
        lines.append(f"  {name:<{MODELS_WIDTH - 2}}{cells}  {lost}")
    return "\n".join(lines)


def _shape_record(shape: ShapeOdds) -> dict[str, Any]:
    """A shape as plain data; two models that are compared are no key of JSON."""
    tables = {
        name: {
            "throws": plain(table.throws),
            "comparisons": [
                {"models": list(models), **plain(comparison)}
                for models, comparison in table.comparisons.items()
            ],
        }
        for name, table in shape.tables.items()
    }
    names = ("name", "vertices", "facets", "rests", "asymmetry")
    return {**{name: getattr(shape, name) for name in names}, "tables": tables}


def _figure(rows: Sequence[Row], run: Run) -> Paper:
    from dicedesign.bench.reference.published_distances import read_published_distances

    path = run.options.distances
    published = None if path is None else read_published_distances(path)
    return table_figure([row.odds for row in rows if isinstance(row, ShapeRow)], published)


def table_figure(shapes: Sequence[ShapeOdds], published: PublishedDistances | None) -> Paper:
    """The distances of each two models against the asymmetry of the shapes: a panel for each table,
    and one for the paper's own shapes if they are given. Shapes of which some model knows nothing
    are left out. Raises InputError: as `correlation`.

    Source: figure 10.
    """
    from dicedesign.bench.measures.throws.simulator_odds import ENGINE_NAMES
    from dicedesign.bench.measures.throws.simulator_summary import compared
    from dicedesign.report.charts.picture_grid import picture_grid
    from dicedesign.report.charts.scatter import asymmetry_scatter_figure

    panels = []
    for name, table in shapes[0].tables.items():
        models = compared(shapes, name)
        having = [s for s in shapes if s.tables[name].comparisons.keys() >= set(models)]
        drops = ", ".join(f"{ENGINE_NAMES[engine]} {t.drops}" for engine, t in table.throws.items())
        distances: dict[str, Floats] = {
            " vs ".join(both): np.array(
                [shape.tables[name].comparisons[both].wasserstein.value for shape in having]
            )
            for both in models
        }
        asymmetry = np.array([shape.asymmetry for shape in having])
        title, note = f"{len(having)} shapes, table {name}", f"drops of each shape: {drops}"
        panels.append(asymmetry_scatter_figure(asymmetry, distances, title, note))
    if published is not None:
        title = f"the paper's {len(published.asymmetry)} shapes"
        note = "as published with the paper (its figure 10)"
        panels.append(
            asymmetry_scatter_figure(published.asymmetry, published.distances, title, note)
        )
    pictures = [panel.pixels() for panel in panels]
    return picture_grid(pictures, [""] * len(pictures), len(shapes[0].tables))


BENCHES.register(
    Bench(
        name="table",
        line="geometric odds of many shapes against simulated throws, as in the paper's figure 10",
        description="Cut boxes, spheres and models into pieces by planes and Voronoi cells, throw "
        "each piece onto two tables, without momentum and as in a board game, in the package's own "
        "simulator, MuJoCo and Bullet, and compare all odds with each other. The package's own "
        "throws each shape from the paper's 1,212 directions, weighted by area. Before that, the "
        "throughput of each simulator, and what half the time step changes. Simulators that are "
        "not installed are left out. Seconds are processor time. The figure has W against rho.",
        rows=_rows,
        full=Extent(1, 202, 16, 3.0, 40_000, models=True),
        quick=Extent(13, 40, 6, 0.2, 2_000, models=False),
        amounts=(
            Amount(
                "drops",
                "N",
                "of each shape on each table in MuJoCo and in Bullet; from the paper's directions "
                "if a multiple of 1212, else from random ones",
            ),
        ),
        options=(
            meshes("closed, to cut (default: surfaces that the package builds itself)"),
            Option(
                "--distances",
                "the table of distances that the paper's authors published, to show beside",
                {"type": Path, "metavar": "FILE.csv"},
            ),
        ),
        packages=("numpy", "scipy", "mujoco", "pybullet"),
        workers="shapes at a time (default: one for each core)",
        torch=False,
        figure=_figure,
    )
)
