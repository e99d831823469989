"""Subjects of figures: mesh files, results folders and recipes."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.report.figures import Lain, Subject, surface_to_draw
from dicedesign.report.raster import upward_of
from dicedesign.report.renderer import RenderMesh
from dicedesign.rest.outcomes import facet_of_rest
from dicedesign.rest.poses import rest_poses

if TYPE_CHECKING:
    from dicedesign.recipe.pipeline import Work
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.report.solid_figures import Ablation

RECIPES = (".yaml", ".yml")
"""Endings of recipe files."""

PLAIN = "die_plain.stl"
"""File of the die without its labels."""


def subject_of(
    path: Path,
    *,
    center_of_mass: tuple[float, float, float] | Literal["hull"] | None = None,
    coplanar_tolerance: float | None = None,
    down: tuple[float, float, float] | None = None,
    before: Path | None = None,
    steps: int | None = None,
    on_step: Callable[[], None] = lambda: None,
) -> Subject:
    """Make the subject of a path, which is read or designed on demand.

    Parameters
    ----------
    path: mesh file, results folder, or recipe to design.
    center_of_mass, coplanar_tolerance: of a mesh, as in `rest_poses`.
    down: see `Subject`.
    before: original mesh of the body, in its place and scale; None for a recipe's start.
    steps: maximum steps of each descent of an ablation; None for the recipe's.
    on_step: called after every step of a design.

    Raises
    ------
    InputError: the file is missing, or options of a mesh are given with another subject.
    RecipeError: the recipe is invalid.
    """
    is_mesh = not (os.path.isdir(path) or path.suffix.lower() in RECIPES)
    if is_mesh:
        upward = upward_of(path)

        def load() -> Lain:
            body = read_body(path)
            poses = rest_poses(body, center_of_mass, coplanar_tolerance=coplanar_tolerance)
            return Lain(body, poses)

        def make_ablations() -> list[Ablation]:
            raise InputError(
                f"ablation: expected a recipe by the paper's method, or the folder of its run, got "
                f"the mesh {path}; recipes/paper has some"
            )

    else:
        from dicedesign.recipe.design_die import design_recipe
        from dicedesign.recipe.pipeline import Callbacks
        from dicedesign.recipe.reading import read_recipe
        from dicedesign.results.folder import RECIPE

        if center_of_mass is not None or coplanar_tolerance is not None:
            raise InputError(
                f"--com, --coplanar-tolerance: expected a mesh file, got {path}, which says both "
                "itself; leave them out"
            )
        is_folder = os.path.isdir(path)
        recipe = read_recipe(path / RECIPE if is_folder else path)
        mesh = recipe.start.mesh
        upward = np.array([0.0, 0.0, 1.0]) if mesh is None else upward_of(Path(mesh.path))

        def load() -> Lain:
            if is_folder:
                return _read_die(path, recipe)
            # Read back from its file, as a die of a folder.
            die = design_recipe(recipe, Callbacks(on_step=lambda _: on_step()), last="check").plain
            return Lain(die.body, die.poses, [facet.label or "" for facet in die.facets])

        def make_ablations() -> list[Ablation]:
            if recipe.method.paper is None:
                raise InputError(
                    f"ablation: expected a recipe by the paper's method, got {path} by method "
                    f"{recipe.method.name}; recipes/paper has some"
                )
            return _design_ablations(design_recipe(recipe, last="start"), steps, on_step)

    def make_before(after: Lain) -> RenderMesh:
        if before is not None:
            body = read_body(before)
            hull = convex_hull(body.points, single_precision=body.single_precision)
            return surface_to_draw(body.points, body.triangles, hull)
        if is_mesh:
            raise InputError(
                f"before_after: expected to know what {path} was made from, got a mesh alone; name "
                "that mesh with --before, or a recipe or a folder of a run instead"
            )
        return _draw_start(design_recipe(recipe, last="start"), path, after)

    return Subject(upward, load, make_before, make_ablations, down)


def _read_die(folder: Path, recipe: Recipe) -> Lain:
    """Die of a results folder."""
    from dicedesign.results.folder import read_result

    result = read_result(folder)
    body = read_body(folder / PLAIN)
    # The file does not hold a given center of mass.
    given = None if recipe.center_of_mass is None else result.center_of_mass
    poses = rest_poses(body, given).under(recipe.density_prior())
    # Equally probable rests may have another order than in the run.
    normals = np.array([facet.normal for facet in result.facets]).reshape(-1, 3)
    facets = facet_of_rest(poses.normals, normals).tolist()
    labels = ["" if k < 0 else result.facets[k].label or "" for k in facets]
    return Lain(body, poses, labels)


def _draw_start(work: Work, path: Path, after: Lain) -> RenderMesh:
    """Start of a design, with the size and the centroid of the die."""
    if work.surface is not None:
        points, triangles = work.surface.points, work.surface.triangles
        hull = convex_hull(points)
    elif work.start is not None:
        hull = convex_hull(work.start.points)
        points, triangles = hull.vertices, hull.triangles
    else:
        raise InputError(
            f"before_after: expected a recipe with a start, got {path}, which searches for shapes; "
            "write start: into it, or name a mesh with --before"
        )
    die_hull = after.poses.hull
    moved = (points - hull.centroid) * (die_hull.diameter / hull.diameter) + die_hull.centroid
    return surface_to_draw(moved, triangles, hull)


def _design_ablations(work: Work, steps: int | None, on_step: Callable[[], None]) -> list[Ablation]:
    """Dice by the paper's descent without a finish: with all terms, without each weighted term in
    turn, and by the dice energy alone.

    work: after the stage "start". steps: maximum steps of each descent; None for the recipe's.
    """
    from dicedesign.optimize.solvers.paper import solve_paper
    from dicedesign.optimize.terms import cluster
    from dicedesign.recipe.convex import normalized_center, target_probabilities
    from dicedesign.report.solid_figures import Ablation
    from dicedesign.rest.poses import analyze
    from dicedesign.runtime.workers import one_tensor_thread

    recipe, start, paper = work.recipe, work.start, work.recipe.method.options
    assert start is not None
    center = normalized_center(recipe, start)
    weighted = [term.name for term, _ in paper.weights.active if term.weight is not None]
    cases = {"all terms": list[str](), **{f"without {name}": [name] for name in weighted}}
    if len(weighted) > 1:
        cases["probabilities alone"] = weighted
    dice = []
    with one_tensor_thread():
        for name, left_out in cases.items():
            options = replace(
                paper,
                weights=paper.weights.replace(**dict.fromkeys(left_out, 0.0)),
                finish="none",
                tolerance=None,
                steps=paper.steps if steps is None else min(steps, paper.steps),
            )
            die = solve_paper(
                start,
                target_probabilities(recipe),
                options,
                center_of_mass=center,
                seed=recipe.seed,
                on_step=lambda _: on_step(),
            )
            poses = analyze(die.hull, die.hull.centroid if center is None else center)
            outcomes = cluster(poses.normals, die.directions).of_rest
            dice.append(Ablation(name, die.error, poses, outcomes))
    return dice
