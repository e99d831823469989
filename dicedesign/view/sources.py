"""What a path is that a page is opened with: a mesh, a recipe, a die, a folder of meshes."""

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
from dicedesign.view.viewed_body import MOST_POINTS, Outcomes, ViewedBody, farthest_points

if TYPE_CHECKING:
    from dicedesign.recipe.pipeline import Work
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.results.result import Result

__all__ = ["Source", "Tell", "source_of", "viewed_work"]


@dataclass(frozen=True)
class Tell:
    """Who is told how far a body is.

    Attributes
    ----------
    words: what is done now.
    hull: the hull of a large mesh, some time before its rests are known.
    """

    words: Callable[[str], None] = lambda _: None
    hull: Callable[[ConvexHull], None] = lambda _: None


RECIPES: Final = (".yaml", ".yml")

QUICK: Final = 1_000_000
"""Bytes of a file that is read at once, before there is a page."""


@dataclass(frozen=True)
class Source:
    """Bodies to look at.

    Attributes
    ----------
    title: where they are from.
    names: of the bodies, at least one.
    load: makes the body of a name; raises DiceError.
    quick: whether that takes no time worth telling of.
    """

    title: str
    names: tuple[str, ...]
    load: Callable[[str, Tell], ViewedBody]
    quick: bool


def source_of(path: Path) -> Source:
    """The bodies of a path.

    Raises InputError: there is no such file or folder, a recipe or a result cannot be read, or a
    folder has no meshes.
    """
    title = printable(path.name or path.resolve().name)
    if path.is_dir():
        if (path / RESULT).exists():
            result = read_result(path)
            return Source(title, (result.name,), lambda _, tell: _finished(result, tell), True)
        names = tuple(list_folder(path).meshes)
        quick = (path / names[0]).stat().st_size <= QUICK
        return Source(title, names, lambda name, tell: _read(path / name, name, tell), quick)
    if path.suffix.lower() in RECIPES:
        from dicedesign.recipe.reading import read_recipe

        recipe = read_recipe(path)
        return Source(title, (recipe.name,), lambda _, tell: _designed(recipe, tell), False)
    if not path.exists():
        raise MeshFileError(f"{path}: no such file; check the path")
    quick = path.stat().st_size <= QUICK
    return Source(title, (title,), lambda name, tell: _read(path, name, tell), quick)


def _read(path: Path, name: str, tell: Tell) -> ViewedBody:
    size = path.stat().st_size
    tell.words(f"reading {printable(name)}, {size / 1e6:.0f} MB")
    with without_solids():
        body = read_body(path)
    count = len(body.points) if body.triangles is None else len(body.triangles)
    what = "points" if body.triangles is None else "triangles"
    if len(body.points) > MOST_POINTS:
        return _approximate(body, printable(name), tell)
    if size > QUICK:
        tell.words(f"hull of {count:,} {what}")
        tell.hull(convex_hull(body.points, single_precision=body.single_precision))
    tell.words(f"rests of {count:,} {what}")
    return ViewedBody.of(body, name=printable(name))


def _approximate(body: Body, name: str, tell: Tell) -> ViewedBody:
    """A mesh of very many points by the hull of some, with its own center of mass."""
    tell.words(f"hull of {len(body.points):,} points")
    points = farthest_points(body.points)
    hull = convex_hull(points, single_precision=body.single_precision)
    tell.hull(hull)
    tell.words("center of mass")
    center, source, notes = resolve_center_of_mass(body, hull.centroid)
    tell.words("rests")
    said = (
        f"of {len(body.points):,} points the {len(points):,} farthest were taken, so that the "
        "probabilities "
        "are approximate; `dicedesign rest` takes all"
    )
    return ViewedBody.of(body, name=name, poses=analyze(hull, center, source, (*notes, said)))


def _finished(result: Result, tell: Tell) -> ViewedBody:
    """A die that was written: with its labels, unless nobody knows how these move its center."""
    tell.words(f"reading {result.name}")
    assert result.folder is not None
    engraved = result.printed_probabilities is not result.probabilities and "die" in result.files
    path = result.folder / result.files["die"] if engraved else result.plain_file
    shown: dict[str, tuple[float, ...]] = {}
    for facet in result.facets:
        if facet.outcome is not None:
            shown.setdefault(facet.outcome, facet.normal)
    wanted = dict(zip(result.labels, result.target, strict=True))
    labels = tuple(label for label in result.labels if label in shown)
    outcomes = Outcomes(
        labels,
        np.array([shown[label] for label in labels]).reshape(-1, 3),
        np.array([wanted[label] for label in labels]),
        result.prior,
    )
    center = None if engraved else np.array(result.center_of_mass)
    return ViewedBody.of(read_body(path), center, outcomes, name=result.name)


def _designed(recipe: Recipe, tell: Tell) -> ViewedBody:
    from dicedesign.recipe.design_die import design_recipe
    from dicedesign.recipe.pipeline import Callbacks
    from dicedesign.results.result import Step

    def on_step(step: Step) -> None:
        off = "" if step.max_abs_error is None else f", off by {step.max_abs_error:.2g} at most"
        tell.words(f"designing {recipe.name}: step {step.step}{off}")

    callbacks = Callbacks(
        on_stage=lambda stage: tell.words(f"designing {recipe.name}: {stage}"),
        on_step=on_step,
        on_attempt=lambda words: tell.words(f"designing {recipe.name}: {words}"),
    )
    return viewed_work(design_recipe(recipe, callbacks, last="engrave"))


def viewed_work(work: Work) -> ViewedBody:
    """The die of a design that has been checked; with its labels where they are cut in."""
    solid, engraved = work.solid, work.engraved
    if engraved is not None and engraved.assessment is not None:
        body = make_body(engraved.points, engraved.triangles, name=work.recipe.name)
    else:
        body = make_body(solid.points, solid.triangles, name=work.recipe.name)
    outcomes = Outcomes(
        work.target.labels, work.die.directions, work.target.probabilities, work.die.prior
    )
    return ViewedBody.of(body, solid.center_of_mass, outcomes)
