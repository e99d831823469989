"""geometric probabilities of many shapes and simulated throws, as in the paper's figure 10

Cut boxes, spheres and models into pieces by planes and Voronoi cells, throw each piece onto two
tables, without momentum (carpet) and as in a board game, in the package's own simulator and in
others that are installed, and compare all probabilities with each other: W, the Wasserstein
distance on the sphere in radians, and TV, total variation, as means over the shapes; the floor is
the mean of two right predictions at these numbers of drops, as if the drops were independent. r is
Pearson's correlation of W with the asymmetry rho of equation 20. The package's own simulator throws
each shape from the paper's 1,212 directions. The picture has W against rho.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import combinations, islice
from pathlib import Path
from typing import Any

import numpy as np
from manifold3d import Manifold
from scipy.spatial import ConvexHull, SphericalVoronoi
from scipy.spatial.distance import pdist
from scipy.stats import pearsonr

from benchmarks.frame import Report, panels, processes
from dicedesign import (
    Body,
    InputError,
    Table,
    load_table,
    read_body,
    rest_poses,
    rigid_body,
)
from dicedesign.concave.shapes import shape
from dicedesign.extensions import ENGINES, Engine, RigidBody
from dicedesign.geometry.meshes.body import body_of
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import asymmetry
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.distances import total_variation
from dicedesign.throws.rigid_body import release_states
from examples.mujoco_engine import MUJOCO
from tests.common.bumpy import gear

TABLES = ("carpet", "board-game")
"""Without and with momentum."""

GEOMETRIC = "geometric"

SUBDIVISIONS = 11
"""Parts of each edge of the icosahedron whose 1,212 vertices are the paper's directions: 10 times
their square plus 2. Source: section 4.1."""

LEAST_THICKNESS = 0.02
"""Volume of a piece over the cube of the largest distance between two of its points, below which it
is a sliver and left out."""

BOXES = ((1.0, 1.0, 1.0), (1.0, 1.0, 3.0), (1.0, 2.0, 3.0), (1.0, 3.0, 3.0))

SEGMENTS = (12, 20, 28)
"""Edges around the equator of each sphere."""

PLANES, SITES = (1, 2, 3), (4, 8, 16)
"""How many planes a whole is cut by, and into how many Voronoi cells, each number once."""

PIECES = 2
"""Most pieces that are taken of a cut."""

PUBLISHED = {
    "OT_us_IPC": ("geometric vs Rigid IPC", 0.47, 1e-20),
    "OT_us_Bullet": ("geometric vs Bullet", 0.13, 5e-4),
    "OT_IPC_Bullet": ("Bullet vs Rigid IPC", 0.07, 0.06),
}
"""Columns of the table that the paper's authors published, and Pearson's coefficients with their
p-values as the paper's text gives them."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is thrown, and how often."""
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH", help="closed, to cut")
    parser.add_argument(
        "--drops", type=int, metavar="N", help="in other simulators (default: 202; quick: 40)"
    )
    parser.add_argument(
        "--distances", type=Path, metavar="CSV", help="distances that the paper's authors published"
    )


def run(options: argparse.Namespace, report: Report) -> bool:
    """All shapes, then the summary."""
    engines = find_engines(report)
    given = {path.name: make_surface(read_body(path))[0] for path in options.meshes}
    own = {} if options.quick else {name: shape(name) for name in ("duck", "kitten", "knot")}
    shapes = cut_shapes(given or (own and {**own, "gear": gear()}))[:: 13 if options.quick else 1]
    drops = options.drops or (40 if options.quick else 202)
    row = report.table(
        "shapes",
        "shape 44s | rests 5d | rho 6.3f | table 10s | models 22s | W 6.3f | floor 6.3f | TV 6.3f",
    )
    draws = 6 if options.quick else 16
    places: dict[tuple[str, str], list[Floats]] = {}
    with processes(options.jobs) as workers:
        tasks = [(shape, k, engines, drops, draws) for k, shape in enumerate(shapes)]
        for shape, (rests, compared) in zip(shapes, workers.map(compare_shape, tasks), strict=True):
            for table, models, distances in compared:
                row(shape.name, rests, distances[0], table, models, *distances[1:4])
                places.setdefault((table, models), []).append(distances)
    summarize(places, report)
    published = {} if options.distances is None else read_published(options.distances)
    row = report.table(
        "paper",
        "the paper 24s | printed r 6.2f | p 8.1g | its table: r 6.2f | its p 8.1g",
    )
    for column, (models, coefficient, p_value) in PUBLISHED.items():
        again: tuple[float | None, float | None] = (None, None)
        if published:
            correlation = pearsonr(published["weight_ratio"], published[column])
            again = float(correlation.statistic), float(correlation.pvalue)
        row(models, coefficient, p_value, *again)
    if options.out is not None:
        report.figure = draw(places, published)
    return True


def find_engines(report: Report) -> list[Engine]:
    """Engines that can throw here. Raises InputError where none can."""
    engines = []
    for engine in (*ENGINES, MUJOCO):
        try:
            engine.require()
            engines.append(engine)
        except InputError as error:
            report.line(f"left out: {error}")
    if not engines:
        raise InputError(
            "engines: expected a simulator, got none; install the package where there is a C++ "
            "compiler, or pip install mujoco"
        )
    return engines


def cut_shapes(models: Mapping[str, Surface], seed: int = 0) -> list[Body]:
    """Pieces of four boxes, three spheres and the models, as if they had been broken.

    Each whole is cut by 1, 2 and 3 random planes and into 4, 8 and 16 Voronoi cells of random
    sites. Of each cut the first two pieces are taken that are no slivers, of a piece that falls
    apart its largest part: 12 shapes of each whole, unless slivers are in the way.
    """
    wholes = {f"box {a:g}:{b:g}:{c:g}": Manifold.cube((a, b, c), True) for a, b, c in BOXES}
    spheres = [Manifold.sphere(1.0, segments) for segments in SEGMENTS]
    wholes |= {f"sphere of {whole.num_vert()} points": whole for whole in spheres}
    wholes |= {name: solid(one) for name, one in models.items()}
    return [
        body
        for number, (name, whole) in enumerate(wholes.items())
        for cut, pieces in cuts(whole, np.random.default_rng([seed, number]))
        for body in thick_pieces(f"{name}, {cut}", pieces)
    ]


def cuts(whole: Manifold, rng: np.random.Generator) -> Iterator[tuple[str, list[Manifold]]]:
    """All pieces of each cut, with what the cut is called."""
    corners = mesh_of(whole).points
    for count in PLANES:
        normals = unit_vectors(rng.normal(size=(count, 3)))
        along = corners @ normals.T
        low, high = along.min(axis=0), along.max(axis=0)
        # A quarter to three quarters of the extent along each normal lie behind the plane.
        offsets = low + rng.uniform(0.25, 0.75, size=count) * (high - low)
        pieces = [whole]
        for normal, offset in zip(normals.tolist(), offsets.tolist(), strict=True):
            halves = [half for piece in pieces for half in piece.split_by_plane(normal, offset)]
            pieces = [half for half in halves if not half.is_empty()]
        yield ("1 plane" if count == 1 else f"{count} planes"), pieces
    for count in SITES:
        box = np.array(whole.bounding_box())
        sites = rng.uniform(box[:3], box[3:], size=(count, 3))
        cells = [voronoi_cell(whole, site, np.delete(sites, k, 0)) for k, site in enumerate(sites)]
        yield f"{count} Voronoi cells", [cell for cell in cells if not cell.is_empty()]


def voronoi_cell(whole: Manifold, site: Floats, others: Floats) -> Manifold:
    """What of a solid is nearer to a site (3,) than to any of the others (m, 3)."""
    normals = unit_vectors(site - others)
    offsets = 0.5 * (normals * (site + others)).sum(-1)
    for normal, offset in zip(normals.tolist(), offsets.tolist(), strict=True):
        whole = whole.trim_by_plane(normal, offset)
    return whole


def thick_pieces(name: str, pieces: Iterable[Manifold]) -> Iterator[Body]:
    """The first pieces that are no slivers."""
    parts = (max(piece.decompose(), key=lambda part: part.volume()) for piece in pieces)
    thick = (
        part
        for part in parts
        if part.volume() >= LEAST_THICKNESS * float(pdist(mesh_of(part.hull()).points).max()) ** 3
    )
    for number, part in enumerate(islice(thick, PIECES), 1):
        yield body_of(mesh_of(part), name=f"{name}, piece {number}")


def compare_shape(
    task: tuple[Body, int, list[Engine], int, int],
) -> tuple[int, list[tuple[str, str, Floats]]]:
    """How many rests, and the table, two models, and asymmetry, W, its floor, TV and its floor (5,)
    of what each two models say on each table.

    task: the shape, its number, which seeds its drops, the engines, drops in others than the
    package's own, and draws for the noise floors.
    """
    body, number, engines, drops, draws = task
    poses = rest_poses(body)
    thrown = rigid_body(body, poses)
    comparisons = []
    for place, table in enumerate(TABLES):
        # Probabilities, and the drops that each was counted in, 0 for exact ones.
        said: dict[str, tuple[Floats, int]] = {GEOMETRIC: (poses.probabilities, 0)}
        for order, engine in enumerate(engines):
            rng = np.random.default_rng([number, place, order])
            counted = throw_shape(thrown, load_table(table), engine, drops, rng)
            if counted is not None:
                said[engine.name] = counted
        rng = np.random.default_rng([number, place])
        for pair in combinations(said, 2):
            distances = compare(poses.normals, *said[pair[0]], *said[pair[1]], draws, rng)
            comparisons.append((table, " vs ".join(pair), np.array([asymmetry(poses), *distances])))
    return len(poses.probabilities), comparisons


def throw_shape(
    body: RigidBody, table: Table, engine: Engine, drops: int, rng: np.random.Generator
) -> tuple[Floats, int] | None:
    """Frequencies (k,) of a body's rests, and the number of independent drops that scatter as much;
    None if no drop came to rest.

    The package's own simulator throws from each of the paper's directions, with the area of its
    cell as weight, others from random ones.

    Source: Kish, Survey Sampling, 1965, section 11.7.
    """
    weights, down = np.ones(drops), None
    if engine.name == "native":
        directions, weights = up_directions()
        down = -directions
    states = release_states(body, table, len(weights), rng, down)
    rests = engine.throw_states(body, table, states)
    landed = rests >= 0
    if not landed.any():
        return None
    weights = weights[landed]
    sums = np.bincount(rests[landed], weights, len(body.rest_heights))
    return sums / weights.sum(), round(weights.sum() ** 2 / (weights**2).sum())


@cache
def up_directions() -> tuple[Floats, Floats]:
    """The paper's up directions (1212, 3), unit vectors, and the areas (1212,) of their Voronoi
    cells."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    corners = np.array([(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    corners = np.concatenate([np.roll(corners, shift, axis=1) for shift in range(3)])
    parts = np.arange(SUBDIVISIONS + 1)
    i, j = (grid.ravel() for grid in np.meshgrid(parts, parts, indexing="ij"))
    inside = i + j <= SUBDIVISIONS
    weights = np.stack([i, j, SUBDIVISIONS - i - j], axis=1)[inside] / SUBDIVISIONS
    points = unit_vectors((weights @ corners[ConvexHull(corners).simplices]).reshape(-1, 3))
    _, first = np.unique(points.round(9), axis=0, return_index=True)
    directions = points[np.sort(first)]
    return directions, SphericalVoronoi(directions).calculate_areas()


def wasserstein_distance(normals: Floats, first: Floats, second: Floats) -> float:
    """Smallest mean angle in radians, 0 to pi, by which probability must turn to make one
    distribution (k,) of rests with normals (k, 3) into another. Source: section 4.1."""
    # Imported late: it loads torch.
    import ot

    angles = angle_between(normals[:, None], normals)
    return float(ot.emd2(first / first.sum(), second / second.sum(), angles))


def compare(
    normals: Floats,
    first: Floats,
    first_drops: int,
    second: Floats,
    second_drops: int,
    draws: int,
    rng: np.random.Generator,
) -> tuple[float, ...]:
    """Distances of two predictions (k,) of rests with normals (k, 3), each counted in drops or
    exact, and the means of two right ones after each."""
    right = first
    if first_drops and second_drops:
        right = (first_drops * first + second_drops * second) / (first_drops + second_drops)

    def distances(one: Floats, other: Floats) -> tuple[float, float]:
        return wasserstein_distance(normals, one, other), total_variation(one, other)

    def drawn(drops: int) -> Floats:
        return rng.multinomial(drops, right / right.sum()) / drops if drops else right

    floors = [distances(drawn(first_drops), drawn(second_drops)) for _ in range(draws)]
    (wasserstein, variation), (one, other) = distances(first, second), np.mean(floors, axis=0)
    return wasserstein, one, variation, other


def summarize(places: dict[tuple[str, str], list[Floats]], report: Report) -> None:
    """Means over the shapes, and correlations with the asymmetry."""
    row = report.table(
        "summary",
        "table 10s | models 22s | shapes 6d | W 6.3f | W floor 6.3f | TV 6.3f | "
        "TV floor 6.3f | r 6.2f | from 6.2f | to 6.2f | p 8.1g",
    )
    for (table, models), rows in places.items():
        rho, *distances = np.transpose(rows)
        correlated = (None, None, None, None)
        if len(rows) > 3:
            pearson = pearsonr(rho, distances[0])
            correlated = (pearson.statistic, *pearson.confidence_interval(), pearson.pvalue)
        row(table, models, len(rows), *np.mean(distances, axis=1).tolist(), *correlated)


def read_published(path: Path) -> dict[str, Floats]:
    """Columns of the table that the paper's authors published."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


def draw(places: dict[tuple[str, str], list[Floats]], published: dict[str, Floats]) -> Any:
    """W of each two models against the asymmetry, a panel for each table, and one for the paper's
    own shapes where they are given."""
    figure, axes = panels(len(TABLES) + bool(published), len(TABLES) + bool(published))
    for axis, table in zip(axes, TABLES, strict=False):
        for (on, models), rows in places.items():
            if on == table:
                axis.scatter(*np.transpose(rows)[:2], s=9, label=models)
        axis.set(title=f"table {table}")
    if published:
        for column, (models, _, _) in PUBLISHED.items():
            axes[-1].scatter(published["weight_ratio"], published[column], s=3, label=models)
        axes[-1].set(title=f"the paper's {len(published['weight_ratio'])} shapes")
    for axis in axes:
        axis.set(xlabel="asymmetry (eq. 20)", ylabel="Wasserstein distance (rad)")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    return figure
