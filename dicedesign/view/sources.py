"""Load the bodies of a path: a mesh, a recipe, the folder of a die, or a folder of meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.batch.batch import list_folder
from dicedesign.errors import MeshFileError, printable
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, make_body, resolve_center_of_mass
from dicedesign.geometry.meshes.reading import read_body, without_solids
from dicedesign.rest.poses import analyze
from dicedesign.results.folder import read_result
from dicedesign.results.result import RESULT
from dicedesign.view.viewed_body import MAX_HULL_POINTS, Outcomes, ViewedBody, farthest_points

if TYPE_CHECKING:
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.results.result import Result

__all__ = ["LoadCallbacks", "Source", "open_source"]


@dataclass(frozen=True)
class LoadCallbacks:
    """Progress callbacks.

    Attributes
    ----------
    on_progress: called with a text.
    on_hull: called with the hull of a large mesh, before its rests are known.
    """

    on_progress: Callable[[str], None] = lambda _: None
    on_hull: Callable[[ConvexHull], None] = lambda _: None


RECIPE_ENDINGS: Final = (".yaml", ".yml")

QUICK_BYTES: Final = 1_000_000
"""Files up to this size are loaded before the page opens."""


@dataclass(frozen=True)
class Source:
    """Bodies of a path.

    Attributes
    ----------
    names: names of the bodies, at least one.
    load: loads the body with a name. Raises DiceError.
    is_quick: whether loading the first body takes less than about a second.
    """

    names: tuple[str, ...]
    load: Callable[[str, LoadCallbacks], ViewedBody]
    is_quick: bool


def open_source(path: Path) -> Source:
    """List the bodies of a path.

    Raises InputError: the file or folder does not exist, a recipe or a result cannot be read, or a
    folder has no meshes.
    """
    if path.is_dir():
        if (path / RESULT).exists():
            result = read_result(path)
            return Source((result.name,), lambda _, callbacks: _load_die(result, callbacks), True)
        names = tuple(list_folder(path).meshes)
        return Source(
            names,
            lambda name, callbacks: _load_mesh(path / name, name, callbacks),
            _is_quick(path / names[0]),
        )
    if path.suffix.lower() in RECIPE_ENDINGS:
        from dicedesign.recipe.reading import read_recipe

        recipe = read_recipe(path)
        return Source(
            (recipe.name,), lambda _, callbacks: _design(recipe, callbacks.on_progress), False
        )
    if not path.exists():
        raise MeshFileError(f"{path}: no such file; check the path")
    return Source(
        (printable(path.name),),
        lambda name, callbacks: _load_mesh(path, name, callbacks),
        _is_quick(path),
    )


def _is_quick(path: Path) -> bool:
    return path.stat().st_size <= QUICK_BYTES


def _load_mesh(path: Path, name: str, callbacks: LoadCallbacks) -> ViewedBody:
    name, progress = printable(name), callbacks.on_progress
    progress(f"reading {name}, {path.stat().st_size / 1e6:.0f} MB")
    with without_solids():
        body = read_body(path)
    if len(body.points) > MAX_HULL_POINTS:
        return _approximate(body, name, callbacks)
    count = f"{len(body.points):,} points"
    if body.triangles is not None:
        count = f"{len(body.triangles):,} triangles"
    if not _is_quick(path):
        progress(f"hull of {count}")
        callbacks.on_hull(convex_hull(body.points, single_precision=body.single_precision))
    progress(f"rests of {count}")
    return ViewedBody.of(body, name=name)


def _approximate(body: Body, name: str, callbacks: LoadCallbacks) -> ViewedBody:
    """Analyze a large mesh by the hull of its farthest points, with its own center of mass."""
    callbacks.on_progress(f"hull of {len(body.points):,} points")
    points = farthest_points(body.points)
    hull = convex_hull(points, single_precision=body.single_precision)
    callbacks.on_hull(hull)
    callbacks.on_progress("center of mass")
    center, source, notes = resolve_center_of_mass(body, hull.centroid)
    callbacks.on_progress("rests")
    note = (
        f"the probabilities are approximate, from the {len(points):,} farthest of "
        f"{len(body.points):,} points; `dicedesign rest` uses all"
    )
    return ViewedBody.of(body, name=name, poses=analyze(hull, center, source, (*notes, note)))


def _load_die(result: Result, callbacks: LoadCallbacks) -> ViewedBody:
    """Load a finished die, with its labels if their effect on its center of mass is known."""
    callbacks.on_progress(f"reading {result.name}")
    assert result.folder is not None
    engraved = result.printed_probabilities is not result.probabilities and "die" in result.files
    path = result.folder / result.files["die"] if engraved else result.plain_file
    directions: dict[str, tuple[float, ...]] = {}
    for facet in result.facets:
        if facet.outcome is not None:
            directions.setdefault(facet.outcome, facet.normal)
    target = dict(zip(result.labels, result.target, strict=True))
    labels = tuple(label for label in result.labels if label in directions)
    outcomes = Outcomes(
        labels,
        np.array([directions[label] for label in labels]).reshape(-1, 3),
        np.array([target[label] for label in labels]),
        result.prior,
    )
    center = None if engraved else np.array(result.center_of_mass)
    return ViewedBody.of(read_body(path), center, outcomes, name=result.name)


def _design(recipe: Recipe, on_progress: Callable[[str], None]) -> ViewedBody:
    """Design the die of a recipe, with labels if the recipe engraves them."""
    from dicedesign.recipe.design_die import design_recipe
    from dicedesign.recipe.pipeline import Callbacks
    from dicedesign.results.result import Step

    def report(text: str) -> None:
        on_progress(f"designing {recipe.name}: {text}")

    def on_step(step: Step) -> None:
        error = step.max_abs_error
        report(f"step {step.step}" + ("" if error is None else f", largest error {error:.2g}"))

    callbacks = Callbacks(on_stage=report, on_step=on_step, on_attempt=report)
    work = design_recipe(recipe, callbacks, last="engrave")
    solid = work.solid
    if work.engraved is not None and work.engraved.assessment is not None:
        solid = work.engraved
    body = make_body(solid.points, solid.triangles, name=recipe.name)
    outcomes = Outcomes(
        work.target.labels, work.die.directions, work.target.probabilities, work.die.prior
    )
    return ViewedBody.of(body, work.solid.center_of_mass, outcomes)
