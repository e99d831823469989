"""looks of dice without symmetry and of those chosen by default, over 60 targets

Design a die for each target twice: without symmetry, from the first shape that leads there, and as
by default, the most handsome of many. The measure of looks is that of docs/designers.md. The
picture has both dice of each target. Exits 1 where a die misses its probabilities, or the chosen
one is less handsome by more than a tenth.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from itertools import repeat
from typing import Any

import numpy as np

from benchmarks.frame import Report, make_die, panels, processes
from dicedesign import parse_recipe
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.looks import rate_looks
from dicedesign.recipe.reading import parse_target
from dicedesign.report.raster import Camera, frame_cameras
from dicedesign.report.renderer import RenderMesh, render

GIVEN = {
    **{f"d{sides}": f"d{sides}" for sides in range(2, 21)},
    **{text: text for text in ("1:1:1", "9:9:2", "49:49:2", "2:1:1")},
    **{text: text for text in ("2d4", "2d6", "3d6", "4dF")},
    **{text: text for text in ("1:2:3", "1:2:3:4", "5:1:1:1:1:1")},
}

SEEDS = range(1, 31)
"""Of random targets of 2 to 12 outcomes, the smallest at least 0.02."""

LEAST = 0.02

WORSE = 0.9
"""Least measure of the chosen die over that of the die without symmetry."""

PIXELS = 150


@dataclass(frozen=True)
class Designed:
    """A die, its measure and qualities, its largest |p - q| in double precision, and seconds."""

    hull: ConvexHull
    measure: float
    error: float
    symmetry: str
    seconds: float


def run(options: argparse.Namespace, report: Report) -> bool:
    """A row for each target, then the medians."""
    targets = GIVEN | {f"random {seed}": random_target(seed) for seed in SEEDS}
    names = list(targets)[:: 10 if options.quick else 1]
    row = report.table(
        "targets",
        "target 14s | without 8.4f | s 6.2f | chosen 8.4f | s to choose 6.2f | symmetry 8s | "
        "max |p - q| 8.1e",
    )
    texts = [targets[name] for name in names]
    with processes(options.jobs) as workers:
        plain = workers.map(design, texts, repeat("none"))
        pairs = list(zip(plain, workers.map(design, texts, repeat("auto")), strict=True))
    for name, (before, after) in zip(names, pairs, strict=True):
        numbers = (before.measure, before.seconds, after.measure, after.seconds)
        row(name, *numbers, after.symmetry, max(before.error, after.error))
    row = report.table(
        "medians",
        "dice 8d | without 8.3f | chosen 8.3f | s 6.2f | s to choose 6.2f | 90 % s 6.2f | "
        "least ratio 6.2f | max |p - q| 8.1e",
    )
    measures = np.array([(before.measure, after.measure) for before, after in pairs])
    seconds = np.array([(before.seconds, after.seconds) for before, after in pairs])
    worst = max(max(before.error, after.error) for before, after in pairs)
    ratio = float((measures[:, 1] / measures[:, 0]).min())
    medians = (*np.median(measures, axis=0), *np.median(seconds, axis=0))
    row(len(pairs), *medians, np.quantile(seconds[:, 1], 0.9), ratio, worst)
    if options.out is not None:
        report.figure = draw(names, pairs)
    return ratio >= WORSE and worst <= 1e-12


def random_target(seed: int) -> str:
    """Probabilities as typed."""
    rng = np.random.default_rng(seed)
    outcomes = int(rng.integers(2, 13))
    shares = LEAST + (1.0 - LEAST * outcomes) * rng.dirichlet(np.ones(outcomes))
    return ", ".join(map(repr, shares.tolist()))


def design(text: str, symmetry: str) -> Designed:
    """The die of a target as typed, without labels."""
    entries = {"name": "die", "target": parse_target(text), "engrave": False, "symmetry": symmetry}
    # torch takes longer at its first use in a process.
    make_die(parse_recipe({"name": "first", "target": {"fair": 4}, "engrave": False}), "design")
    start = time.perf_counter()
    work = make_die(parse_recipe(entries))
    seconds = time.perf_counter() - start
    looks = rate_looks(work.die.hull, work.die.directions)
    name = work.die.symmetry or "none"
    return Designed(work.die.hull, looks.measure, work.design_error, name, seconds)


def draw(names: list[str], pairs: list[tuple[Designed, Designed]]) -> Any:
    """Both dice of each target, with their measures."""
    figure, axes = panels(len(pairs), 6, (3.2, 1.9))
    for axis, name, dice in zip(axes, names, pairs, strict=True):
        pictures = []
        for die in dice:
            points = die.hull.vertices - die.hull.centroid
            camera = Camera(np.array([0.5, -0.7, 0.5]), np.array([0.0, 0.0, 1.0]))
            (framed,) = frame_cameras([camera], [points])
            pictures.append(
                render(RenderMesh(points, die.hull.triangles, smooth=False), framed, PIXELS)
            )
        axis.imshow(np.concatenate(pictures, axis=1))
        axis.set_title(f"{name}: {dice[0].measure:.2f}, {dice[1].measure:.2f}", fontsize=8)
        axis.axis("off")
    return figure
