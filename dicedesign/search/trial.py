"""One trial of a search: a recipe in, what its die is like out, both as plain data."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from dicedesign.errors import NoStartError, OutsideHullError
from dicedesign.fabricate.verdict import Verdict
from dicedesign.recipe.design_stage import design_die, make_start
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.summary import odds_summary
from dicedesign.rest.asymmetry import asymmetry, border_margins
from dicedesign.results.status import Status

__all__ = ["NO_DIE", "run_trial"]

NO_DIE: Final = "NO_DIE"
"""Beside the names of `Status`: there is no die that has a facet for each outcome."""


def run_trial(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Design the die of a recipe and measure it; nothing is engraved or written.

    entries: the recipe as plain data, as in `checked_recipe`.

    Returns plain data: "status" as in result.json, or "no_die"; "message"; "max_abs_error";
    "inradius_mm", radius of the smallest of the largest circles in the outcomes' facets, and
    "margin_deg", the least angle from an outcome's facet normal to the border of its basin, both
    None where an outcome has no facet; "asymmetry" (eq. 20); "vertices" (n, 3) in mm; "down" (3,),
    the most probable direction; "seconds". Where the start leads nowhere, all but the texts and the
    seconds are None.

    Raises InputError where no other seed would help: a mesh that cannot be read here, say.
    """
    import torch

    # Trials run side by side, one on each core.
    torch.set_num_threads(1)
    recipe, started = checked_recipe(entries), time.perf_counter()
    try:
        die = design_die(recipe, make_start(recipe))
    except (NoStartError, OutsideHullError) as error:
        # The start depends on the seed, and so does whether a given center is inside.
        measured = dict.fromkeys(
            ("max_abs_error", "inradius_mm", "margin_deg", "asymmetry", "vertices", "down")
        )
        result = {"status": NO_DIE.lower(), "message": str(error), **measured}
    else:
        verdict = die.verdict
        facets = odds_summary(verdict, die.target, None)["facets"]
        complete = bool((verdict.facet_of_outcome >= 0).all())
        radii = [facet["inradius_mm"] for facet in facets if facet["label"] is not None]
        # A tolerance above an outcome's probability is met without it.
        usable = complete or die.status is not Status.CONVERGED
        result = {
            "status": (die.status.name if usable else NO_DIE).lower(),
            "message": die.message,
            "max_abs_error": die.design.error if recipe.method.thrown else verdict.max_abs_error,
            "inradius_mm": min(radii) if complete else None,
            "margin_deg": _margin(verdict) if complete else None,
            "asymmetry": asymmetry(verdict.poses),
            "vertices": verdict.hull.vertices.tolist(),
            "down": verdict.poses.normals[0].tolist(),
        }
    return {**result, "seconds": time.perf_counter() - started}


def _margin(verdict: Verdict) -> float:
    """Degrees from the outcomes' facet normals to the nearest border of their basins."""
    labelled = np.isin(verdict.poses.facets, verdict.facet_of_outcome)
    return float(np.degrees(border_margins(verdict.poses)[labelled].min()))
