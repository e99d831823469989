"""What designs of convex dice refuse: options, targets, starts, symmetries and bodies.

`tests/cli/test_refusals.py` has what a command line can say wrong about targets."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from dicedesign.errors import DegenerateBodyError, InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates import (
    FacetCoordinates,
    SymmetricCoordinates,
    orbits_of_directions,
)
from dicedesign.optimize.options import (
    ExactOptions,
    PaperOptions,
    PaperWeights,
    RefineOptions,
    SobolevOptions,
)
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.solvers.paper import solve_paper
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.shapes import hendecahedron, mesh_start, prism, repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import (
    binomial,
    fair,
    several_faces,
    sum_of_dice,
)
from dicedesign.recipe.reading import parse_recipe

NAN = float("nan")
UNEVEN = np.array([0.2, 0.3, 0.5])
HALVES = np.array([0.5, 0.5])
DIE = repulsion(6, 2)
CORNER = convex_hull(DIE.points).vertices[0]
SIXTHS = np.full(6, 1 / 6)
SIDES = np.concatenate([np.eye(3), -np.eye(3), np.eye(3)[:1] + 1e-7])
CUBE = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
UPWARD = np.array([(0.0, 0, 1), (0, 1, 0), (1, 0, 0), (0.1, 0.1, 0.9), (0.5, 0.2, 0.3)])

OPTIONS = [
    (ExactOptions, {"tolerance": 0.0}, "tolerance: expected a number of at least 1e-15"),
    (ExactOptions, {"sobolev": SobolevOptions()}, 'sobolev: expected coordinates "vertices"'),
    (ExactOptions, {"seconds": NAN}, "seconds: expected a finite number"),
    (ExactOptions, {"evaluations": 0}, "evaluations: expected a number of at least 1"),
    (PaperOptions, {"step": "newton"}, "step: expected 'momentum' or 'line_search', got 'newton'"),
    (PaperOptions, {"steps": -1}, "steps: expected a number of at least 0, got -1"),
    (SobolevOptions, {"smoothing": 0.0}, "smoothing: expected a number above 0"),
    (SobolevOptions, {"power": 5}, "power: expected a number of at most 4, got 5"),
    (RefineOptions, {"rounds": 0}, "rounds: expected a number of at least 1, got 0"),
    (RefineOptions, {"within": 1.0}, "within: expected a number below 1, got 1"),
    (PaperWeights, {"neighbor": NAN}, "neighbor: expected a number not below 0, got nan"),
    (PaperWeights, {"hold_margin": 0.0}, "hold_margin: expected a number above 0"),
    (Preferences, {"circles": -1.0}, r"circles: expected a number from 0 to 1e\+06, got -1"),
]

TARGETS = [
    (binomial, [0], "binomial: expected a whole number of at least 1, got 0"),
    (sum_of_dice, [[]], "expected at least one number of sides"),
    (several_faces, [["a", "a"], HALVES, [1, 2]], "got 'a' more than once"),
    (several_faces, [["a", "b"], HALVES, [0, 2]], "expected a whole number"),
]

STARTS = [
    (prism, [4, 0.0], "height: expected a positive number, got 0"),
    (prism, [4, 1.0, np.inf], "cap: expected a number not below 0, got inf"),
    (hendecahedron, ["cube"], "expected one of bisymmetric, circus, got 'cube'"),
    (repulsion, [3, 0], "expected at least 4 outcomes, got 3"),
    (mesh_start, [make_body(CUBE), 7], "expected a body with at least 7 rests.*, got 6"),
]

SYMMETRIES = [
    (OrbitLayouts, [HALVES, point_group("Oh")], "orbits have 48 facets, or 24 on mirror planes"),
    (shapes_near, {"target": UNEVEN, "seed": 0, "group": point_group("C2")}, "whole orbits"),
    (SymmetricCoordinates.of, [CUBE, np.zeros(3), point_group("C3")], "onto each other"),
    (
        SymmetricCoordinates.of,
        [CUBE + np.array([0.0, 0.0, 0.1]), np.zeros(3), point_group("Oh")],
        "at the same distance",
    ),
    (
        orbits_of_directions,
        [SIDES, point_group("C4")],
        "coincide",
    ),
]


FAR = np.array([9.0, 0.0, 0.0])
PAIR = Start(DIE.points, DIE.directions[:2])
FLAT = Start(np.eye(4, 3) * [1.0, 1.0, 0.0], DIE.directions)
VERTICES = ExactOptions(coordinates="vertices")
exact = partial(solve_exact, starts=[], target=HALVES)
paper = partial(solve_paper, start=DIE, options=PaperOptions())
thing = {"name": "x", "target": {"fair": 3}}
knot = {**thing, "start": {"shape": "knot"}, "method": "concave"}

SOLVERS = [
    (exact, {"options": VERTICES, "group": np.eye(3)[None]}, 'symmetry: expected coordinates "fac'),
    (exact, {"options": ExactOptions(), "least_circle": 0.5}, r"radius from 0 on and below 0\.5"),
    (
        exact,
        {"options": ExactOptions(), "group": np.eye(3)[None], "prior": "half:0,0,1"},
        "prior: expected no symmetry",
    ),
    (exact, {"starts": [PAIR], "options": ExactOptions()}, "one rest for each of 2 labeled faces"),
    (paper, {"target": fair(5).probabilities}, "expected 6 outcomes"),
    (parse_recipe, [{**knot, "engrave": {"style": "raised"}}], "concave"),
]


@pytest.mark.parametrize(
    ("make", "arguments", "text"), [*OPTIONS, *TARGETS, *STARTS, *SYMMETRIES, *SOLVERS]
)
def test_refused(make: Callable[..., object], arguments: list | dict, text: str) -> None:
    with pytest.raises(InputError, match=text):
        make(**arguments) if isinstance(arguments, dict) else make(*arguments)


@pytest.mark.parametrize(
    ("make", "arguments", "error"),
    [
        (paper, {"target": SIXTHS, "center_of_mass": FAR}, OutsideHullError),
        (paper, {"target": SIXTHS, "start": FLAT}, DegenerateBodyError),
        (FacetCoordinates.of, {"points": DIE.points, "origin": FAR}, DegenerateBodyError),
        (
            FacetCoordinates.of,
            {"points": DIE.points, "origin": CORNER * (1.0 + 1e-9)},
            DegenerateBodyError,
        ),
        (
            FacetCoordinates(np.zeros(3)).shape,
            {"parameters": np.append(UPWARD.ravel(), np.zeros(5))},
            DegenerateBodyError,
        ),
    ],
)
def test_bodies_refused(make: Callable[..., object], arguments: dict, error: type) -> None:
    with pytest.raises(error):
        make(**arguments)
