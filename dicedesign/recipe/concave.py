"""`method: concave`: bend a surface until its hull and center of mass give the probabilities."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace

import numpy as np

from dicedesign.concave.options import ConcaveOptions, HullWeights
from dicedesign.concave.result import ConcaveDie, ConcaveProgress
from dicedesign.concave.search import checkpoint_bytes, make_concave_die, read_checkpoint
from dicedesign.errors import NoStartError
from dicedesign.fabricate.die import Design
from dicedesign.fabricate.print_copies import PrintedCopies, total_variations
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import body_of
from dicedesign.geometry.sphere import angle_between
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.targets import Target
from dicedesign.recipe.pipeline import Work
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import analyze, rest_poses
from dicedesign.results.folder import CHECKPOINT
from dicedesign.results.parts import Search, Status, TradeOff
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.interrupts import hold_interrupts
from dicedesign.tolerances import SAME_REST_ANGLE

STOP_OPTIONS = ("displacement", "attempts", "enough", "seconds")
"""Options that end a search, without changing its path."""


def design_concave(work: Work) -> Design:
    """Design a die from the recipe's surface: the best of all attempts, or the unchanged surface.

    With a results folder, the state of the search is saved as `CHECKPOINT` after each attempt.

    Raises
    ------
    InputError: the surface does not suit the target, or there is no checkpoint of this search to
        resume.
    """
    recipe, surface, options = work.recipe, work.surface, work.recipe.method.options
    assert surface is not None
    target, of_face = work.target.face_probabilities, work.target.outcome_of_face
    is_shared = options.rests == "several"
    if is_shared:
        target, of_face = work.target.probabilities, np.arange(len(work.target.labels))
    size = {} if options.hollow is None else {"size_mm": recipe.size_mm}
    choices = {name: value for name, value in asdict(options).items() if name not in STOP_OPTIONS}
    # Searches with equal texts are identical, but for the size and the printer by which prints are
    # judged: a die that is too small, or fragile, is resumed with others, and judged again.
    identity = {
        "target": json.dumps(target.tolist()),
        "seed": str(recipe.seed),
        "method": json.dumps(choices | size, default=HullWeights.as_dict),
        "surface": hashlib.sha256(
            surface.points.tobytes() + surface.triangles.tobytes()
        ).hexdigest(),
    }
    path = None if work.folder is None else work.folder / CHECKPOINT
    progress = ConcaveProgress()
    within = np.pi if is_shared else SAME_REST_ANGLE

    def report(latest: ConcaveProgress) -> None:
        nonlocal progress
        progress, line = latest, _describe(latest, options)
        if path is not None and latest.attempts > 0:
            # An interrupt after the file is written must name it.
            with hold_interrupts():
                atomic_write(path, checkpoint_bytes(latest, identity))
                work.resume_note = f"{line}; run it again with --resume to go on"
        work.callbacks.on_part(latest.attempts, options.attempts, "attempts")
        work.callbacks.on_attempt(line)

    def judge_prints(
        bent: Surface, center: Floats, directions: Floats, outcome_of: Integers
    ) -> float:
        assert recipe.print is not None
        errors, printer = recipe.print.expected_errors, recipe.print.selected_printer
        scaled = (bent.points - center) * (recipe.size_mm / convex_hull(bent.points).diameter)
        poses = analyze(convex_hull(scaled), np.zeros(3))
        body = body_of(bent.with_points(scaled))
        copies = PrintedCopies.of(
            body,
            poses,
            directions,
            np.eye(3),
            errors.correlation_mm,
            is_flat=False,
            outcome_of=of_face[outcome_of],
            within=within,
        )
        worst = 0.0
        # How the finished die lies on the bed is not known yet.
        for up in range(3):
            lying = replace(copies, axes=np.roll(np.eye(3), up, axis=0))
            prints = lying.probabilities(errors, printer.layer_mm)
            off = total_variations(work.target.probabilities, prints[:, :-1])
            worst = max(worst, float(off.mean()))
        return worst

    if work.resume and path is not None:
        progress = read_checkpoint(path, identity)
    report(progress)
    try:
        die = make_concave_die(
            surface,
            target,
            options,
            wall=None if options.hollow is None else options.hollow.wall_mm / recipe.size_mm,
            judge_prints=None if recipe.print is None else judge_prints,
            seed=recipe.seed,
            resume=progress,
            on_step=work.callbacks.on_step,
            on_attempt=report,
        )
    except NoStartError:
        die = _keep_surface(surface, target, progress)
    progress, best = die.progress, die.progress.best
    center = None if die.hollow is None else die.hollow.center_of_mass
    poses = rest_poses(die.after, center)
    if is_shared:
        labels = tuple(work.target.labels[outcome] for outcome in die.outcome_of)
        shares = target / np.bincount(die.outcome_of)
        work.target = Target(labels, shares[die.outcome_of])
    work.search = Search(
        attempts=progress.attempts,
        seconds=progress.seconds,
        attempt=None if best is None else best.draft.attempt,
        trade_off=_trade_off(progress, options),
    )
    return Design(
        status=Status.UNCHANGED if best is None else Status.CONVERGED,
        hull=die.hull,
        directions=die.directions,
        error=outcome_probabilities(poses, die.directions, die.outcome_of, within).error(target),
        steps=progress.history,
        reshaped=die,
        outcome_of=work.target.outcome_of_face,
        within=within,
    )


def _keep_surface(surface: Surface, target: Floats, progress: ConcaveProgress) -> ConcaveDie:
    """Die of the unchanged surface, after a failed search. Its most probable rests are the
    outcomes, matched by rank; if there are too few, the last outcomes have none."""
    poses = rest_poses(surface)
    downs: list[Floats] = []
    for normal in poses.normals[np.argsort(-poses.probabilities, kind="stable")]:
        if all(angle_between(normal, other) > SAME_REST_ANGLE for other in downs):
            downs.append(normal)
    places = np.minimum(np.arange(len(target)), len(downs) - 1)
    directions = np.empty((len(target), 3))
    directions[np.argsort(-target, kind="stable")] = np.array(downs)[places]
    corners = len(poses.hull.vertices)
    outcome_of = np.arange(len(target))
    return ConcaveDie(
        surface, surface, poses.hull, directions, outcome_of, (corners, corners), progress
    )


def _trade_off(progress: ConcaveProgress, options: ConcaveOptions) -> TradeOff:
    limits = options.tolerance, *options.least_angles, options.prints_within
    return TradeOff(*limits, progress.tried)


def _describe(progress: ConcaveProgress, options: ConcaveOptions) -> str:
    """Line on the progress of a search and its best die."""
    done = f"{progress.attempts} of {options.attempts} attempts"
    if options.seconds is not None:
        done += f", {progress.seconds:.0f} of {options.seconds:g} s"
    if progress.best is None:
        return f"{done}, no die yet"
    best = progress.best.draft
    flaws = _trade_off(progress, options).flaws(best)
    return (
        f"{done}, best moved by {100.0 * best.displacement:.2g} %, error {best.error:.1e}, "
        f"{' and '.join(status.name.lower() for status in flaws) or 'no flaws'}"
    )
