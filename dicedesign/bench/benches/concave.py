"""Concave dice by both ways, each measured on the mesh that its STL file holds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Option, meshes
from dicedesign.bench.rows import Row, column, hidden, percent
from dicedesign.concave.options import ConcaveOptions
from dicedesign.errors import DiceError, InputError, RecipeError

if TYPE_CHECKING:
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.results.record import Result, Step

__all__ = ["ConcaveCase", "ConcaveRow", "Extent", "attempt_concave", "concave_cases", "verdict"]

FILLS: Final = ("correspondence", "paper")

MOST_ATTEMPTS: Final = ConcaveOptions().attempts
"""The clock alone ends a search before that."""

PAPER_ATTEMPTS: Final = 3
"""Attempts at a die by the paper's method, each after a search among ten hulls."""

KEY: Final = """
|p - q|: the largest over clusters of rests within 5 degrees; elsewhere: odds of all other rests.
Both, the gap and the pairs of triangles that meet are those of the STL file as it is read back, its
center of mass that of the solid. s: of the search, on the wall. MB: peak of the process. gap: from
its hull to the designed one, over the diagonal. mean, most: displacement of the points, over the
diagonal. shape, size: mean distortion of the triangles, 1 for none. corners: of the hull, before/
after. tried: attempts at a die."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    shapes: names of the shapes that are made into dice where no mesh is given.
    most_points: of a surface that is made into a die as in the paper; larger ones are decimated.
    seconds: wall-clock time after which a search begins no further attempt.
    """

    shapes: tuple[str, ...]
    most_points: int
    seconds: float


@dataclass(frozen=True)
class ConcaveCase:
    """One die that is to be made.

    Attributes
    ----------
    model: file or shape that it is made from.
    target: as it was given.
    fill: one of `FILLS`.
    recipe: all that it takes.
    most_points: number to which larger surfaces are decimated first; None to leave them.
    """

    model: str
    target: str
    fill: str
    recipe: Recipe
    most_points: int | None


@dataclass(frozen=True)
class ConcaveRow(Row):
    """One case, and the finished die by its STL file with the center of mass of the uniform solid;
    None for what is not known, as where there is no die.

    Attributes
    ----------
    model, target, fill: see `ConcaveCase`.
    points: of the surface that the die was made from.
    seconds: wall-clock time of the search; reading, decimation and judgement are not counted.
    peak_mb: most memory that the process held during the case, libraries included, in units of 10^6
        bytes, or since it started where the system cannot count anew.
    error: largest |p - q| over clusters of rests within 5 degrees.
    elsewhere: odds of all other rests together.
    gap: largest distance of its hull from the designed one, over the diagonal.
    intersections: pairs of triangles that meet and should not.
    mean_displacement, largest_displacement: of the points, over the diagonal.
    shape_distortion, size_distortion: means over the surface, see `Distortion`.
    corners: of the hulls of the surface and of the die.
    attempts: how many were made for it.
    note: what was done to the surface first, or why there is no die; "" for neither.
    tolerance: largest `error` and `elsewhere` of a die that is as wanted.
    """

    computed: ClassVar[tuple[str, ...]] = ("met",)

    model: str = column("model", -17)
    target: str = column("target", -15)
    fill: str = column("fill", -15)
    points: int | None = column("points", 7, default=None)
    seconds: float = column("s", 8, ".1f", default=0.0)
    peak_mb: float | None = column("MB", 7, ".0f", default=None)
    error: float | None = column("|p - q|", 10, ".1e", default=None)
    elsewhere: float | None = column("elsewhere", 11, ".1e", default=None)
    gap: float | None = column("gap", 10, ".1e", default=None)
    intersections: int | None = column("meet", 6, default=None)
    mean_displacement: float | None = column("mean %", 8, percent(2), default=None)
    largest_displacement: float | None = column("most %", 8, percent(1), default=None)
    shape_distortion: float | None = column("shape", 7, ".2f", default=None)
    size_distortion: float | None = column("size", 7, ".2f", default=None)
    corners: tuple[int, int] | None = column(
        "corners", 11, lambda both: "/".join(map(str, both)), default=None
    )
    attempts: int | None = column("tried", 7, default=None)
    note: str = column("", 0, default="")
    tolerance: float = hidden(default=0.0)

    @property
    def met(self) -> bool:
        """Whether the die has the wanted odds and does not meet itself."""
        if self.error is None or self.elsewhere is None:
            return False
        return max(self.error, self.elsewhere) <= self.tolerance and self.intersections == 0


def concave_cases(
    meshes: Sequence[Path],
    targets: Mapping[str, Mapping[str, Any]],
    extent: Extent,
    fills: Sequence[str] = FILLS,
) -> list[ConcaveCase]:
    """Every mesh for every target by every fill.

    meshes: files, or none for the shapes of the extent; targets: entries `target` of recipes, by
    what to call them.

    Raises RecipeError, which begins with what it is called, for a target that is none.
    """
    starts: list[tuple[str, dict[str, Any]]] = [
        (path.name, {"mesh": {"path": str(path)}}) for path in meshes
    ]
    return [
        ConcaveCase(
            model,
            name,
            fill,
            _recipe(name, target, start, fill, extent.seconds),
            extent.most_points if fill == "paper" else None,
        )
        for model, start in starts or [(name, {"shape": name}) for name in extent.shapes]
        for name, target in targets.items()
        for fill in fills
    ]


def _recipe(
    name: str, target: Mapping[str, Any], start: Mapping[str, Any], fill: str, seconds: float
) -> Recipe:
    from dicedesign.recipe.schema.reading import checked_recipe

    method = {"concave": {"fill": fill, "enough": MOST_ATTEMPTS, "seconds": seconds}}
    if fill == "paper":
        method["concave"] |= {"hull": "paper", "attempts": PAPER_ATTEMPTS}
    try:
        return checked_recipe({"name": "die", "target": target, "start": start, "method": method})
    except RecipeError as error:
        raise RecipeError(f"--target {name}: {error}") from error


def attempt_concave(case: ConcaveCase, on_step: Callable[[Step], None] | None = None) -> ConcaveRow:
    """Make and measure a die. Whatever goes wrong is told in the row.

    on_step: called after every step of the search.
    """
    from dicedesign.bench.measures.recipes import begun, checked, designed
    from dicedesign.geometry.surfaces.remeshing import decimated
    from dicedesign.runtime.clock import peak_megabytes, restart_peak

    row = ConcaveRow(case.model, case.target, case.fill, tolerance=case.recipe.method.tolerance)
    restart_peak()
    try:
        work = begun(case.recipe, on_step)
        assert work.surface is not None
        if case.most_points is not None and len(work.surface.points) > case.most_points:
            work.surface, note = decimated(work.surface, case.most_points)
            row = replace(row, note=note)
        row = replace(row, points=len(work.surface.points))
        started = time.perf_counter()
        try:
            designed(work)
        finally:
            row = replace(row, seconds=time.perf_counter() - started)
        row = replace(row, **_measured(checked(work)))
    except DiceError as error:
        row = replace(row, note=str(error))
    except Exception as error:  # a bench goes on with the next case, whatever went wrong in one
        row = replace(row, note=f"{type(error).__name__}: {error}")
    return replace(row, peak_mb=peak_megabytes())


def _measured(die: Result) -> dict[str, Any]:
    """Fields of the row, by the STL file of the die."""
    assert die.displacement is not None
    assert die.hull is not None
    assert die.surface_quality is not None
    distortion = die.surface_quality["distortion"]
    return {
        "error": die.max_abs_error,
        "elsewhere": die.elsewhere,
        "gap": die.hull.gap,
        "intersections": die.file_self_intersections,
        "mean_displacement": die.displacement.mean,
        "largest_displacement": die.displacement.largest,
        "shape_distortion": distortion["shape_mean"],
        "size_distortion": distortion["size_mean"],
        "corners": (die.hull.vertices_before, die.hull.vertices_after),
        "attempts": die.attempts,
    }


def _rows(run: Run) -> Items:
    for path in run.options.meshes:
        if not path.is_file():
            raise InputError(f"{path}: expected a mesh file, got none; check the path")
    targets = {text: _target(text) for text in run.options.targets or ["fair:3"]}
    fills = FILLS if run.options.fill is None else (run.options.fill,)
    cases = concave_cases(run.options.meshes, targets, run.extent, fills)
    rows = []
    for number, case in enumerate(cases, start=1):
        run.begin(f"{number} of {len(cases)}: {case.model}, {case.target}, {case.fill}")
        rows.append(attempt_concave(case, lambda step: run.advance()))
        yield rows[-1]
    yield "\n".join([KEY, *verdict(rows)])
    return all(row.met for row in rows if row.fill == "correspondence")


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


def verdict(rows: Sequence[ConcaveRow]) -> Iterator[str]:
    """A line for each fill: how many dice have the wanted odds and do not meet themselves, and
    which have not."""
    for fill in dict.fromkeys(row.fill for row in rows):
        mine = [row for row in rows if row.fill == fill]
        others = [f"{row.model}, {row.target}" for row in mine if not row.met]
        text = f"by {fill}: {len(mine) - len(others)} of {len(mine)} as wanted"
        if others:
            text += f"; beyond {mine[0].tolerance:g}, or meeting itself: {'; '.join(others)}"
        yield text


BENCHES.register(
    Bench(
        name="concave",
        line="concave dice by correspondence and as in the paper: odds, time, memory, distortion",
        description="Make each surface into a die for each target, its hull filled by "
        "correspondence, and by all of the paper's method (hull: paper, fill: paper), and measure "
        "what the STL file of the die holds. Surfaces of more than 2,000 points (250 with --quick) "
        "are decimated to that for the latter. What fails is a row with the reason. Exit code 1 if "
        "a die by correspondence misses the tolerance or meets itself.",
        rows=_rows,
        full=Extent(("kitten", "duck", "knot"), 2000, 60.0),
        quick=Extent(("knot",), 250, 25.0),
        options=(
            meshes("STL, OBJ, PLY, OFF, GLB, ... (default: shapes that the package builds itself)"),
            Option(
                "--target",
                "fair:K, or probabilities such as 1/2,1/3,1/6; may be repeated (default: fair:3)",
                {"dest": "targets", "action": "append", "metavar": "TARGET"},
            ),
            Option("--fill", "only this one (default: both)", {"choices": FILLS}),
        ),
        packages=("numpy", "scipy", "torch", "clarabel", "fast-simplification"),
        unit="steps",
    )
)
