"""Subjects of figures: mesh files, results folders and recipes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.report.body_figures import Subject, surface_to_draw
from dicedesign.report.paper import COLUMN_WIDTH
from dicedesign.report.raster import upward_of
from dicedesign.report.renderer import RenderMesh
from dicedesign.rest.outcomes import facet_of_rest
from dicedesign.rest.poses import rest_poses

if TYPE_CHECKING:
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.recipe.pipeline import Work
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.rest.poses import RestPoses
    from dicedesign.results.result import Result
    from dicedesign.runtime.arrays import Integers

RECIPES = (".yaml", ".yml")
"""Endings of recipe files."""

PLAIN = "die_plain.stl"
"""File of the die without its labels."""


def subject_of(
    path: Path,
    *,
    center_of_mass: tuple[float, float, float] | Literal["hull"] | None = None,
    coplanar_tolerance: float | None = None,
    item: int | None = None,
    down: tuple[float, float, float] | None = None,
    before: Path | None = None,
    width: float = COLUMN_WIDTH,
) -> Subject:
    """Read or design the subject of a path.

    Parameters
    ----------
    path: mesh file, results folder, or recipe to design.
    center_of_mass, coplanar_tolerance: of a mesh, as in `rest_poses`; item: as in `read_body`.
    down, width: see `Subject`.
    before: original mesh of the body, in the same place and scale; None for a recipe's start.

    Raises
    ------
    InputError: the file is missing, or options of a mesh are given with another subject.
    RecipeError: the recipe is invalid.
    """
    is_folder, facts = os.path.isdir(path), dict[str, Any]()
    if not is_folder and path.suffix.lower() not in RECIPES:
        body, recipe = read_body(path, item), None
        poses = rest_poses(body, center_of_mass, coplanar_tolerance=coplanar_tolerance)
        upward = upward_of(path)
    else:
        from dicedesign.recipe.design_die import design_recipe
        from dicedesign.recipe.reading import read_recipe
        from dicedesign.results.folder import RECIPE

        if center_of_mass is not None or coplanar_tolerance is not None:
            raise InputError(
                f"--com, --coplanar-tolerance: expected a mesh file, got {path}, which says both "
                "itself; leave them out"
            )
        recipe = read_recipe(path / RECIPE if is_folder else path)
        upward = upward_of(recipe.start.mesh and recipe.start.mesh.path)
        if is_folder:
            body, poses, result = _read_die(path, recipe)
        else:
            # Read back from its file, as a die of a folder.
            work = design_recipe(recipe, last="check")
            body, poses, result = work.plain.body, work.plain.poses, work.result()
        facts = {
            "result": result,
            "outcome_of_rest": _outcomes_of_rests(poses, result),
            "tolerance": recipe.method.tolerance,
        }

    def make_before() -> RenderMesh:
        if before is not None:
            body = read_body(before)
            hull = convex_hull(body.points, single_precision=body.single_precision)
            return surface_to_draw(body.points, body.triangles, hull)
        if recipe is None:
            raise InputError(
                f"before_after: expected to know what {path} was made from, got a mesh alone; name "
                "that mesh with --before, or a recipe or a folder of a run instead"
            )
        return _draw_start(design_recipe(recipe, last="start"), path, poses.hull)

    return Subject(body, poses, upward, make_before, down=down, width=width, **facts)


def _read_die(folder: Path, recipe: Recipe) -> tuple[Body, RestPoses, Result]:
    """Body of a results folder, its rests and its result."""
    from dicedesign.results.folder import read_result

    result = read_result(folder)
    body = read_body(folder / PLAIN)
    # The file does not hold a given center of mass.
    given = None if recipe.center_of_mass is None else result.center_of_mass
    return body, rest_poses(body, given).under(recipe.density_prior()), result


def _outcomes_of_rests(poses: RestPoses, result: Result) -> Integers:
    """(k,) number of the outcome of each rest of a die, or -1 for none."""
    # Equally probable rests may have another order than in the run.
    normals = np.array([facet.normal for facet in result.facets]).reshape(-1, 3)
    facets = facet_of_rest(poses.normals, normals).tolist()
    outcomes = [result.facets[k].outcome if k >= 0 else None for k in facets]
    return np.array([-1 if name is None else result.labels.index(name) for name in outcomes])


def _draw_start(work: Work, path: Path, die_hull: ConvexHull) -> RenderMesh:
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
    moved = (points - hull.centroid) * (die_hull.diameter / hull.diameter) + die_hull.centroid
    return surface_to_draw(moved, triangles, hull)
