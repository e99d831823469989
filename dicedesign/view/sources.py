"""Load the bodies of a path: a mesh, a recipe, the folder of a die, or a folder of meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dicedesign.batch.batch import list_folder
from dicedesign.errors import printable
from dicedesign.geometry.meshes.body import body_of
from dicedesign.geometry.meshes.reading import THREE_MF, read_body
from dicedesign.geometry.robots.bodies import list_bodies
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Callbacks
from dicedesign.recipe.reading import read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.folder import read_result
from dicedesign.results.result import RESULT, Result, Step
from dicedesign.view.viewed_body import Outcomes, ViewedBody, outcomes_of

__all__ = ["Source", "open_source"]

OnProgress = Callable[[str], object]
"""Called with a text."""

RECIPE_ENDINGS = (".yaml", ".yml")


@dataclass(frozen=True)
class Source:
    """Bodies of a path.

    Attributes
    ----------
    names: names of the bodies, at least one.
    load: loads the body with a name. Raises DiceError.
    """

    names: tuple[str, ...]
    load: Callable[[str, OnProgress], ViewedBody]


def open_source(path: Path) -> Source:
    """List the bodies of a path.

    Raises InputError: the file or folder does not exist, a recipe or a result cannot be read, or a
    folder has no meshes.
    """
    if path.is_dir():
        if (path / RESULT).exists():
            result = read_result(path)
            return Source((result.name,), lambda *_: _load_die(result))
        names = tuple(list_folder(path).meshes)
        return Source(names, lambda name, on_progress: _load_mesh(path / name, name, on_progress))
    if path.suffix.lower() in RECIPE_ENDINGS:
        recipe = read_recipe(path)
        return Source((recipe.name,), lambda _, on_progress: _design(recipe, on_progress))
    if path.suffix.lower() == THREE_MF:
        bodies = {f"{path.name} {body.name}".rstrip(): body.read for body in list_bodies(path)}
        return Source(tuple(bodies), lambda name, _: ViewedBody.of(bodies[name](), name=name))
    return Source((path.name,), lambda name, on_progress: _load_mesh(path, name, on_progress))


def _load_mesh(path: Path, name: str, on_progress: OnProgress) -> ViewedBody:
    name = printable(name)
    on_progress(f"reading {name}")
    body = read_body(path)
    on_progress(f"rests of {len(body.points):,} points")
    return ViewedBody.of(body, name=name)


def _load_die(result: Result) -> ViewedBody:
    """Load a finished die, with its labels if their effect on its center of mass is known."""
    assert result.folder is not None
    engraved = result.printed_probabilities is not result.probabilities and "die" in result.files
    path = result.folder / result.files["die"] if engraved else result.plain_file
    faces = [facet for facet in result.facets if facet.label is not None]
    target = dict(zip(result.labels, result.target, strict=True))
    shown = {facet.label for facet in faces}
    labels = tuple(label for label in result.labels if label in shown)
    outcomes = Outcomes(
        labels,
        np.array([facet.normal for facet in faces]).reshape(-1, 3),
        np.array([target[label] for label in labels]),
        result.prior,
        np.array([labels.index(facet.label) for facet in faces], dtype=np.int64),
    )
    center = None if engraved else np.array(result.center_of_mass)
    return ViewedBody.of(read_body(path), center, outcomes, name=result.name)


def _design(recipe: Recipe, on_progress: OnProgress) -> ViewedBody:
    """Design the die of a recipe, with labels if the recipe engraves them."""

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
    body = body_of(solid, recipe.name)
    return ViewedBody.of(body, work.solid.center_of_mass, outcomes_of(work))
