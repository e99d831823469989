"""Correction of finished objects whose labels and edges change their probabilities.

The facets of a convex shape are moved until the object made from it, measured as it will be
written, has the target probabilities: labels shift the center of mass, and with it the
probabilities, by some 1e-4. A body of any shape is stretched along three axes by a few parts in a
thousand. Lengths are in millimeters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import torch

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.gradient.probability_model import RESTING, ProbabilityModel
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.coordinates import (
    FacetCoordinates,
    LinkedCoordinates,
    normals_of,
    tie_coordinates,
)
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker, LevenbergMarquardt
from dicedesign.rest.outcomes import assign_rests, outcome_probabilities
from dicedesign.rest.poses import analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import BALANCED_PROBABILITIES, FILE_PROBABILITIES

MOST_ROUNDS = 6
"""Limit on the objects that are made and measured after the first; labels alone need three."""

SLOW = 0.3
"""Largest ratio of the errors after and before two rounds."""

NUDGES = (0.0, 1e-7, 1e-5, 1e-3, 1e-2)
"""Sizes of random changes of the parameters of a shape, tried in order until one leads to the
probabilities: a tied shape, which may be symmetric, has no derivatives, and a thrown one has
kinks."""

FOLD = float(np.radians(2.0))
"""Angle between two facets, in radians, below which they move together. If one of two planes that
almost coincide turns, the edge between them moves far, and a label with it."""

RANK = 1e-8
"""Relative singular values below which differences between guesses are ignored."""


@dataclass(frozen=True)
class Measured:
    """Center of mass (3,) of a solid, and the probabilities (k,) of its outcomes."""

    center_of_mass: Floats
    probabilities: Floats


class Labeled(Protocol):
    """Makes an object from a plain shape and labels on its facets."""

    def make_balanced(self, core: ConvexHull, placements: Sequence[Any]) -> Surface:
        """Make the solid by which the object is measured."""

    def carry_labels(
        self,
        placements: Sequence[Any],
        before: ConvexHull,
        after: ConvexHull,
        moved_normals: Floats,
    ) -> tuple[Any, ...]:
        """Move labels from the facets of a hull to another. moved_normals: (m, 3) normals in the
        second hull of the facets of the first."""

    def bearing(self, placements: Sequence[Any]) -> Floats:
        """Normals (l, 3) of the facets with labels."""


@dataclass(frozen=True, eq=False)
class Reshaped:
    """An object, and the plain shape it is made from.

    Attributes
    ----------
    surface: surface of the object, by which it was measured.
    core: the plain shape. placements: labels on its facets.
    measured: measurement of the object; first: measurement of the object made from the given shape.
    errors: largest |p - q| of the objects of all rounds; the first is made from the given shape.
    """

    surface: Surface
    core: ConvexHull
    placements: tuple[Any, ...]
    measured: Measured
    first: Measured
    errors: tuple[float, ...]


def reshape(
    core: ConvexHull,
    directions: Floats,
    placements: Sequence[Any],
    target: Floats,
    labeled: Labeled,
    measure: Callable[[Surface, Floats], Measured],
    *,
    rounds: int = MOST_ROUNDS,
    model: ProbabilityModel = RESTING,
    outcome_of: Integers | None = None,
) -> Reshaped:
    """Reshape a plain shape until the object made from it has the target probabilities.

    The object differs from the plain shape in its center of mass and in a rest of its
    probabilities. Each round makes and measures the object, and moves the half-spaces of the shape
    ( `FacetCoordinates`) the shortest way to where a plain shape with these differences has the
    target. As labels follow their facets, each round leaves a hundredth of the error. The best
    object of all rounds is returned.

    The new shape changes the differences. Anderson's method (J. ACM 12, 1965) corrects the guesses:
    by the mean of all before whose changes cancel best.

    Parameters
    ----------
    core: the plain shape, with a rest for each labeled face and no other.
    directions: (f, 3) normals of the faces' facets.
    placements: labels on facets of the shape.
    target: (k,) target probabilities of the object.
    labeled: makes the object; measure: measures it, with the directions of its faces.
    rounds: limit on the objects that are made and measured after the first.
    model: of the probabilities.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.

    Raises
    ------
    DiceError: the object of the given shape cannot be made or measured.
    """
    labels, size = tuple(placements), core.diameter
    surface = labeled.make_balanced(core, labels)
    first = measured = measure(surface, directions)
    errors = [float(np.abs(first.probabilities - target).max())]
    best = Reshaped(surface, core, labels, first, first, ())
    # Offsets of the center of mass over the size, and differences of the probabilities; both are 0
    # for the plain shape.
    guessed, images = [np.zeros(3 + len(target))], list[Floats]()
    for _ in range(rounds):
        if min(errors) <= BALANCED_PROBABILITIES or (
            len(errors) > 2 and errors[-1] > SLOW * errors[-3]
        ):
            break
        try:
            offset = measured.center_of_mass - core.centroid
            rests = evaluate_rests(torch.from_numpy(core.vertices), offset=offset)
            normals = rests.hull.normals[rests.facets]
            on_rests = model.probabilities(rests)
            plain = assign_rests(normals, on_rests, directions, outcome_of).probabilities
            images.append(np.concatenate([offset / size, measured.probabilities - plain]))
            changes, guess = np.stack(images) - np.stack(guessed), images[-1]
            if len(images) > 1:
                by_guess = np.diff(changes, axis=0).T
                weights = np.linalg.lstsq(by_guess, changes[-1], rcond=RANK)[0]
                guess = guess - weights @ np.diff(images, axis=0)
            guessed.append(guess)

            bearing = np.concatenate([directions, labeled.bearing(labels)])
            coordinates, parameters = tie_coordinates(core, bearing, FOLD)
            maker = CandidateMaker(None, guess[:3] * size, model=model, outcome_of=outcome_of)
            shape = _solve(coordinates, parameters, directions, target - guess[3:], maker)
            if shape is None:
                break
            after = shape.rests.hull
            before, moved = (
                normals_of(coordinates.half_spaces(values))
                for values in (parameters, shape.parameters)
            )
            moved_normals = unit_vectors(moved[np.argmax(core.normals @ before.T, axis=1)])
            labels = labeled.carry_labels(labels, core, after, moved_normals)
            core, directions = after, shape.directions
            surface = labeled.make_balanced(core, labels)
            measured = measure(surface, directions)
        except DiceError:
            # A label does not fit any more, or the object has other rests.
            break
        errors.append(float(np.abs(measured.probabilities - target).max()))
        if errors[-1] == min(errors):
            best = Reshaped(surface, core, labels, measured, first, ())
    return replace(best, errors=tuple(errors))


def _solve(
    coordinates: FacetCoordinates | LinkedCoordinates,
    parameters: Floats,
    directions: Floats,
    wanted: Floats,
    maker: CandidateMaker,
) -> Candidate | None:
    """Find a shape nearby with probabilities (k,) as near as possible to the wanted ones; None if
    there is no die nearby."""
    best, random = None, np.random.default_rng(0)
    for nudge in NUDGES:
        moved = parameters + nudge * random.standard_normal(len(parameters))
        first = maker.attempt(coordinates, moved, directions)
        if first is None:
            continue
        end = LevenbergMarquardt(wanted, maker, 0.1 * BALANCED_PROBABILITIES).solve(first)
        if best is None or end.error(wanted) < best.error(wanted):
            best = end
        if best.error(wanted) <= BALANCED_PROBABILITIES:
            break
    return best


def largest_move(before: ConvexHull, after: ConvexHull) -> float:
    """Largest distance from a corner of a shape to the moved planes of its facets."""
    facets = np.argmax(before.normals @ after.normals.T, axis=1)[before.facet]
    heights = (before.vertices[before.tail] * after.normals[facets]).sum(1)
    return float(np.abs(heights - after.heights(np.zeros(3))[facets]).max())


STEP = 1e-6
"""Stretch of the difference quotients."""

MOST_STEPS = 20
"""Limit on the Newton steps from one stretch."""

LENGTHS = (0.0, *np.geomspace(3e-4, 1e-2, 31).tolist())
"""Sizes of random first stretches, tried in order until one leads to the probabilities. With many
corners these jump where a facet becomes a rest, which may be in the way."""

MOST_STRETCH = 0.03
"""Limit on the relative stretch along an axis, so that the shape is kept."""

GAINED = 0.5
"""Largest ratio of the errors of a better stretch and the best before."""

SHORTER = 0.5
"""Ratio of successive step lengths."""

STRETCH_RANK = 1e-6
"""Relative singular values below which a direction changes nothing, such as the size."""


@dataclass(frozen=True, eq=False)
class Stretched:
    """A stretched body.

    Attributes
    ----------
    matrix: (3, 3) symmetric, the linear map. surface: the stretched surface.
    directions: (f, 3) unit directions of the faces after the stretch.
    unbalanced: (k,) probabilities before; errors: largest |p - q| before and after.
    """

    matrix: Floats
    surface: Surface
    directions: Floats
    unbalanced: Floats
    errors: tuple[float, float]


def stretch(
    surface: Surface,
    directions: Floats,
    target: Floats,
    prior: Prior | None = None,
    outcome_of: Integers | None = None,
) -> Stretched:
    """Stretch a solid until its probabilities are as near to the target as possible.

    A linear image keeps what is flat, convex, closed or in contact, and maps the center of mass to
    the center of mass. So the corners of the hull determine the probabilities after it. A stretch
    has five parameters besides the size, so that up to six outcomes can be met exactly. Newton's
    method takes the shortest way, with difference quotients.

    surface: surface of the solid; directions: (f, 3) unit, down on its faces; target: (k,)
    probabilities; prior: distribution of the start orientations, which is not stretched; None is
    uniform; outcome_of: (f,) outcome that each face shows; None for one outcome each. The best
    stretch is returned, and the identity if none is better. Raises DiceError if the body has no
    rests.
    """
    poses = rest_poses(surface)
    corners = poses.hull.vertices - poses.center_of_mass

    def probabilities_of(parameters: Floats, in_file: bool = False) -> Floats:
        """Probabilities (k,) after a stretch, rounded as in a file or not; infinite without
        rests."""
        matrix = _matrix(parameters)
        image = corners @ matrix.T
        if in_file:
            image = image.astype(np.float32).astype(np.float64)
        try:
            hull = convex_hull(image, single_precision=in_file)
            rests = analyze(hull, np.zeros(3)).under(prior)
        except DiceError:
            return np.full(len(target), np.inf)
        moved = _map_normals(directions, matrix)
        return outcome_probabilities(rests, moved, outcome_of).probabilities

    def error_of(probabilities: Floats) -> float:
        return float(np.linalg.norm(probabilities - target))

    def solve(parameters: Floats) -> tuple[Floats, Floats]:
        """Parameters at the end of Newton's method, and the probabilities there."""
        probabilities = probabilities_of(parameters)
        for _ in range(MOST_STEPS):
            if not 0.1 * BALANCED_PROBABILITIES < error_of(probabilities) < np.inf:
                break
            slopes = [
                (probabilities_of(parameters + h) - probabilities_of(parameters - h)) / 2.0
                for h in steps
            ]
            inverse = np.linalg.pinv(np.column_stack(slopes), rcond=STRETCH_RANK)
            step = -STEP * inverse @ (probabilities - target)
            while np.abs(step).max() > STEP * BALANCED_PROBABILITIES:
                if np.abs(parameters + step).max() <= MOST_STRETCH:
                    following = probabilities_of(parameters + step)
                    if error_of(following) < error_of(probabilities):
                        break
                step = SHORTER * step
            else:
                break
            parameters, probabilities = parameters + step, following
        return parameters, probabilities

    steps = STEP * np.eye(6)
    best, random = np.zeros(6), np.random.default_rng(0)
    first = best_probabilities = probabilities_of(best)
    for length in LENGTHS:
        end, probabilities = solve(length * random.standard_normal(6))
        most = max(2.0 * error_of(probabilities), FILE_PROBABILITIES)
        if (
            error_of(probabilities) < GAINED * error_of(best_probabilities)
            and error_of(probabilities_of(end, in_file=True)) <= most
        ):
            best, best_probabilities = end, probabilities
        if error_of(best_probabilities) <= BALANCED_PROBABILITIES:
            break
    matrix, center = _matrix(best), poses.center_of_mass
    image = surface.with_points(center + (surface.points - center) @ matrix.T)
    before, after = (
        float(np.abs(probabilities - target).max()) for probabilities in (first, best_probabilities)
    )
    return Stretched(matrix, image, _map_normals(directions, matrix), first, (before, after))


def _matrix(parameters: Floats) -> Floats:
    """Symmetric matrix (3, 3) of six parameters; zeros make the identity."""
    x, y, z, yz, xz, xy = parameters
    return np.eye(3) + np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])


def _map_normals(directions: Floats, matrix: Floats) -> Floats:
    """Unit normals (k, 3) of the images of planes with normals (k, 3)."""
    return unit_vectors(directions @ np.linalg.inv(matrix))
