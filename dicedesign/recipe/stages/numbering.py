"""Stage numbering: equally probable outcomes change places, so that the numbers suit the shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work

__all__ = ["number"]


def number(work: Work) -> None:
    """Number the designed die as the recipe says, where each outcome has a facet."""
    from dicedesign.fabricate.die import make_solid
    from dicedesign.fabricate.numbering import numbered

    die, target = work.die, work.target
    solid = make_solid(die, work.recipe.size_mm)
    main = solid.outcomes.main
    if (main < 0).any():
        work.notes.append("numbering: an outcome has no facet, so that all stay where they are")
        return
    facets = solid.poses.facets[main]
    numbering = numbered(
        solid.poses.hull, facets, target.labels, target.probabilities, work.recipe.numbering
    )
    # Where each outcome now is.
    place = np.argsort(numbering.order)
    work.die = replace(
        die,
        directions=die.directions[place],
        rounds=tuple(
            replace(done, asked=done.asked[place], frequencies=done.frequencies[place])
            for done in die.rounds
        ),
    )
    work.notes.append(numbering.note)


STAGES.register(
    Stage(
        name="numbering",
        line="lets equally probable outcomes change places, so that the numbers suit the shape",
        rank=22,
        wanted=lambda work: work.recipe.numbering != "given",
        run=number,
    )
)
