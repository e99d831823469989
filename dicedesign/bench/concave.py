"""Concave dice by both fills, each measured on the mesh that its STL file holds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from dicedesign.concave.result import ConcaveDie, ConcaveStep
from dicedesign.concave.search import make_concave_die
from dicedesign.errors import DiceError, RecipeError
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.remeshing import decimated
from dicedesign.recipe.concave_judging import concave_options, judge_file, make_input_surface
from dicedesign.recipe.concave_run import in_millimetres
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.runtime.clock import peak_megabytes, restart_peak

__all__ = [
    "FILLS",
    "FULL",
    "QUICK",
    "ConcaveCase",
    "ConcaveFigures",
    "ConcaveRow",
    "Extent",
    "attempt_concave",
    "concave_cases",
]

FILLS: Final = ("correspondence", "quadratic")


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    shapes: names of the shapes that are made into dice where no mesh is given.
    most_points: of a surface that is filled by quadratic programs; larger ones are decimated.
    seconds: wall-clock time after which a search begins no further attempt.
    """

    shapes: tuple[str, ...]
    most_points: int
    seconds: float


FULL: Final = Extent(("kitten", "duck", "knot"), 5000, 60.0)

QUICK: Final = Extent(("knot",), 250, 25.0)


@dataclass(frozen=True)
class ConcaveCase:
    """One die that is to be made.

    Attributes
    ----------
    model: file or shape that it is made from.
    target: as it was given.
    recipe: all that it takes.
    most_points: number to which larger surfaces are decimated first; None to leave them.
    """

    model: str
    target: str
    recipe: Recipe
    most_points: int | None

    @property
    def fill(self) -> str:
        """One of `FILLS`."""
        return concave_options(self.recipe).fill


@dataclass(frozen=True)
class ConcaveFigures:
    """A finished die, by its STL file, with the center of mass of the uniform solid.

    Attributes
    ----------
    error: largest |p - q| over clusters of rests within 5 degrees.
    elsewhere: odds of all other rests together.
    gap: largest distance of its hull from the designed one, over the diagonal.
    intersections: pairs of triangles that meet and should not.
    mean_displacement, largest_displacement: of the points, over the diagonal.
    shape_distortion, size_distortion: means over the surface, see `Distortion`.
    corners_before, corners_after: of the hulls of the surface and of the die.
    attempts: how many were made for it.
    """

    error: float
    elsewhere: float
    gap: float
    intersections: int
    mean_displacement: float
    largest_displacement: float
    shape_distortion: float
    size_distortion: float
    corners_before: int
    corners_after: int
    attempts: int


@dataclass(frozen=True)
class ConcaveRow:
    """One case.

    Attributes
    ----------
    model, target, fill: see `ConcaveCase`.
    points: of the surface that the die was made from; None if there is none.
    seconds: wall-clock time of the search; reading, decimation and judgement are not counted.
    peak_mb: most memory that the process held during the case, libraries included, in units of 10^6
        bytes, or since it started where the system cannot count anew; None where it does not tell.
    tolerance: largest `error` and `elsewhere` of a die that is as wanted.
    figures: of the die; None if there is none.
    note: what was done to the surface first, or why there is no die; "" for neither.
    """

    model: str
    target: str
    fill: str
    points: int | None
    seconds: float
    peak_mb: float | None
    tolerance: float
    figures: ConcaveFigures | None
    note: str

    @property
    def met(self) -> bool:
        """Whether the die has the wanted odds and does not meet itself."""
        found = self.figures
        return (
            found is not None
            and max(found.error, found.elsewhere) <= self.tolerance
            and found.intersections == 0
        )

    def plain(self) -> dict[str, Any]:
        """Everything for JSON, figures beside the rest."""
        row = asdict(self)
        figures = row.pop("figures") or dict.fromkeys(ConcaveFigures.__annotations__)
        return {**row, **figures, "met": self.met}


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
            _recipe(name, target, start, fill, extent.seconds),
            extent.most_points if fill == "quadratic" else None,
        )
        for model, start in starts or [(name, {"shape": name}) for name in extent.shapes]
        for name, target in targets.items()
        for fill in fills
    ]


def _recipe(
    name: str, target: Mapping[str, Any], start: Mapping[str, Any], fill: str, seconds: float
) -> Recipe:
    method = {"concave": {"fill": fill, "seconds": seconds}}
    try:
        return checked_recipe({"name": "die", "target": target, "start": start, "method": method})
    except RecipeError as error:
        raise RecipeError(f"{name}: {error}") from error


def attempt_concave(
    case: ConcaveCase, on_step: Callable[[ConcaveStep], None] | None = None
) -> ConcaveRow:
    """Make and measure a die. Whatever goes wrong is told in the row.

    on_step: called after every step of the search.
    """
    options = concave_options(case.recipe)
    restart_peak()
    points, figures, note, seconds = None, None, "", 0.0
    try:
        surface, _ = make_input_surface(case.recipe)
        if case.most_points is not None and len(surface.points) > case.most_points:
            surface, note = decimated(surface, case.most_points)
        points = len(surface.points)
        started = time.perf_counter()
        try:
            die = make_concave_die(
                surface,
                case.recipe.target.target().probabilities,
                options,
                seed=case.recipe.seed,
                on_step=on_step,
            )
        finally:
            seconds = time.perf_counter() - started
        figures = _figures(case.recipe, die)
    except DiceError as error:
        note = str(error)
    except Exception as error:  # a bench goes on with the next case, whatever went wrong in one
        note = f"{type(error).__name__}: {error}"
    return ConcaveRow(
        model=case.model,
        target=case.target,
        fill=case.fill,
        points=points,
        seconds=seconds,
        peak_mb=peak_megabytes(),
        tolerance=options.tolerance,
        figures=figures,
        note=note,
    )


def _figures(recipe: Recipe, die: ConcaveDie) -> ConcaveFigures:
    placed, hull_points = in_millimetres(die, recipe.size_mm)
    data = stl_bytes(placed.points, placed.triangles)
    judged = judge_file(recipe, die, data, hull_points, printable=True)
    moved = norms(die.after.points - die.before.points) / die.before.diagonal
    distortion = judged.quality.distortion
    assert distortion is not None
    before, after = die.hull_corners
    return ConcaveFigures(
        error=judged.outcomes.max_abs_error(recipe.target.target().probabilities),
        elsewhere=judged.outcomes.elsewhere,
        gap=judged.gap,
        intersections=judged.intersections,
        mean_displacement=float(moved.mean()),
        largest_displacement=float(moved.max()),
        shape_distortion=distortion.shape_mean,
        size_distortion=distortion.size_mean,
        corners_before=before,
        corners_after=after,
        attempts=die.progress.attempts,
    )
