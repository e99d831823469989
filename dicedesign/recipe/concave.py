"""`method: concave`: a surface that is bent until its hull and its center of mass have the
probabilities."""

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
from dicedesign.rest.outcomes import outcome_probabilities
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
    recipe, surface, options = work.recipe, work.surface, work.recipe.method.concave
    assert surface is not None
    assert options is not None
    target, identity = work.target.probabilities, _search_identity(recipe, surface, options)
    path = None if work.folder is None else work.folder / CHECKPOINT
    progress = ConcaveProgress(0, 0.0, None, (), ())

    def tell(made: ConcaveProgress) -> None:
        nonlocal progress
        progress, told = made, _told(made, options)
        if path is not None and made.attempts > 0:
            work.resume_note = f"{told}; run it again with --resume to go on"
        work.callbacks.on_attempt(told)

    def on_attempt(made: ConcaveProgress) -> None:
        if path is not None:
            atomic_write(path, checkpoint_bytes(made, identity))
        tell(made)

    if work.resume and path is not None:
        progress = read_checkpoint(path, identity)
    tell(progress)
    numbers = count(0)
    try:
        made = make_concave_die(
            surface,
            target,
            options,
            wall=None if options.hollow is None else options.hollow.wall_mm / recipe.size_mm,
            seed=recipe.seed,
            resume=progress,
            on_step=lambda step: work.callbacks.on_step(_step(next(numbers), step)),
            on_attempt=on_attempt,
        )
    except NoStartError:
        made = _unchanged(surface, target, progress)
    progress, best = made.progress, made.progress.best
    center = None if made.hollow is None else made.hollow.center_of_mass
    poses = rest_poses(make_body(made.after.points, made.after.triangles), center)
    work.search = Search(
        attempts=progress.attempts,
        seconds=progress.seconds,
        attempt=None if best is None else best.attempt,
        trade_off=_trade_off(progress, options),
    )
    return Design(
        status=Status.UNCHANGED if best is None else Status.CONVERGED,
        hull=made.hull,
        directions=made.directions,
        error=outcome_probabilities(poses, made.directions).error(target),
        steps=tuple(_step(number, step) for number, step in enumerate(progress.history)),
        reshaped=made,
    )


def _step(number: int, step: ConcaveStep) -> Step:
    return Step(
        number, step.seconds, step.energy, step.error, stage=step.stage, attempt=step.attempt
    )


def _search_identity(recipe: Recipe, surface: Surface, options: ConcaveOptions) -> dict[str, str]:
    """What a search for a die depends on, by kind: two with the same go the same way, though one
    may end sooner."""
    method = {name: value for name, value in asdict(options).items() if name not in _LIMITS}
    if options.hollow is not None:
        method["size_mm"] = recipe.size_mm
    return {
        "target": json.dumps(recipe.target.target().probabilities.tolist()),
        "seed": str(recipe.seed),
        "method": json.dumps(method, default=HullWeights.as_dict),
        "surface": hashlib.sha256(
            surface.points.tobytes() + surface.triangles.tobytes()
        ).hexdigest(),
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
    lacks = _trade_off(progress, options).flaws(best.draft(progress.seconds))
    return (
        f"{done}, best moved by {100.0 * best.displacement:.2g} %, error {best.error:.1e}, "
        f"{' and '.join(status.name.lower() for status in lacks) or 'as wanted'}"
    )
