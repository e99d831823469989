"""Extensions from outside the package: an energy term, a preference, a start and an engine."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from common.kernels import without_kernels

from dicedesign import rest_poses
from dicedesign.errors import InputError, RecipeError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.clusters import ClusteredRests, cluster
from dicedesign.optimize.energy import Energy
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.preferences import PREFERENCES, Preferences
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.solvers.paper import solve_paper
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.optimize.starts.start import STARTS, Task, build_start
from dicedesign.optimize.terms import TERMS, EnergyWeights, Term
from dicedesign.recipe.reading import read_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import Status
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import load_table

OUTSIDE = '''
"""One extension of each kind."""

from dataclasses import dataclass

import numpy as np

from dicedesign.extensions import ENGINES, PREFERENCES, STARTS, TERMS, Options
from dicedesign.extensions import Engine, Preference, StartKind, Term, TermOption
from dicedesign.starts import normalize_start

TERMS.register(
    Term(
        name="low_peaks",
        line="maxima of the outcomes' regions no farther than a height",
        evaluate=lambda state, weights: (
            (state.rests.vertices - state.rests.center_of_mass).norm(dim=1) - weights.peak_height
        ).relu().square().sum(),
        options=(
            TermOption(
                name="peak_height",
                default=0.5,
                line="above which a vertex pays",
                expected="a length above 0",
                remedy="leave it out for 0.5",
                allows=lambda height: height > 0.0,
            ),
        ),
    )
)

PREFERENCES.register(
    Preference(
        name="flat",
        line="facets of outcomes near the center of mass",
        residuals=lambda die: die.rests.facet_areas[die.facets].rsqrt(),
    )
)


@dataclass(frozen=True)
class Wedge(Options):
    """A tetrahedron, stretched."""

    stretch: float = 1.0


def wedge(options, task):
    corners = np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    return normalize_start(corners * [1.0, 1.0, options.stretch], -corners / np.sqrt(3.0))


STARTS.register(StartKind(name="wedge", line="a tetrahedron", options=Wedge, make=wedge))

ENGINES.register(
    Engine(
        name="set_down",
        line="as dice roll without momentum",
        title="set down",
        require=lambda: None,
        throw_states=lambda body, table, states: np.zeros(len(states), np.int64),
    )
)
'''


@pytest.fixture
def outside(tmp_path: Path) -> Iterator[None]:
    """Extensions that an outside module registers."""
    path = tmp_path / "outside.py"
    path.write_text(OUTSIDE)
    spec = importlib.util.spec_from_file_location("outside", path)
    assert spec is not None
    assert spec.loader is not None
    spec.loader.exec_module(importlib.util.module_from_spec(spec))
    names = {TERMS: "low_peaks", PREFERENCES: "flat", STARTS: "wedge", ENGINES: "set_down"}
    yield
    for registry, name in names.items():
        registry.unregister(name)


def read(tmp_path: Path, **entries: object) -> Recipe:
    path = tmp_path / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "target": {"fair": 4}, **entries}))
    return read_recipe(path)


def descent(**weights: float) -> dict[str, object]:
    return {"paper": {"step": "line_search", "finish": "none", "steps": 4, "weights": weights}}


def refused(tmp_path: Path, text: str, **entries: object) -> None:
    with pytest.raises(RecipeError, match=text):
        read(tmp_path, **entries)


def test_unregistered_extensions_are_unknown(tmp_path: Path) -> None:
    refused(tmp_path, "start.wedge: unknown key", start={"wedge": {}})
    method: dict[str, object] = descent(low_peaks=1.0)
    refused(tmp_path, "low_peaks: unknown key; .* install the extension", method=method)
    method = {"exact": {"prefer": {"flat": 1}}}
    refused(tmp_path, "prefer.flat: unknown key", method=method)
    method = {"exact": {"probabilities": "thrown", "refine": {"engine": "set_down"}}}
    refused(tmp_path, "engine: expected native.*, got 'set_down'", method=method)


@pytest.mark.usefixtures("outside")
def test_recipes_accept_extensions_with_their_options(tmp_path: Path) -> None:
    recipe = read(
        tmp_path,
        start={"wedge": {"stretch": 2.0}},
        method=descent(low_peaks=0.3, peak_height=0.25),
    )
    weights = recipe.method.paper.weights
    assert (weights.low_peaks, weights.peak_height, weights.coplanar) == (0.3, 0.25, 2.0)
    start = build_start(recipe.start.name, recipe.start.options, Task(4))
    assert np.ptp(start.points, axis=0).tolist() == [1.0, 1.0, 2.0]
    assert read(tmp_path, **recipe.as_dict()) == recipe
    exact = read(tmp_path, method={"exact": {"prefer": {"flat": 0.5}}}).method.exact
    assert exact.prefer == Preferences(flat=0.5)
    thrown = {"probabilities": "thrown", "refine": {"engine": "set_down"}}
    assert read(tmp_path, method={"exact": thrown}).method.exact.refine.engine == "set_down"


@pytest.mark.usefixtures("outside")
def test_invalid_uses_of_extensions_are_explained(tmp_path: Path) -> None:
    wedge: dict[str, object] = {"wedge": {}}
    refused(tmp_path, "stretch: .*number, got 'x'", start={"wedge": {"stretch": "x"}})
    refused(tmp_path, "unknown key; did you mean 'wedge'", start={"wegde": {}})
    text = "peak_height: expected a length above 0, got -1; leave it out for 0.5"
    refused(tmp_path, text, start=wedge, method=descent(peak_height=-1))
    with pytest.raises(InputError, match="energy term 'low_peaks': expected a name of its own"):
        TERMS.register(replace(TERMS["dice"], name="low_peaks"))
    TERMS.register(Term(name="peak_height", line="option of another term", evaluate=len))
    with pytest.raises(InputError, match=r"expected names of its own"):
        EnergyWeights()
    TERMS.unregister("peak_height")


@pytest.mark.usefixtures("outside")
def test_terms_without_a_kernel_are_added_to_the_energy(random_points) -> None:
    """Value and gradient of the sum; the gradient against finite differences."""
    points = random_points(3, 10, (1.0, 0.9, 1.15))
    directions = rest_poses(points).normals[:3]
    weights = EnergyWeights(low_peaks=0.7, neighbor_radius=0.9)

    def energy(vertices: np.ndarray, weights: EnergyWeights = weights) -> Energy:
        rests = evaluate_rests(torch.tensor(vertices, requires_grad=True))
        clusters = cluster(rests.hull.normals[rests.paths.rests], directions)
        return Energy(ClusteredRests(rests, clusters, np.full(3, 1 / 3)), weights)

    for way in (nullcontext, without_kernels):
        with way():
            whole, without = energy(points), energy(points, weights.replace(low_peaks=0.0))
        assert list(whole.terms) == [*without.terms, "low_peaks"]
        radii = np.linalg.norm(points - rest_poses(points).center_of_mass, axis=1)
        expected = 0.7 * (np.maximum(radii - 0.5, 0.0) ** 2).sum()
        assert whole.terms["low_peaks"] == pytest.approx(expected)
        for vertex, axis in ((0, 0), (2, 1), (5, 2)):
            step = np.zeros_like(points)
            step[whole.state.hull.source[vertex], axis] = 1e-6
            up, down = (sum(energy(points + moved).terms.values()) for moved in (step, -step))
            assert whole.gradient[vertex, axis] == pytest.approx((up - down) / 2e-6, rel=1e-5)
        assert np.abs(whole.gradient - without.gradient).max() > 0.1


@pytest.mark.usefixtures("outside")
def test_solvers_use_an_extra_term_and_an_extra_preference(tmp_path: Path) -> None:
    recipe = read(tmp_path, start={"wedge": {"stretch": 1.4}}, method=descent(low_peaks=500.0))
    result = solve_paper(
        build_start(recipe.start.name, recipe.start.options, Task(4)),
        recipe.target.target().probabilities,
        recipe.method.paper,
    )
    assert result.terms["low_peaks"] < result.history[0].terms["low_peaks"]

    def smallest_area(prefer: Preferences) -> float:
        starts = shapes_like(repulsion(6, 3), 1)
        next(starts)
        result = solve_exact(starts, np.full(6, 1 / 6), ExactOptions(prefer=prefer))
        assert result.status is Status.CONVERGED
        rests = evaluate_rests(torch.tensor(result.hull.vertices / result.hull.diameter))
        return float(rests.facet_areas[rests.paths.rests].min())

    assert smallest_area(Preferences(flat=1.0)) > smallest_area(Preferences())


@pytest.mark.usefixtures("outside")
def test_an_extra_engine_throws() -> None:
    cube = np.array(list(product((-1.0, 1.0), repeat=3)))
    body = rigid_body(make_body(cube), rest_poses(cube))
    throws = simulate(body, load_table("carpet"), 20, engine="set_down")
    assert throws.counts.tolist() == [20, 0, 0, 0, 0, 0]
    with pytest.raises(InputError, match=r"engine: expected native, .*set_down, got 'other'; take"):
        simulate(body, load_table("carpet"), 20, engine="other")


def test_reading_a_recipe_loads_no_torch_and_no_scipy(repository: Path) -> None:
    code = (
        "import sys; from pathlib import Path; "
        "from dicedesign.recipe.reading import read_recipe; "
        "[read_recipe(path) for path in Path('recipes').glob('*.yaml')]; "
        "print({'torch', 'scipy', 'matplotlib', 'manifold3d'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", code]
    assert subprocess.check_output(command, cwd=repository, text=True) == "set()\n"
