"""From a recipe to the surface of a concave die, and what a finished one does; nothing is written
here."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Final

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveDie
from dicedesign.concave.shapes.shapes import shape
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.meshes.stl import parsed_stl
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.closest_points import closest_points
from dicedesign.geometry.surfaces.quality import SurfaceQuality, surface_quality
from dicedesign.geometry.surfaces.remeshing import decimated, refined
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.rest.outcomes import ClusterOdds, cluster_odds
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILLED_GAP

__all__ = [
    "ConcaveStatus",
    "JudgedSurface",
    "concave_options",
    "judge_file",
    "make_input_surface",
    "outcomes_of_file",
    "search_identity",
]

_LIMITS: Final = ("displacement", "attempts", "seconds")
"""Options that say when a search ends, and not where it leads."""


class ConcaveStatus(Enum):
    """What a finished die is like; the value is the message."""

    CONVERGED = "reached the tolerance"
    OFF_TARGET = "the odds of the outcomes are off by more than the tolerance"
    STRAY = "the die also rests elsewhere, more often than the tolerance"
    LOOSE = "the surface does not fill the designed hull"
    SELF_INTERSECTING = "the surface meets itself"
    OPEN = "the surface is not closed, as rounded to the single precision of its file"
    UNPRINTABLE = "the surface cannot be cleaned for printing"


@dataclass(frozen=True, eq=False)
class JudgedSurface:
    """A finished die, by what its file holds.

    Attributes
    ----------
    surface: the die in mm as it was read from the file.
    poses: its rests, with the center of mass of the uniform solid.
    outcomes: what they count for.
    before: the same of the surface that the die was made from.
    gap: largest distance between the hull of the die and the designed one, over the diagonal of the
        die.
    intersections: pairs of triangles of the file that meet and should not.
    quality: of the surface before it was made printable, against the one that it was made from.
    failures: what is wrong; none for a die that converged.
    message: in a sentence.
    """

    surface: Surface
    poses: RestPoses
    outcomes: ClusterOdds
    before: ClusterOdds
    gap: float
    intersections: int
    quality: SurfaceQuality
    failures: tuple[ConcaveStatus, ...]
    message: str

    @property
    def status(self) -> ConcaveStatus:
        """The first failure, or CONVERGED."""
        return self.failures[0] if self.failures else ConcaveStatus.CONVERGED


def make_input_surface(recipe: Recipe) -> tuple[Surface, tuple[str, ...]]:
    """The surface that a concave recipe begins with, and what was repaired or changed, one sentence
    each.

    Raises InputError if it cannot be read, is no closed surface of one solid, or cannot be brought
    to the number of points.
    """
    choice, points = recipe.start, concave_options(recipe).points
    notes: tuple[str, ...] = ()
    if choice.mesh is not None:
        surface, notes = make_surface(read_body(Path(choice.mesh.path)))
    else:
        assert choice.shape is not None
        surface = shape(choice.shape)
    if points is not None:
        changed = refined if len(surface.points) < points else decimated
        surface, note = changed(surface, points)
        notes += (note,)
    return surface, notes


def concave_options(recipe: Recipe) -> ConcaveOptions:
    """The options of a recipe whose method is concave."""
    assert recipe.method.concave is not None
    return recipe.method.concave


def search_identity(recipe: Recipe, surface: Surface) -> dict[str, str]:
    """What a search for a die depends on, by kind: two with the same go the same way, though one
    may end sooner."""
    options = asdict(concave_options(recipe))
    for name in _LIMITS:
        del options[name]
    target = recipe.target.target().probabilities.tolist()
    data = surface.points.tobytes() + surface.triangles.tobytes()
    return {
        "target": json.dumps(target),
        "seed": str(recipe.seed),
        "method": json.dumps(options),
        "surface": hashlib.sha256(data).hexdigest(),
    }


def outcomes_of_file(data: bytes, directions: Floats) -> tuple[Surface, RestPoses, ClusterOdds]:
    """A solid as it stands in an STL file, its rests and what they count for.

    data: the content; directions: (k, 3) unit, where the outcomes are meant to be.
    """
    points, triangles = parsed_stl(data, Path("die.stl"))
    # The coordinates are those of the file, float32.
    body = make_body(points, triangles, "die.stl", single_precision=True)
    poses = rest_poses(body)
    assert body.triangles is not None
    surface = Surface(body.points, body.triangles)
    return surface, poses, cluster_odds(poses, directions)


def judge_file(
    recipe: Recipe, die: ConcaveDie, data: bytes, hull_points: Floats, printable: bool
) -> JudgedSurface:
    """What the finished die does.

    Parameters
    ----------
    recipe: what was wanted.
    die: how it was made.
    data: content of its STL file.
    hull_points: (v, 3) corners of the designed hull where they are in the file.
    printable: whether the surface could be cleaned for printing.
    """
    surface, poses, outcomes = outcomes_of_file(data, die.directions)
    before = rest_poses(make_body(die.before.points, die.before.triangles))
    gap = _gap(surface, poses, hull_points)
    intersections = len(intersecting_triangles(surface.points, surface.triangles))
    target, tolerance = recipe.target.target().probabilities, recipe.method.tolerance
    error = outcomes.max_abs_error(target)
    wrong = {
        ConcaveStatus.OFF_TARGET: error > tolerance,
        ConcaveStatus.STRAY: outcomes.elsewhere > tolerance,
        ConcaveStatus.LOOSE: gap > FILLED_GAP,
        ConcaveStatus.SELF_INTERSECTING: intersections > 0,
        ConcaveStatus.OPEN: poses.center_of_mass_source != "uniform solid",
        ConcaveStatus.UNPRINTABLE: not printable,
    }
    failures = tuple(status for status, found in wrong.items() if found)
    remarks = [status.value for status in failures] or [ConcaveStatus.CONVERGED.value]
    remarks.append(f"max |p - q| is {error:.3g}, elsewhere {outcomes.elsewhere:.3g}")
    if failures:
        remarks += _what_to_change(recipe, die, gap, intersections, outcomes)
    remarks += recipe.doubts()
    return JudgedSurface(
        surface=surface,
        poses=poses,
        outcomes=outcomes,
        before=cluster_odds(before, die.directions),
        gap=gap,
        intersections=intersections,
        quality=surface_quality(die.after, die.before),
        failures=failures,
        message="; ".join(remarks),
    )


def _gap(surface: Surface, poses: RestPoses, hull_points: Floats) -> float:
    """Over the diagonal: how far corners of the designed hull are from the surface, or the surface
    is outside of that hull."""
    inside = closest_points(surface, hull_points).distances.max()
    designed = convex_hull(hull_points)
    middle = designed.vertices.mean(axis=0)
    heights = (poses.hull.vertices - middle) @ designed.normals.T - designed.heights(middle)
    return float(max(inside, heights.max(), 0.0)) / surface.diagonal


def _what_to_change(
    recipe: Recipe, die: ConcaveDie, gap: float, intersections: int, outcomes: ClusterOdds
) -> Iterator[str]:
    """What else there is to say about a die that did not converge."""
    options, done = concave_options(recipe), die.progress.attempts
    missing = int((outcomes.rest_counts == 0).sum())
    if missing:
        yield f"{missing} outcomes have no side to rest on"
    if gap > FILLED_GAP:
        yield f"the hull is off by {gap:.2g} of the diagonal"
    if intersections:
        yield f"{intersections} pairs of triangles meet"
    yield f"this is the best of {done} attempt{'' if done == 1 else 's'}"
    if done >= options.attempts:
        yield "allow more with method.concave.attempts, or try another seed"
    else:
        yield "try another seed"
