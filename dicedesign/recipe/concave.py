"""`method: concave`: a surface that is bent until its hull and its center of mass have the odds."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from itertools import count
from typing import Final

import numpy as np

from dicedesign.concave.options import ConcaveOptions, HullWeights
from dicedesign.concave.result import ConcaveDie, ConcaveProgress, ConcaveStep
from dicedesign.concave.search import checkpoint_bytes, make_concave_die, read_checkpoint
from dicedesign.errors import NoStartError
from dicedesign.fabricate.die import Design
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.sphere import angle_between
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.recipe import Recipe
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import CHECKPOINT
from dicedesign.results.parts import Search, Status, TradeOff
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import atomic_write
from dicedesign.tolerances import SAME_REST_ANGLE

_LIMITS: Final = ("displacement", "attempts", "enough", "seconds")
"""Options that say when a search ends, and not where it leads."""


def design_concave(work: Work) -> Design:
    """The die of a recipe, from its surface: the best of all attempts, be it as wanted or not, and
    the surface as it came where none led to any.

    Where results go to a folder, the state of the search is kept there after each attempt as
    `CHECKPOINT`.

    Raises
    ------
    InputError: the surface does not suit the target, or there is no checkpoint of the same search
        to resume.
    """
    recipe, surface, options = work.recipe, work.surface, concave_options(work.recipe)
    assert surface is not None
    search = _search_identity(recipe, surface)
    path = None if work.folder is None else work.folder / CHECKPOINT
    progress = ConcaveProgress(0, 0.0, None, (), ())
    if work.resume and path is not None:
        progress = read_checkpoint(path, search)
        work.kept = _kept(progress, options)

    def on_attempt(made: ConcaveProgress) -> None:
        nonlocal progress
        progress = made
        if path is not None:
            atomic_write(path, checkpoint_bytes(progress, search))
            work.kept = _kept(progress, options)
        work.listeners.on_attempt(_told(progress, options))

    numbers = count(0)
    work.listeners.on_attempt(_told(progress, options))
    try:
        made = make_concave_die(
            surface,
            work.target.probabilities,
            options,
            wall=None if options.hollow is None else options.hollow.wall_mm / recipe.size_mm,
            seed=recipe.seed,
            resume=progress,
            on_step=lambda step: work.listeners.on_step(_step(next(numbers), step)),
            on_attempt=on_attempt,
        )
    except NoStartError:
        made = _unchanged(surface, work.target.probabilities, progress)
    best = made.progress.best
    center = None if made.hollow is None else made.hollow.center_of_mass
    poses = rest_poses(make_body(made.after.points, made.after.triangles), center)
    work.search = Search(
        attempts=made.progress.attempts,
        seconds=made.progress.seconds,
        attempt=None if best is None else best.attempt,
        trade_off=_trade_off(made.progress, options),
    )
    return Design(
        status=Status.UNCHANGED if best is None else Status.CONVERGED,
        hull=made.hull,
        directions=made.directions,
        error=outcome_odds(poses, made.directions).error(work.target.probabilities),
        steps=tuple(_step(number, step) for number, step in enumerate(made.progress.history)),
        reshaped=made,
    )


def concave_options(recipe: Recipe) -> ConcaveOptions:
    """The options of a recipe whose method is concave."""
    assert recipe.method.concave is not None
    return recipe.method.concave


def _step(number: int, step: ConcaveStep) -> Step:
    return Step(
        number, step.seconds, step.energy, step.error, stage=step.stage, attempt=step.attempt
    )


def _search_identity(recipe: Recipe, surface: Surface) -> dict[str, str]:
    """What a search for a die depends on, by kind: two with the same go the same way, though one
    may end sooner."""
    options = asdict(concave_options(recipe))
    for name in _LIMITS:
        del options[name]
    target = recipe.target.target().probabilities.tolist()
    data = surface.points.tobytes() + surface.triangles.tobytes()
    if options["hollow"] is not None:
        options["size_mm"] = recipe.size_mm
    return {
        "target": json.dumps(target),
        "seed": str(recipe.seed),
        "method": json.dumps(options, default=HullWeights.as_dict),
        "surface": hashlib.sha256(data).hexdigest(),
    }


def _unchanged(surface: Surface, target: Floats, progress: ConcaveProgress) -> ConcaveDie:
    """The surface as it came, after a search that led to nothing. Its most probable rests are the
    outcomes, the likelier for the likelier; where there are too few, the last outcomes have none.
    """
    poses = rest_poses(make_body(surface.points, surface.triangles))
    downs: list[Floats] = []
    for normal in poses.normals[np.argsort(-poses.probabilities, kind="stable")]:
        if all(angle_between(normal, other) > SAME_REST_ANGLE for other in downs):
            downs.append(normal)
    places = np.minimum(np.arange(len(target)), len(downs) - 1)
    directions = np.empty((len(target), 3))
    directions[np.argsort(-target, kind="stable")] = np.array(downs)[places]
    corners = len(poses.hull.vertices)
    return ConcaveDie(surface, surface, poses.hull, directions, (corners, corners), progress)


def _trade_off(progress: ConcaveProgress, options: ConcaveOptions) -> TradeOff:
    return TradeOff(options.tolerance, options.apart_deg, options.margin_deg, progress.tried)


def _told(progress: ConcaveProgress, options: ConcaveOptions) -> str:
    """How far a search came, with its limits and what its best die is like, in one short line."""
    done = f"{progress.attempts} of {options.attempts} attempts"
    if options.seconds is not None:
        done += f", {progress.seconds:.0f} of {options.seconds:g} s"
    best = progress.best
    if best is None:
        return f"{done}, no die yet"
    trade_off = _trade_off(progress, options)
    draft = next(draft for draft in trade_off.drafts if draft.attempt == best.attempt)
    lacks = [status.name.lower() for status in trade_off.flaws(draft)]
    return (
        f"{done}, best moved by {100.0 * draft.displacement:.2g} %, error {draft.error:.1e}, "
        f"{' and '.join(lacks) or 'as wanted'}"
    )


def _kept(progress: ConcaveProgress, options: ConcaveOptions) -> str:
    return f"{_told(progress, options)}; run it again with --resume to go on"
