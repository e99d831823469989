"""the dice that `design` makes for 60 targets: thrown, set down, looked at, read

Make the die of each target as `dicedesign design` does, with report, and throw its file onto the
tables and hands of board-game. Targets are fair dice, coins, sums, skewed and random ones, and
words.

Off is the total variation of the throws from the target, chance its mean for a perfect die. Least
is how often the rarest outcome came up, over its probability. Quotient is the isoperimetric one,
stretch the diameter over the least width, label the circle in the smallest labeled face at 30 mm,
seconds are of the processor, with the report. The picture has every die.

Exits 1 where a die misses its probabilities when set down by more than 1e-7, where more than two of
ten are off by more than 0.03 when thrown or not read on top, where the median is above 0.01, or a
die is a splinter: stretched by more than 2 though its least probability is 0.02 or more.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.exact import random_target
from benchmarks.frame import Report, panels
from dicedesign import InputError, parse_recipe
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.recipe.pipeline import Work, finish, run_stages
from dicedesign.recipe.reading import parse_target
from dicedesign.report.raster import Camera, frame_cameras
from dicedesign.report.renderer import RenderMesh, render
from dicedesign.results.folder import open_results_folder
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.distances import measure_variation
from dicedesign.throws.simulation import DieOnTable, throwing_threads

MONTHS = "January,February,March,April,May,June,July,August,September,October,November,December"

TARGETS: tuple[tuple[str, str | None], ...] = (
    *((f"d{sides}", None) for sides in (*range(2, 25), 30)),
    *((text, None) for text in ("1:2", "3:2", "345:655", "9:1", "4:1")),
    *((text, None) for text in ("2d4", "2d6", "3d4", "2d8", "3d6", "d4+d6", "4dF", "binomial: 4")),
    *((text, None) for text in ("70%,20%,10%", "90%,5%,5%", "45%,45%,10%", "60%,25%,10%,5%")),
    *((text, None) for text in ("1/12,1/6,1/2,1/4", "31%,27%,20%,12%,10%", "50%,49%,1%")),
    ("d12", MONTHS),
    ("1/2,1/3,1/6", "heads,tails,edge"),
    ("d6", "win,win,win,draw,draw,lose"),
)
"""Targets as typed, with labels."""

RANDOM_TARGETS = 13

TABLE = "board-game"

MAX_OFF = {"median": 0.01, "eight in ten": 0.03}
"""Largest total variation of throws."""

MAX_ERROR, MAX_STRETCH, LEAST_PROBABILITY, ON_TOP = 1e-7, 2.0, 0.02, 0.8

PIXELS = 220


@dataclass(frozen=True)
class Made:
    """A die with its measures; see the bench."""

    hull: ConvexHull
    faces: int
    off: float
    chance: float
    least: float
    error: float
    quotient: float
    stretch: float
    label_mm: float
    is_on_top: bool
    size_mm: float
    seconds: float
    least_probability: float


def add_options(parser: argparse.ArgumentParser) -> None:
    """How it is thrown."""
    parser.add_argument(
        "--drops", type=int, metavar="N", help="throws of a die (default: 100000; quick: 2000)"
    )
    parser.add_argument("--engine", default="native", help="simulator (default: native)")
    parser.add_argument("--only", metavar="TEXT", help="targets whose text contains this")


def run(options: argparse.Namespace, report: Report) -> bool:
    """A row for each target, then medians."""
    targets = [*TARGETS, *((random_target(seed), None) for seed in range(1, RANDOM_TARGETS + 1))]
    names = [text for text, _ in TARGETS]
    names += [f"random {seed}" for seed in range(1, RANDOM_TARGETS + 1)]
    chosen = list(zip(names, targets, strict=True))[:: 15 if options.quick else 1]
    chosen = [one for one in chosen if options.only is None or options.only in one[0]]
    drops = options.drops or (2000 if options.quick else 100_000)
    row = report.table(
        "default dice",
        "target 20s | faces 5d | off 6.4f | chance 6.4f | least 5.2f | set down 8.1e | "
        "quotient 5.2f | stretch 5.2f | label mm 5.1f | on top 3s | size mm 4.0f | s 5.1f",
    )
    made, drawn = list[Made](), list[str]()
    for name, (text, labels) in chosen:
        try:
            die = make(text, labels, drops, options.engine)
        except InputError as error:
            report.line(f"{name}: {error}")
            continue
        made.append(die)
        drawn.append(name)
        row(
            *(name, die.faces, die.off, die.chance, die.least, die.error, die.quotient),
            *(die.stretch, die.label_mm, "yes" if die.is_on_top else "no"),
            *(die.size_mm, die.seconds),
        )
    row = report.table(
        "all default dice",
        "dice 4d | off median 6.4f | 8 of 10 6.4f | most 6.4f | over chance 6.4f | set down 8.1e | "
        "quotient median 5.2f | least 5.2f | splinters 3d | on top 5.2f | s median 5.1f | "
        "most s 5.1f",
    )
    off = np.array([die.off for die in made])
    on_top = float(np.mean([die.is_on_top for die in made]))
    error = max(die.error for die in made)
    splinters = sum(
        die.stretch > MAX_STRETCH and die.least_probability >= LEAST_PROBABILITY for die in made
    )
    often, middle = float(np.quantile(off, 0.8)), float(np.median(off))
    row(
        *(len(made), middle, often, off.max()),
        float(np.median(off - [die.chance for die in made])),
        error,
        *(np.median([die.quotient for die in made]), min(die.quotient for die in made)),
        *(splinters, on_top),
        *(np.median([die.seconds for die in made]), max(die.seconds for die in made)),
    )
    if options.out is not None:
        report.figure = draw(drawn, made)
    is_thrown = middle <= MAX_OFF["median"] and often <= MAX_OFF["eight in ten"]
    is_good = error <= MAX_ERROR and splinters == 0 and on_top >= ON_TOP
    return len(made) == len(chosen) and ((is_good and is_thrown) or options.quick)


def make(text: str, labels: str | None, drops: int, engine: str) -> Made:
    """The die of a target as `dicedesign design` makes it, and its throws."""
    entries = {"name": "die", "target": parse_target(text, labels)}
    with tempfile.TemporaryDirectory() as folder:
        # torch takes longer at its first use in a process.
        run_stages(Work(parse_recipe({"name": "die", "target": {"fair": 4}})), last="load")
        begun = time.process_time()
        work = Work(parse_recipe(entries), Path(folder), enlarge=True)
        with open_results_folder(work.folder):
            run_stages(work)
            finish(work)
        seconds = time.process_time() - begun
    target = work.target.probabilities
    with throwing_threads() as workers:
        die = DieOnTable.of(work.final.body, None, work.die.directions, TABLE, work.die.outcome_of)
        throws = die.simulate(drops, 1, engine=engine, workers=workers)
    counts: Integers = die.counts(throws).sum(axis=0)
    variation = measure_variation(counts, np.append(target, 0.0), 0.95)
    hull, (facts,) = work.plain.poses.hull, work.candidates[:1]
    heights = hull.vertices @ hull.normals.T
    rarest = int(target.argmin())
    return Made(
        hull=hull,
        faces=facts.faces,
        off=variation.value,
        chance=variation.noise_floor,
        least=float(counts[rarest] / counts.sum() / target[rarest]),
        error=work.final.max_abs_error,
        quotient=facts.quotient,
        stretch=float(hull.diameter / np.ptp(heights, axis=0).min()),
        label_mm=30.0 * facts.label_mm / facts.size_mm,
        is_on_top=facts.is_read_on_top,
        size_mm=work.recipe.size_mm,
        seconds=seconds,
        least_probability=float(target.min()),
    )


def draw(names: list[str], dice: list[Made]) -> Any:
    """Every die, with how far it is off when thrown."""
    figure, axes = panels(len(dice), 8, (1.9, 2.1))
    for axis, name, die in zip(axes, names, dice, strict=True):
        points = die.hull.vertices - die.hull.centroid
        camera = Camera(np.array([0.5, -0.7, 0.5]), np.array([0.0, 0.0, 1.0]))
        (framed,) = frame_cameras([camera], [points])
        axis.imshow(render(RenderMesh(points, die.hull.triangles, smooth=False), framed, PIXELS))
        axis.set_title(f"{name}: {die.faces}, {die.off:.3f}", fontsize=7)
        axis.axis("off")
    return figure
