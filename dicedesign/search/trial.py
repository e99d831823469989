"""One trial of a search: a recipe in, what its die is like out, both as plain data."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

from dicedesign.errors import NoStartError, OutsideHullError
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.schema.reading import checked_recipe

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
    recipe, started = checked_recipe(entries), time.perf_counter()
    try:
        work = design_recipe(recipe, last="check")
    except (NoStartError, OutsideHullError) as error:
        # The start depends on the seed, and so does whether a given center is inside.
        measured = dict.fromkeys(
            ("max_abs_error", "inradius_mm", "margin_deg", "asymmetry", "vertices", "down")
        )
        result = {"status": NO_DIE.lower(), "message": str(error), **measured}
    else:
        die = work.result()
        shown = [facet for facet in die.facets if facet.label is not None]
        is_complete = len(shown) == len(die.labels)
        # A tolerance above an outcome's probability is met without it.
        is_usable = is_complete or not die.converged
        result = {
            "status": die.status if is_usable else NO_DIE.lower(),
            "message": die.message,
            "max_abs_error": die.design.max_abs_error,
            "inradius_mm": min(facet.inradius_mm for facet in shown) if is_complete else None,
            "margin_deg": min(facet.border_deg for facet in shown) if is_complete else None,
            "asymmetry": die.asymmetry,
            "vertices": work.solid.points.tolist(),
            "down": list(die.facets[0].normal),
        }
    return {**result, "seconds": time.perf_counter() - started}
