"""Designs that are hard for a method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.shapes import prism, repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import binomial, custom, fair, sum_of_dice
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats
from tests.reference.problem import Case, DesignProblem
from tests.reference.stiff import off_balance

AXES = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])

METHODS = {
    ", paper, line search": {},
    ", exact": {"method": "exact", "tolerance": 1e-12, "steps": 3000},
    ", exact, vertices": {
        "method": "exact",
        "coordinates": "vertices",
        "tolerance": 1e-12,
        "steps": 150,
    },
    ", paper": {"method": "paper"},
    ", paper with finish": {"method": "paper with finish", "tolerance": 1e-12},
}
"""Additions to the name of a design, and changes of its fields."""

TOO_LONG = (("60 facets, fair", ", exact, vertices"),)
"""Combinations that are left out, as each step by preferences takes as long as another design."""


def design_cases() -> Iterator[Case]:
    """Yield every design with every method; quick ones converge quickly."""
    for name, build, quick in _designs():
        for method in METHODS:
            if (name, method) in TOO_LONG:
                continue
            yield Case(
                f"design: {name}{method}",
                partial(_by_method, build, method),
                quick=quick and method in (", paper, line search", ", exact"),
                kind=f"designs{method}",
            )


def _by_method(build: Callable[[], DesignProblem], name: str) -> DesignProblem:
    return replace(build(), **METHODS[name])


def _designs() -> Iterator[tuple[str, Callable[[], DesignProblem], bool]]:
    """Yield the name of each design, its maker, and whether it is quick."""
    for power in (3, 6, 9, 12):
        depth = 10.0**-power
        yield f"leans 1e-{power} short of tipping", partial(leaning, depth), True
        yield f"leans 1e-{power} beyond tipping", partial(leaning, -depth), True
    yield "leans on the verge of tipping", partial(leaning, 0.0), True
    yield "balances on a corner", _cornered, True
    for power in (4, 5, 6):
        improbable = partial(_improbable, 10.0**-power)
        yield f"two outcomes of 1e-{power}", improbable, False
        yield f"two outcomes of 1e-{power}, searched", partial(_searched, improbable), False
    yield "one outcome of 0.97", _lopsided, False
    for power in (3, 6):
        yield f"coin of 1e-{power}", partial(_coin, 10.0**-power), False
    for factor in (2, 10):
        yield f"needle {factor}:1", partial(_stretched, float(factor)), factor == 2
        yield f"plate 1:{factor}", partial(_stretched, 1.0 / factor), factor == 2
    for name, target in (
        ("30 facets, fair", fair(30)),
        ("30 facets, two dice", sum_of_dice([15, 16])),
        ("30 facets, 29 coins", binomial(29)),
        ("60 facets, fair", fair(60)),
    ):
        yield name, partial(_spread, target.probabilities), False
    for power in (3, 6, 9, 12):
        yield f"center 1e-{power} from a facet", partial(near_facet, 10.0**-power), power == 12
    for power in (3, 8):
        yield f"facets 1e-{power} apart in angle", partial(coincident, 10.0**-power), False
    yield "loaded cube", loaded_box, True
    yield "symmetric prism", _symmetric, True
    yield "tolerance 1e-12", _exact, False


def leaning(depth: float) -> DesignProblem:
    """A leaning box with two opposite facets that are stable by a depth, in units of its height and
    width; unstable for negative depths."""
    lean = 1.0 - 2.0 * depth
    points = np.array(
        [[x + lean * z, y, z] for x, y, z in product((-0.5, 0.5), (-0.6, 0.6), (-0.5, 0.5))]
    )
    normals = AXES.copy()
    normals[:2, 2] = (-lean, lean)
    start = Start(points, unit_vectors(normals))
    return DesignProblem(start, fair(6).probabilities, perturbation=0.0)


def near_facet(distance: float) -> DesignProblem:
    """A center of mass at a distance from the middle of a facet."""
    start = repulsion(6, 0)
    hull = convex_hull(start.points)
    center = hull.polygon(0).mean(axis=0) - distance * hull.normals[0]
    return DesignProblem(start, fair(6).probabilities, center_of_mass=center)


def coincident(angle: float) -> DesignProblem:
    """Two of the seven facets with outcomes include a small angle in radians."""
    normals = repulsion(7, 0).directions.copy()
    axis = np.cross(normals[0], [0.0, 0.0, 1.0])
    turn = Rotation.from_rotvec(angle * axis / norms(axis))
    normals[1] = turn.apply(normals[0])
    start = Start(polyhedron_corners(normals, np.ones(7)), normals)
    return DesignProblem(start, fair(7).probabilities)


def loaded_box() -> DesignProblem:
    """A cube with a target that favors one face: all its paths are ties."""
    start = Start(np.array(list(product((-1.0, 1.0), repeat=3))), AXES)
    return DesignProblem(start, custom([0.3, *[0.14] * 5]).probabilities, perturbation=0.0)


def _cornered() -> DesignProblem:
    problem = off_balance(0.0, corner=True)
    poses = rest_poses(problem.points, problem.center)
    target = fair(len(poses.normals)).probabilities
    start = Start(problem.points, poses.normals)
    return DesignProblem(start, target, center_of_mass=problem.center, perturbation=0.0)


def _improbable(probability: float) -> DesignProblem:
    target = custom([probability] * 2 + [0.25 - 0.5 * probability] * 4)
    tolerance = 0.1 * probability
    return DesignProblem(repulsion(6, 0), target.probabilities, tolerance=tolerance)


def _coin(probability: float) -> DesignProblem:
    target = np.array([1.0 - probability, probability])
    return DesignProblem(_near(target), target, tolerance=0.1 * probability)


def _searched(build: Callable[[], DesignProblem]) -> DesignProblem:
    problem = build()
    return replace(problem, start=_near(problem.target))


def _near(target: Floats) -> Start:
    """First shape of a recipe without a start."""
    return next(start for start in shapes_near(target, 0) if start is not None)


def _lopsided() -> DesignProblem:
    return DesignProblem(repulsion(4, 0), custom([0.97, 0.01, 0.01, 0.01]).probabilities)


def _stretched(factor: float) -> DesignProblem:
    sphere = repulsion(6, 0)
    directions = unit_vectors(sphere.directions / [1.0, 1.0, factor])
    return DesignProblem(
        Start(sphere.points * [1.0, 1.0, factor], directions), fair(6).probabilities
    )


def _spread(target: Floats) -> DesignProblem:
    return DesignProblem(repulsion(len(target), 0), target)


def _symmetric() -> DesignProblem:
    return DesignProblem(prism(4), fair(4).probabilities, perturbation=0.0)


def _exact() -> DesignProblem:
    target = custom([0.1, 0.1, 0.2, 0.2, 0.2, 0.2])
    return DesignProblem(repulsion(6, 0), target.probabilities, tolerance=1e-12)
