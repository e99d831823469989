"""Runs with a given design, for tests of later stages."""

from __future__ import annotations

from typing import Any

import numpy as np

from dicedesign.fabricate.die import Design
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats

SIDES = np.concatenate([np.eye(3), -np.eye(3)])
"""Directions of the outcomes of a box."""


def box(x: float, y: float, z: float) -> Floats:
    """Corners (8, 3) of a box around the origin."""
    signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    return 0.5 * signs * (x, y, z)


def run_to_design(
    points: Floats,
    directions: Floats = SIDES,
    status: Status = Status.CONVERGED,
    target: Any = None,
    entries: dict[str, Any] | None = None,
    **known: Any,
) -> Work:
    """Run after the stage "design", with the hull of points (n, 3) as its result.

    target: target of the recipe; the default is the probabilities of the hull. entries: other
    entries of the recipe. known: other attributes of the design.
    """
    hull = convex_hull(points)
    if target is None:
        probabilities = outcome_probabilities(rest_poses(points), directions).probabilities
        target = {"probabilities": (probabilities / probabilities.sum()).tolist()}
    recipe = parse_recipe({"name": "die", "target": target, "engrave": False, **(entries or {})})
    work = Work(recipe)
    work.die = Design(status, hull, directions, known.pop("error", 0.0), (), **known)
    return work


def run_to_check(*arguments: Any, **options: Any) -> Work:
    """Run `run_to_design` up to the stage "check"."""
    work = run_to_design(*arguments, **options)
    run_stages(work, after="design", last="check")
    return work
