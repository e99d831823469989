"""Stage start: what the design begins with, and whether it suits the recipe."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dicedesign.errors import InputError, named
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.starts.start import Task
from dicedesign.recipe.recipe import AUTO, Recipe
from dicedesign.recipe.work import Work
from dicedesign.tolerances import EQUAL_ODDS


def make_start(work: Work) -> None:
    """Make the starting shape of a recipe, or the surface of one whose method is concave.

    Raises InputError if a mesh cannot be read or has too few rests, the center of mass is not
    inside the shape, a symmetry does not permute its facets or carries labels to less probable
    ones, the surface is no closed one of one solid, or convex, or nearly a sphere, the die cannot
    be thrown as the recipe says, or the art of a label cannot be made.
    """
    recipe = work.recipe
    if recipe.method.concave is not None:
        _make_surface(work)
    else:
        _make_shape(work)
    ignored = recipe.ignored_weights()
    if ignored is not None:
        work.notes.append(ignored)
    if recipe.engrave is not None:
        from dicedesign.fabricate.label_art import label_arts

        # Raises where the art of a label cannot be made.
        for label in work.target.labels:
            label_arts(label, recipe.engrave)


def _make_surface(work: Work) -> None:
    from dicedesign.geometry.repair.repair import FINEST, MOST_POINTS
    from dicedesign.geometry.surfaces.closed_surface import require_dents
    from dicedesign.geometry.surfaces.remeshing import decimated, refined

    start, method = work.recipe.start, work.recipe.method.concave
    assert method is not None
    assert start.kind.surface is not None
    most = MOST_POINTS if method.points is None else max(FINEST, method.points)
    made = start.kind.surface(start.options, most)
    surface = made.surface
    work.notes += made.notes
    work.repaired = made.repair
    require_dents(surface)
    if method.points is not None:
        changed = refined if len(surface.points) < method.points else decimated
        surface, note = changed(surface, method.points)
        work.notes.append(note)
    work.surface = surface


def _make_shape(work: Work) -> None:
    recipe = work.recipe
    center = None if recipe.center_of_mass is None else np.array(recipe.center_of_mass)
    if recipe.method.exact is not None and recipe.method.thrown:
        _check_table(recipe.method.exact, recipe.size_mm)
    start = recipe.start.made(Task(len(work.target.labels), recipe.seed, center))
    if start is None:
        return
    directions: Any = getattr(start, "directions", None)
    if np.shape(directions) != (len(work.target.labels), 3):
        raise InputError(
            f"start.{recipe.start.name}: expected a Start with a direction for each of the "
            f"{len(work.target.labels)} outcomes, got {type(start).__name__} with directions of "
            f"shape {np.shape(directions)}; correct the extension"
        )
    if recipe.symmetry is not None:
        # Every symmetry of a body keeps its centroid where it is.
        start = start.about_centroid()
        if recipe.symmetry != AUTO:
            check_orbits(recipe, start.directions)
    work.start = start
    work.notes += start.notes


def _check_table(options: ExactOptions, size_mm: float) -> None:
    """Raise InputError where a die cannot be thrown as the options say: there is no such table, it
    has no momentum model, the die is too large for it, or the engine is missing.

    size_mm: largest distance between two vertices of the die.
    """
    from dicedesign.throws.engines import require_engine
    from dicedesign.throws.momentum_model import momentum_model
    from dicedesign.throws.tables import table_named

    with named("method.exact.table"):
        table = table_named(options.thrown_onto)
        momentum_model(options.thrown_onto)
    # The radius is at least half of that distance.
    replace(table, size=1e-3 * size_mm)
    if options.refine is not None:
        require_engine(options.refine.engine)


def check_orbits(recipe: Recipe, directions: np.ndarray) -> None:
    """Raise InputError unless labels on facets that are images of each other are as probable."""
    from dicedesign.optimize.coordinates.linked import orbits_of_directions

    group, target = recipe.group(), recipe.target.target()
    assert group is not None
    outcome = np.array(recipe.outcome_of_direction())
    first: dict[int, int] = {}
    for orbit, number in zip(orbits_of_directions(directions, group), outcome, strict=True):
        other = first.setdefault(int(orbit), int(number))
        odds = target.probabilities[[number, other]]
        if abs(odds[0] - odds[1]) > EQUAL_ODDS * odds[1]:
            raise InputError(
                f"symmetry: expected labels {target.labels[other]} and {target.labels[number]} to "
                f"be equally probable, as {recipe.symmetry} carries their facets to each other, "
                f"got {odds[1]:.6g} and {odds[0]:.6g}; change the assignment, or take a smaller "
                "group"
            )
