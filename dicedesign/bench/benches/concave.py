"""Concave dice of many models: which become dice, how fast, and at what displacement."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.measures.designs.concave_dice import (
    FILLS,
    ConcaveCase,
    ConcaveRow,
    attempt_concave,
    built_in,
)
from dicedesign.bench.options import Amount, Option, meshes
from dicedesign.bench.rows import Row, column, percent
from dicedesign.errors import InputError, RecipeError

__all__ = ["GOALS", "Extent", "TargetRow", "concave_cases", "summary"]

GOALS: Final = {"fair:2": 0.9, "fair:3": 0.9, "1/2,1/3,1/6": 0.75, "fair:4": 0.4}
"""Least share of the models that become dice, by target."""

FEW: Final = 10
"""Dice below which chance decides about such a share: half of so few must be as wanted."""

THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables that tell a process how many threads its linear algebra may have."""

KEY: Final = """
|p - q|: the largest over clusters of rests within 5 degrees; elsewhere: odds of all other rests;
meet: pairs of triangles that do; apart: degrees between outcomes; margin: degrees to tip the die
out of one. All are those of the STL file as it is read back, its center of mass that of the solid.
s: of the search, on the wall, with one thread. mean: displacement of the points, over the diagonal.
corners: of the hull, before/after. tried: attempts. A die is as wanted with odds and elsewhere
within 0.005, nothing that meets, 45 degrees apart, margins of 10, in 60 s."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    random: how many models made at random are made into dice where no others are named.
    targets: for which.
    seconds: after which a die as wanted is not brought nearer to its model; None for no limit.
    most_points: of a surface that is made into a die as in the paper; larger ones are decimated.
    """

    random: int
    targets: tuple[str, ...]
    seconds: float | None
    most_points: int


@dataclass(frozen=True)
class TargetRow(Row):
    """All dice for one target by one fill.

    Attributes
    ----------
    dice: how many were tried; share: of those as wanted; goal: least share wanted, None for none.
    median_seconds, late_seconds, most_seconds: of all searches, the second exceeded by a tenth;
        None where none began.
    displacement: median of the mean displacements of the dice that are as wanted, over the
        diagonal; None where none is.
    """

    table = "targets"

    target: str = column("target", -12)
    fill: str = column("fill", -15)
    dice: int = column("dice", 5)
    share: float = column("met %", 7, percent(1))
    goal: float | None = column("goal %", 7, percent(0))
    median_seconds: float | None = column("median s", 9, ".1f")
    late_seconds: float | None = column("90 % s", 8, ".1f")
    most_seconds: float | None = column("most s", 8, ".1f")
    displacement: float | None = column("mean %", 7, percent(2))

    @property
    def reached(self) -> bool:
        """Whether the goal is reached, if there is one, or half of it all where dice are few."""
        if self.goal is None:
            return True
        return self.share >= (self.goal if self.dice >= FEW else min(self.goal, 0.5))


def concave_cases(
    models: Mapping[str, Path | None],
    targets: Sequence[str],
    extent: Extent,
    fills: Sequence[str] = FILLS[:1],
) -> list[ConcaveCase]:
    """Every target with every model by every fill.

    models: files by what to call them; None for the one that the package makes by this name.
    targets: fair:K or probabilities such as 1/2,1/3,1/6.

    Raises InputError, or RecipeError that begins with the target, for one that is none.
    """
    cases = []
    for target in targets:
        entry = _target(target)
        for model, path in models.items():
            for fill in fills:
                most = extent.most_points if fill == "paper" else None
                case = ConcaveCase(model, path, target, entry, fill, extent.seconds, most)
                try:
                    case.recipe(path or Path("model.stl"))
                except RecipeError as error:
                    raise RecipeError(f"--target {target}: {error}") from error
                cases.append(case)
    return cases


def _target(text: str) -> dict[str, Any]:
    """`target` of a recipe, out of an argument of `--target`."""
    kind, colon, count = text.partition(":")
    if colon == "":
        return {"probabilities": [part.strip() for part in text.split(",")]}
    if kind != "fair" or not count.isdecimal():
        raise InputError(
            f"--target: expected fair:K or probabilities, got {text!r}; write it such as fair:3 or "
            "1/2,1/3,1/6"
        )
    return {"fair": int(count)}


def _models(run: Run) -> dict[str, Path | None]:
    """The models that were asked for, see `concave_cases`."""
    from benchmarks.models import model_names
    from dicedesign.batch.folder import list_folder

    options, found = run.options, dict[str, Path | None]()
    for path in options.meshes:
        if not path.is_file():
            raise InputError(f"{path}: expected a mesh file, got none; check the path")
        found[path.name if path.name not in found else str(path)] = path
    if options.models is not None:
        found |= {name: options.models / name for name in list_folder(options.models).meshes}
    for name in options.model or ():
        if not built_in(name):
            raise InputError(
                f"--model: expected a model that the package makes, got {name!r}; write it such as "
                "blobs_03 or kitten, or give a file as MESH"
            )
        found[name] = None
    if not found or options.random is not None:
        found |= dict.fromkeys(model_names(run.extent.random))
    return found


def _rows(run: Run) -> Items:
    fills = FILLS if run.options.fill == "both" else (run.options.fill,)
    targets = run.options.targets or run.extent.targets
    cases = concave_cases(_models(run), targets, run.extent, fills)
    rows = []
    for row in _attempted(run, cases):
        rows.append(row)
        yield row
    yield KEY
    ends = list(summary(rows))
    yield from ends
    for end in ends:
        yield from _failures(end, rows)
    return all(end.reached for end in ends)


def _attempted(run: Run, cases: Sequence[ConcaveCase]) -> Iterator[ConcaveRow]:
    """The cases in their order, each in a process with one thread."""
    from dicedesign.runtime.workers import in_order

    tasks = [partial(attempt_concave, case) for case in cases]
    with _one_thread_each(), run.workers("dice", len(tasks)) as workers:
        for row in in_order(tasks, workers, run.on_quiet):
            run.advance()
            yield row


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that are started meanwhile have one thread for linear algebra."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def summary(rows: Sequence[ConcaveRow]) -> Iterator[TargetRow]:
    """A row for each target and fill, in the order in which they come. Goals are for the fill by
    correspondence."""
    import numpy as np

    for target, fill in dict.fromkeys((row.target, row.fill) for row in rows):
        mine = [row for row in rows if (row.target, row.fill) == (target, fill)]
        seconds = [row.seconds for row in mine if row.seconds is not None]
        took = np.quantile(seconds, [0.5, 0.9, 1.0]).tolist() if seconds else [None] * 3
        moved = [row.mean_displacement for row in mine if row.met]
        yield TargetRow(
            target,
            fill,
            len(mine),
            len(moved) / len(mine),
            GOALS.get(target) if fill == "correspondence" else None,
            took[0],
            took[1],
            took[2],
            float(np.median(np.array(moved, dtype=np.float64))) if moved else None,
        )


def _failures(end: TargetRow, rows: Sequence[ConcaveRow]) -> Iterator[str]:
    """A heading and a line for each die that is not as wanted."""
    failed = [row for row in rows if (row.target, row.fill) == (end.target, end.fill)]
    failed = [row for row in failed if not row.met]
    if failed:
        yield f"\nnot as wanted for {end.target} by {end.fill}:"
        yield from (f"{row.model}: {row.reason}" for row in failed)


BENCHES.register(
    Bench(
        name="concave",
        line="concave dice of many models: how many are as wanted, time, displacement",
        description="Make each model into a die for each target, with the options of a recipe that "
        "gives none, and measure what the STL file of the die holds. As wanted is one with odds "
        "within the tolerance, nothing that meets, outcomes 45 degrees apart and margins of 10, in "
        "60 s. What fails is a row with the reason. Exits 1 where fewer models become dice than "
        "the goal of the target: 90 % for fair:2 and fair:3, 75 % for 1/2,1/3,1/6, 40 % for "
        "fair:4, or half of fewer than ten. Where models are named, only these are made. With "
        "--fill paper all of the paper's method (hull: paper, fill: paper) makes them, decimated "
        "to 2,000 points (250 with --quick).",
        rows=_rows,
        full=Extent(40, tuple(GOALS), None, 2000),
        quick=Extent(3, ("fair:3",), 20.0, 250),
        amounts=(
            Amount("random", "N", "models made at random, of eleven kinds in turn"),
            Amount(
                "seconds",
                "S",
                "bring no die that is as wanted nearer to its model after that",
                kind=float,
            ),
        ),
        options=(
            meshes("STL, OBJ, PLY, OFF, GLB, ..."),
            Option("--models", "every mesh in a folder", {"type": Path, "metavar": "FOLDER"}),
            Option(
                "--model",
                "one made by the package: at random, such as blobs_03, or a shape such as kitten; "
                "may be repeated",
                {"action": "append", "metavar": "NAME"},
            ),
            Option(
                "--target",
                "fair:K, or probabilities such as 1/2,1/3,1/6; may be repeated (default: "
                "fair:2, fair:3, 1/2,1/3,1/6 and fair:4; quick: fair:3)",
                {"dest": "targets", "action": "append", "metavar": "TARGET"},
            ),
            Option(
                "--fill",
                "how the surface is made to fill its hull (default: correspondence)",
                {"choices": (*FILLS, "both"), "default": FILLS[0]},
            ),
        ),
        packages=("numpy", "scipy", "torch", "clarabel", "fast-simplification"),
        workers="dice at a time (default: one for each core)",
        unit="dice",
    )
)
