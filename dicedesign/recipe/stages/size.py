"""Stage size: a size at which the labels fit, where the recipe gives none."""

from __future__ import annotations

import math
from typing import Final

from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.tolerances import MOST_MM

__all__ = ["enlarge"]

LARGE_MM: Final = 100.0
"""Beyond this size a die takes long to print, and is hard to throw."""


def enlarge(work: Work) -> None:
    """Take the smallest whole number of millimetres at which the labels fit, if the recipe's size
    is too small for them; the recipe that is written says so."""
    from dicedesign.fabricate.die import make_solid
    from dicedesign.fabricate.labelled_facets import core_of, place_on_facets

    recipe = work.recipe
    assert recipe.engrave is not None
    try:
        solid = make_solid(work.die, recipe.size_mm)
        core = core_of(solid, recipe.edges)
        place_on_facets(solid, core, work.target.labels, recipe.engrave)
    except LabelRoomError as error:
        if error.size_mm > MOST_MM:
            return
        size_mm = float(math.ceil(error.size_mm))
        work.recipe = recipe.model_copy(update={"size_mm": size_mm})
        note = f"size_mm: {size_mm:g}, so that the labels fit"
        if size_mm > LARGE_MM:
            note += "; for a smaller die join rare outcomes, shorten labels or try another seed"
        work.notes.append(note)
    except EngravingError:
        # No size helps; engraving says why.
        pass


STAGES.register(
    Stage(
        name="size",
        line="enlarges a die whose labels do not fit, where no size was given",
        rank=30,
        wanted=lambda work: (
            work.enlarge and work.recipe.engrave is not None and work.die.reshaped is None
        ),
        run=enlarge,
    )
)
