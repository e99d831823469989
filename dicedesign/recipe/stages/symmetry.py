"""Stage symmetry: the point group of a die whose recipe leaves it open."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Final

import numpy as np

from dicedesign.errors import InputError, NoStartError
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.recipe.schema.symmetries import AUTO
from dicedesign.results.parts import Status

__all__ = ["choose_symmetry"]

TURNS: Final = 40
"""Starting shapes of a group, or turns of a search for them, that are looked at."""

TRIED: Final = 4
"""How many of these are led to the odds."""


def choose_symmetry(work: Work) -> None:
    """Give the recipe the most helpful point group (`fitting_groups`) that the start has and that
    leads to the odds, or none."""
    from dicedesign.optimize.starts.fitting_groups import fitting_groups
    from dicedesign.runtime.workers import one_tensor_thread

    target, recipe = work.target, work.recipe
    with one_tensor_thread():
        for name in fitting_groups(target.probabilities):
            work.recipe = recipe.model_copy(update={"symmetry": name})
            if _leads_there(work):
                break
        else:
            work.recipe = recipe.model_copy(update={"symmetry": None})
            work.notes.append("symmetry: no point group was found that suits the target")
            return
    equal = "all outcomes" if len(set(target.probabilities)) == 1 else "equally probable outcomes"
    work.notes.append(f"symmetry: {name}, which keeps {equal} equally frequent on every table")


def _leads_there(work: Work) -> bool:
    """Whether one of a few starts with the recipe's symmetry leads to the odds, with no other
    preference."""
    from dicedesign.optimize.preferences.preference import Preferences
    from dicedesign.recipe.methods.convex import wanted_odds
    from dicedesign.recipe.methods.exact import exact_options, solver, starts_of
    from dicedesign.recipe.methods.thrown import bare_sensitivity

    if not _start_has_it(work):
        return False
    wanted, options = wanted_odds(work.recipe), exact_options(work.recipe)
    quick = replace(options, prefer=Preferences(), starts=TRIED)
    sensitivity = bare_sensitivity(options, wanted) if options.odds == "thrown" else None
    starts = islice(starts_of(work, wanted), TURNS)
    try:
        result = solver(work)(starts, wanted, options=quick, sensitivity=sensitivity)
    except NoStartError:
        return False
    return result.status is Status.CONVERGED


def _start_has_it(work: Work) -> bool:
    """Whether a given start has the recipe's symmetry, facets of outcomes that are images of each
    other, and equal odds on these."""
    from dicedesign.optimize.coordinates.symmetric import (
        SymmetricCoordinates,
        orbits_of_directions,
    )
    from dicedesign.recipe.stages.start import check_orbits

    group, start = work.recipe.group(), work.start
    if start is None or group is None:
        return True
    try:
        check_orbits(work.recipe, start.directions)
        SymmetricCoordinates.of(start.points, np.zeros(3), group)
    except InputError:
        return False
    return bool(orbits_of_directions(start.directions, group).max() + 1 < len(start.directions))


STAGES.register(
    Stage(
        name="symmetry",
        line="finds the symmetry of a die whose recipe leaves it open",
        rank=17,
        wanted=lambda work: work.recipe.symmetry == AUTO,
        run=choose_symmetry,
    )
)
