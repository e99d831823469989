"""The paper's method without one regularizer after the other, as in figure 9."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from dicedesign.optimize.energy.clusters import cluster
from dicedesign.optimize.paper_options import PaperWeights
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.recipe.methods.convex import normalised_center, wanted_odds
from dicedesign.recipe.planning.stage import plan
from dicedesign.recipe.planning.work import Listeners, Work
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.report.body_figures.body_figure import Ablation
from dicedesign.rest.poses import analyse
from dicedesign.runtime.workers import one_tensor_thread

__all__ = ["ablated"]


def ablated(
    recipe: Recipe, steps: int | None = None, on_step: Callable[[], None] = lambda: None
) -> list[Ablation]:
    """Dice of a recipe by the paper's descent, without a finish: with all terms, without one that
    has a weight after the other, and by the dice energy alone.

    steps: most of each descent; None for the recipe's. on_step: called after each. Raises as the
    recipe's design.
    """
    paper = recipe.method.paper
    assert paper is not None
    work = Work(recipe, None, Listeners())
    plan(work, last="start")
    assert work.start is not None
    center = normalised_center(recipe, work.start)
    weighted = [term.name for term, _ in paper.weights.active if term.weight is not None]
    cases = {"all terms": list[str](), **{f"without {name}": [name] for name in weighted}}
    if len(weighted) > 1:
        cases["odds alone"] = weighted
    dice = []
    with one_tensor_thread():
        for name, left_out in cases.items():
            weights = PaperWeights(**{**paper.weights.as_dict(), **dict.fromkeys(left_out, 0.0)})
            options = replace(
                paper,
                weights=weights,
                finish="none",
                tolerance=None,
                steps=paper.steps if steps is None else min(steps, paper.steps),
            )
            die = descend_as_paper(
                work.start,
                wanted_odds(recipe),
                options,
                center_of_mass=center,
                seed=recipe.seed,
                on_step=lambda _: on_step(),
            )
            poses = analyse(die.hull, die.hull.centroid if center is None else center)
            outcomes = cluster(poses.normals, die.directions).of_rest
            dice.append(Ablation(name, die.error, poses, outcomes))
    return dice
