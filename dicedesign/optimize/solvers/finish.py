"""From a die of the paper's method, whose odds are near the target, to one that has them exactly.

The rests of an outcome become one half-space, and the exact method goes on from there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.errors import NoStartError
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.energy.clusters import cluster
from dicedesign.optimize.energy.energy import Evaluation, Objective
from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.optimize.solvers.descent import LineSearch
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.poses import RestPoses, analyse
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats

ABSORBED: Final = (0.0, 1.0, 3.0, 6.0, 10.0, 15.0)
"""Angles, in degrees, within which a facet near that of an outcome gives way to it: one after the
other is tried."""

SAME_FACET: Final = 2.0
"""Angle, in degrees, up to which the rests of an outcome are always one."""

SUNK: Final = 0.97
"""Height of a half-space over that of the shape, for an outcome that has lost its rest."""

REPAIRING: Final = EnergyWeights(
    coplanar=0.0, barycenter=0.0, neighbor=0.0, stability=0.1, stability_margin=0.03
)
"""Of the steps to a shape with one rest for each outcome and no other, where there are more."""

MOST_REPAIRS: Final = 150
"""How many of these steps."""

KEPT_ANGLE: Final = 0.35
"""Angle between two outcomes, in radians (20 degrees), below which the exact method tries to keep
them apart."""


def finished(
    result: DesignResult,
    target: Floats,
    options: PaperOptions,
    *,
    center_of_mass: Floats | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
    on_candidate: Callable[[Candidate], None] | None = None,
) -> DesignResult:
    """The result with odds (k,) that are exact to `options.tolerance`, and better by
    `options.prefer`; the result as it is where nothing led there.

    The history goes on from that of the result.
    """
    maker = CandidateMaker(center_of_mass)
    told: list[DesignStep] = []
    before = result.history[-1]

    def on_exact_step(step: DesignStep) -> None:
        last = result.history[-1]
        step = replace(step, step=last.step + 1 + step.step, seconds=last.seconds + step.seconds)
        told.append(step)
        if on_step is not None:
            on_step(step)

    exact = ExactOptions(tolerance=options.reached, prefer=options.prefer)
    try:
        end = solve_exactly(
            _starts(result, target, maker),
            target,
            exact,
            center_of_mass=center_of_mass,
            least_angle=KEPT_ANGLE,
            on_step=on_exact_step,
            on_candidate=on_candidate,
        )
    except NoStartError:
        end = None
    polars = maker.polars.built, maker.polars.reused
    shapes = maker.shapes.built, maker.shapes.reused
    result = replace(
        result,
        history=(*result.history, *told),
        evaluations=result.evaluations + maker.evaluations + (end.evaluations if end else 0),
        hulls_built=result.hulls_built + polars[0] + shapes[0] + (end.hulls_built if end else 0),
        hulls_reused=result.hulls_reused + polars[1] + shapes[1] + (end.hulls_reused if end else 0),
    )
    if end is None or end.status is not Status.CONVERGED:
        last = result.history[-1]
        back = replace(before, step=last.step + 1, seconds=last.seconds)
        if on_step is not None and told:
            on_step(back)
        return replace(result, history=(*result.history, *([back] if told else [])))
    return replace(
        result,
        status=end.status,
        hull=end.hull,
        directions=end.directions,
        error=end.error,
        terms=end.terms,
    )


def _starts(result: DesignResult, target: Floats, maker: CandidateMaker) -> Iterator[Start]:
    """Shapes near a result with one rest for each outcome and no other."""
    center = maker.center_of_mass
    poses = analyse(result.hull, result.hull.centroid if center is None else center)
    for angle in ABSORBED:
        coordinates, parameters, directions = flattened(poses, result.directions, angle)
        if (np.isnan(parameters)).any():
            continue
        candidate = maker.attempt(coordinates, parameters, directions)
        if candidate is None:
            objective = Objective(
                coordinates, target, REPAIRING, center, maker.shapes, maker.polars
            )
            first = objective.attempt(parameters, directions)
            repaired = None if first is None else _repaired(first, maker)
            if repaired is None:
                continue
            yield repaired
        else:
            yield Start(candidate.rests.hull.vertices, candidate.directions)


def flattened(
    poses: RestPoses, directions: Floats, angle: float
) -> tuple[FacetCoordinates, Floats, Floats]:
    """Half-spaces of a shape on which each outcome has one facet.

    Its normal is the mean of those of the outcome's rests near the most probable one, by their
    odds, and it lies as high as their corners do on average.

    Parameters
    ----------
    poses: rests of the shape. directions: (k, 3) unit directions of the outcomes.
    angle: in degrees, within which other facets give way to the nearest outcome's.

    Returns coordinates about the center of mass, their parameters, of which the first k half-spaces
    are the outcomes', and the normals (k, 3) of these.
    """
    hull, center = poses.hull, poses.center_of_mass
    of_rest = cluster(poses.normals, directions).of_rest
    heights = hull.heights(center)
    normals, distances = [], []
    replaced = np.zeros(len(hull.normals), dtype=bool)
    # Rests come the most probable first.
    first_of = [np.flatnonzero(of_rest == outcome)[:1] for outcome in range(len(directions))]
    mains = np.array(
        [
            poses.normals[first[0]] if len(first) else direction
            for first, direction in zip(first_of, directions, strict=True)
        ]
    )
    nearest = np.argmax(hull.normals @ mains.T, axis=1)
    for outcome, main in enumerate(mains):
        near = poses.normals @ main >= np.cos(np.radians(max(angle, SAME_FACET)))
        mine = np.flatnonzero(near & (of_rest == outcome))
        if len(mine) == 0:
            normals.append(main)
            distances.append(SUNK * float(((hull.vertices - center) @ main).max()))
            continue
        odds = poses.probabilities[mine]
        normal = odds @ poses.normals[mine]
        normal = normal / np.sqrt(normal @ normal)
        corners = [hull.polygon(int(facet)) - center for facet in poses.facets[mine]]
        weights = np.repeat(odds, [len(part) for part in corners])
        normals.append(normal)
        distances.append(float(weights @ (np.concatenate(corners) @ normal) / weights.sum()))
        replaced[poses.facets[mine]] = True
        within = hull.normals @ normal > np.cos(np.radians(angle))
        replaced |= within & (nearest == outcome)
    kept = np.flatnonzero(~replaced)
    units = np.concatenate([np.array(normals), hull.normals[kept]])
    lengths = np.concatenate([np.array(distances), heights[kept]])
    lengths = np.where(lengths > 0.0, lengths, np.nan)
    parameters = np.concatenate([units.ravel(), np.log(lengths)])
    return FacetCoordinates(center), parameters, units[: len(directions)]


def _repaired(first: Evaluation, maker: CandidateMaker) -> Start | None:
    """A shape with one rest for each outcome and no other that lies downhill; None where steps lead
    to none."""
    rule, current = LineSearch(), first
    coordinates = first.objective.coordinates
    for _ in range(MOST_REPAIRS):
        tried = rule.evaluations
        following = rule.search(current, current.gradient)
        maker.evaluations += rule.evaluations - tried
        if following is None:
            return None
        current = following.refreshed()
        if current.flaws == 0:
            candidate = maker.attempt(coordinates, current.parameters, current.directions)
            if candidate is not None:
                return Start(candidate.rests.hull.vertices, candidate.directions)
    return None
