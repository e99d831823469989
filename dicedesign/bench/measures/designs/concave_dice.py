"""Models made into concave dice, each die measured on the mesh that its STL file holds."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, ClassVar, Final

from dicedesign.bench.rows import Row, column, hidden, percent
from dicedesign.errors import DiceError

if TYPE_CHECKING:
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.results.result import Result

__all__ = ["FILLS", "ConcaveCase", "ConcaveRow", "attempt_concave", "built_in"]

FILLS: Final = ("correspondence", "paper")

PAPER_ATTEMPTS: Final = 3
"""Attempts at a die by the paper's method, each after a search among ten hulls."""

LEAST_APART: Final = 45.0
"""Degrees between outcomes' rests."""

LEAST_MARGIN: Final = 10.0
"""Degrees by which a die must be tipped to leave an outcome."""

ANGLE_SLACK: Final = 0.01
"""Degrees by which both may be less: a search ends at the limits, and files are rounded."""

LONGEST: Final = 60.0
"""Seconds of a search."""


@dataclass(frozen=True)
class ConcaveCase:
    """One die that is to be made.

    Attributes
    ----------
    model: what to call it: a file, or a name of `built_in`.
    path: of the file; None for the one of that name.
    target: as it was given; entry: the same as a recipe has it.
    fill: one of `FILLS`.
    seconds: after which a die as wanted is not brought nearer to its model; None for no limit.
    most_points: number to which larger surfaces are decimated first; None to leave them.
    """

    model: str
    path: Path | None
    target: str
    entry: Mapping[str, Any]
    fill: str
    seconds: float | None
    most_points: int | None

    def recipe(self, path: Path) -> Recipe:
        """All that it takes, for a mesh file. Raises RecipeError."""
        from dicedesign.recipe.schema.reading import checked_recipe

        concave: dict[str, Any] = {} if self.seconds is None else {"seconds": self.seconds}
        if self.fill == "paper":
            concave |= {"hull": "paper", "fill": "paper", "attempts": PAPER_ATTEMPTS}
        start = {"mesh": {"path": str(path)}}
        return checked_recipe(
            {"name": "die", "target": self.entry, "start": start, "method": {"concave": concave}}
        )


@dataclass(frozen=True)
class ConcaveRow(Row):
    """One case, and the finished die by its STL file with the center of mass of the uniform solid;
    None for what is not known, as where there is no die.

    Attributes
    ----------
    model, target, fill: see `ConcaveCase`.
    points: of the surface that the die was made from.
    seconds: wall-clock time of the search; reading, decimation and judgement are not counted, and
        there is none of a model that is no start.
    error: largest |p - q| over clusters of rests within 5 degrees.
    elsewhere: odds of all other rests together.
    intersections: pairs of triangles that meet and should not.
    apart: least angle between two outcomes' rests; margin: by which the die must be tipped to leave
        an outcome; in degrees.
    mean_displacement, largest_displacement: of the points, over the diagonal.
    corners: of the hulls of the surface and of the die.
    attempts: how many were made for it.
    reason: why the die is not as wanted, or why there is none; "" where it is.
    note: what was done to the surface first.
    peak_mb: most memory that the process held during the case, libraries included, in units of 10^6
        bytes, or since it started where the system cannot count anew.
    gap: largest distance of its hull from the designed one, over the diagonal.
    shape_distortion, size_distortion: means over the surface, see `Distortion`.
    """

    computed: ClassVar[tuple[str, ...]] = ("met",)

    model: str = column("model", -17)
    target: str = column("target", -12)
    fill: str = column("fill", -15)
    points: int | None = column("points", 7, default=None)
    seconds: float | None = column("s", 7, ".1f", default=None)
    error: float | None = column("|p - q|", 9, ".1e", default=None)
    elsewhere: float | None = column("elsewhere", 10, ".1e", default=None)
    intersections: int | None = column("meet", 5, default=None)
    apart: float | None = column("apart", 6, ".1f", default=None)
    margin: float | None = column("margin", 7, ".1f", default=None)
    mean_displacement: float | None = column("mean %", 7, percent(2), default=None)
    corners: tuple[int, int] | None = column(
        "corners", 10, lambda both: "/".join(map(str, both)), default=None
    )
    attempts: int | None = column("tried", 6, default=None)
    reason: str = column("", 0, lambda reason: reason or "met", default="")
    note: str = hidden(default="")
    peak_mb: float | None = hidden(default=None)
    gap: float | None = hidden(default=None)
    largest_displacement: float | None = hidden(default=None)
    shape_distortion: float | None = hidden(default=None)
    size_distortion: float | None = hidden(default=None)

    @property
    def met(self) -> bool:
        """Whether the die is as wanted."""
        return self.reason == ""

    def judged(self, tolerance: float) -> ConcaveRow:
        """The same with the reason why the die is not as wanted, if so.

        tolerance: largest error and odds elsewhere.
        """
        return replace(self, reason="; ".join(self._shortfalls(tolerance)))

    def _shortfalls(self, tolerance: float) -> Iterator[str]:
        assert self.error is not None
        assert self.elsewhere is not None
        assert self.apart is not None
        assert self.margin is not None
        if self.error > tolerance:
            yield f"odds off by {self.error:.1e}"
        if self.elsewhere > tolerance:
            yield f"odds of {self.elsewhere:.1e} elsewhere"
        if self.intersections:
            yield f"{self.intersections} pairs of triangles meet"
        if self.apart < LEAST_APART - ANGLE_SLACK:
            yield f"outcomes {self.apart:.1f} degrees apart"
        if self.margin < LEAST_MARGIN - ANGLE_SLACK:
            yield f"an outcome is left at {self.margin:.1f} degrees"
        if self.seconds is not None and self.seconds > LONGEST:
            yield f"took {self.seconds:.0f} s"


def built_in(name: str) -> bool:
    """Whether a model of this name is made by the package."""
    from benchmarks.models import is_model
    from dicedesign.concave.shapes import SHAPES

    return name in SHAPES or is_model(name)


def attempt_concave(case: ConcaveCase) -> ConcaveRow:
    """Make and measure a die. Whatever goes wrong is told in the row."""
    with TemporaryDirectory() as folder:
        return _attempted(case, case.path or _written(case.model, Path(folder)))


def _written(name: str, folder: Path) -> Path:
    """The file of a model that the package makes."""
    from benchmarks.models import random_model
    from dicedesign.concave.shapes import SHAPES
    from dicedesign.geometry.meshes.formats import stl_bytes

    surface = SHAPES[name]() if name in SHAPES else random_model(name)
    path = folder / f"{name}.stl"
    path.write_bytes(stl_bytes(surface.points, surface.triangles))
    return path


def _attempted(case: ConcaveCase, path: Path) -> ConcaveRow:
    from dicedesign.bench.measures.recipes import begun, checked, designed
    from dicedesign.geometry.surfaces.remeshing import decimated
    from dicedesign.runtime.clock import peak_megabytes, restart_peak
    from dicedesign.runtime.workers import one_tensor_thread

    # Its imports are no part of the search.
    import_module("dicedesign.recipe.methods.concave")
    row = ConcaveRow(case.model, case.target, case.fill)
    restart_peak()
    try:
        recipe = case.recipe(path)
        with one_tensor_thread():
            work = begun(recipe)
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
            row = replace(row, **_measured(checked(work))).judged(recipe.method.tolerance)
    except DiceError as error:
        row = replace(row, reason=str(error))
    except Exception as error:  # a bench goes on with the next case, whatever went wrong in one
        row = replace(row, reason=f"{type(error).__name__}: {error}")
    return replace(row, peak_mb=peak_megabytes())


def _measured(die: Result) -> dict[str, Any]:
    """Fields of the row, by the STL file of the die."""
    concave, search = die.concave, die.search
    assert concave is not None
    assert search is not None
    distortion = concave.surface_quality["distortion"]
    return {
        "error": die.max_abs_error,
        "elsewhere": die.elsewhere,
        "intersections": concave.self_intersections,
        "apart": die.least_angle_deg,
        "margin": die.least_margin_deg,
        "mean_displacement": concave.displacement.mean,
        "largest_displacement": concave.displacement.largest,
        "corners": (concave.hull.vertices_before, concave.hull.vertices_after),
        "attempts": search.attempts,
        "gap": concave.hull.gap,
        "shape_distortion": distortion["shape_mean"],
        "size_distortion": distortion["size_mean"],
    }
