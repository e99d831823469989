"""What is not asked for is not imported, not allocated and not computed."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse.linalg
import torch
import trimesh
from common.blade import blade
from common.dented_cube import write_cube

from dicedesign import rest_poses
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient import rest_probabilities as differentiable
from dicedesign.kernels import ops as kernels
from dicedesign.optimize.energy import Objective
from dicedesign.optimize.options import PaperOptions, PaperWeights, SobolevOptions
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.optimize.solvers.descent import LineSearch
from dicedesign.optimize.solvers.paper import solve_paper
from dicedesign.optimize.starts.shapes import hendecahedron
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import sum_of_dice
from dicedesign.optimize.terms import TERMS
from dicedesign.rest import morse, poses
from dicedesign.rest.equilibria import ExactSigns, classify
from dicedesign.rest.morse import separatrices
from dicedesign.rest.roll import roll_steps
from tests.reference.extremes import large

SOLVERS = {"clarabel", "osqp", "piqp", "proxsuite", "quadprog", "cvxpy", "highspy", "qpsolvers"}
"""Modules that solve quadratic programs."""


REGULARIZERS = ("coplanar", "barycenter", "neighbor", "apart")


def modules_after(arguments: list[str], folder: Path) -> set[str]:
    """Modules, the package's own among them, that a command in a new process has loaded."""
    script = (
        "import json, sys; from dicedesign.cli.main import main; code = main(sys.argv[1:]);"
        "print(json.dumps([name for name, module in sys.modules.items() if module is not None]));"
        "sys.exit(code)"
    )
    command = [sys.executable, "-c", script, *arguments]
    # Where nothing can be written at home, libraries have warnings of their own.
    home = {**os.environ, "HOME": os.path.join(sys.executable, "home")}
    done = subprocess.run(
        command, cwd=folder, env=home, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def descend(**options: Any) -> DesignResult:
    """Some steps of the design of a die that rolls the total of two."""
    center = options.pop("center_of_mass", None)
    given = {"step": "line_search", "steps": 4, "finish": "none", **options}
    target = sum_of_dice([6, 6]).probabilities
    return solve_paper(
        hendecahedron("circus"), target, PaperOptions(**given), center_of_mass=center
    )


def forbidden(*arguments: object, **options: object) -> None:
    raise AssertionError("this was not asked for")


def replace_term(monkeypatch: pytest.MonkeyPatch, term: str, **parts: Any) -> None:
    """Give a term of the energy other functions."""
    TERMS._read()
    monkeypatch.setitem(TERMS._entries, term, replace(TERMS[term], **parts))


@pytest.fixture
def count_calls(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any, str], list[tuple[Any, ...]]]:
    """Replaces a function of a module or class by itself, and lists the arguments of its calls."""

    def count(owner: Any, name: str) -> list[tuple[Any, ...]]:
        calls: list[tuple[Any, ...]] = []
        original = getattr(owner, name)

        def spy(*arguments: Any, **options: Any) -> Any:
            calls.append(arguments)
            return original(*arguments, **options)

        monkeypatch.setattr(owner, name, spy)
        return calls

    return count


# A query.


@pytest.mark.parametrize("suffix", ["obj", "stl", "off", "ply", "glb", "3mf"])
def test_a_query_loads_nothing_heavy(tmp_path: Path, suffix: str) -> None:
    trimesh.creation.box().export(tmp_path / f"box.{suffix}")
    loaded = modules_after(["rest", f"box.{suffix}", "--json"], tmp_path)
    heavy = {"torch", "manifold3d", "matplotlib", "pydantic", "fontTools", "mpmath", "tqdm"}
    heavy |= {"uharfbuzz"}
    if suffix in ("obj", "stl", "off"):
        heavy |= {"trimesh", "lxml"}
    assert loaded & (heavy | SOLVERS) == set()
    assert not [name for name in loaded if name.startswith("dicedesign.rest.prior")]
    floors = {name.split(".")[1] for name in loaded if name.startswith("dicedesign.")}
    assert floors & {"optimize", "fabricate", "report", "recipe", "results", "concave"} == set()


def test_a_query_in_python_loads_nothing_heavy(repository: Path) -> None:
    code = (
        "import sys, numpy, dicedesign; "
        "dicedesign.rest_poses(numpy.random.default_rng(0).normal(size=(9, 3))); "
        "print(sorted({'torch', 'manifold3d', 'matplotlib', 'trimesh'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=repository)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


def test_posing_a_mesh_loads_nothing_heavy(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "box.stl")
    loaded = modules_after(["pose", "box.stl", "--out", "posed.obj"], tmp_path)
    heavy = {"torch", "manifold3d", "matplotlib", "pydantic", "fontTools", "trimesh", "PIL", "tqdm"}
    assert loaded & (heavy | SOLVERS) == set()


def test_a_figure_of_a_mesh_and_a_room_load_no_torch(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box().export(tmp_path / "meshes" / "box.stl")
    loaded = modules_after(["figure", "paths", "meshes/box.stl"], tmp_path)
    assert loaded & {"torch", "manifold3d", "pydantic"} == set()
    room = ["scatter", "meshes", "--count", "3", "--out", "room.glb", "--figure", "room.png"]
    assert modules_after(room, tmp_path) & {"torch", "manifold3d", "pydantic"} == set()


def test_the_figure_of_a_query_loads_only_its_libraries(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "box.stl")
    loaded = modules_after(["rest", "box.stl", "--figure", "map.png"], tmp_path)
    assert {"matplotlib", "dicedesign.report.gauss_map"} <= loaded
    others = {"bar_charts", "curve_charts", "solid_figures", "renderer", "pages"}
    assert loaded & {f"dicedesign.report.{name}" for name in others} == set()
    assert loaded & {"torch", "manifold3d", "trimesh"} == set()


def test_saddles_that_divide_nothing_are_not_traced(
    monkeypatch: pytest.MonkeyPatch,
    count_calls: Callable[[Any, str], list[tuple[Any, ...]]],
) -> None:
    """Bodies released on both sides of each saddle show which saddles divide basins."""
    hull = blade(40, 100)
    equilibria = classify(hull, np.zeros(3))
    saddles = np.flatnonzero(equilibria.saddle & (np.arange(len(hull.tail)) < hull.twin))
    sides = np.stack([hull.facet[saddles], hull.facet[hull.twin[saddles]]], axis=1)
    ends = np.array(
        [[roll_steps(equilibria, hull.normals[f])[-1].down for f in pair] for pair in sides]
    )
    apart = np.abs(ends[:, 0] - ends[:, 1]).max(axis=1) > 1e-9
    assert 10 < apart.sum() < len(saddles) - 10
    calls = count_calls(morse, "ascend")
    np.testing.assert_array_equal(separatrices(equilibria).saddles, saddles[apart])
    monkeypatch.setattr(kernels, "compiled", None)
    separatrices(equilibria)
    np.testing.assert_array_equal(calls[-1][1], np.repeat(saddles[apart], 2))


def test_probabilities_make_no_transforms_and_no_polylines(
    count_calls: Callable[[Any, str], list[tuple[Any, ...]]],
) -> None:
    calls = count_calls(poses, "standing_transform")
    answer = rest_poses(np.random.default_rng(5).normal(size=(20, 3)))
    assert not calls
    assert "polylines" not in vars(answer.morse)
    assert len(answer.transforms) == len(calls) == len(answer.probabilities)
    assert len(answer.morse.polylines) == len(answer.morse.saddles)


def test_exact_arithmetic_decides_signs_that_rounding_leaves_open(
    count_calls: Callable[[Any, str], list[tuple[Any, ...]]],
) -> None:
    calls = [count_calls(ExactSigns, name) for name in ("growth", "side", "ascend", "descend")]
    rest_poses(np.random.default_rng(5).normal(size=(200, 3)))
    assert not any(calls)
    # A block that widens upward, its center of mass straight above an edge of its foot.
    foot = np.array([(x, y, 0.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    block = convex_hull(np.concatenate([foot, 2.0 * foot + [0.0, 0.0, 2.0]]))
    separatrices(classify(block, [1.0, 0.0, 1.0]))
    assert any(calls)


# A design.


@pytest.mark.parametrize("term", REGULARIZERS)
def test_a_term_without_weight_is_not_called(monkeypatch: pytest.MonkeyPatch, term: str) -> None:
    monkeypatch.setattr(kernels, "compiled", None)
    replace_term(monkeypatch, term, evaluate=forbidden)
    result = descend(weights=PaperWeights(**{term: 0.0}))
    assert term not in result.terms
    assert len(result.history) >= 5
    with pytest.raises(AssertionError, match="not asked for"):
        descend(weights=PaperWeights(**{term: 0.1}))


def test_a_fixed_center_of_mass_takes_no_mass_gradient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("hull_centroid", "centroid_gradient"):
        monkeypatch.setattr(differentiable, name, forbidden)
    result = descend(center_of_mass=np.array([0.01, 0.0, 0.02]))
    assert len(result.history) >= 5
    with pytest.raises(AssertionError, match="not asked for"):
        descend()


@pytest.mark.parametrize("step", ["momentum", "line_search"])
def test_without_sobolev_there_is_no_laplacian_and_no_factor(
    monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    for name in ("scipy.sparse.csc_array", "scipy.sparse.linalg.splu"):
        monkeypatch.setattr(name, forbidden)
    assert len(descend(step=step).history) >= 5
    with pytest.raises(AssertionError, match="not asked for"):
        descend(step=step, sobolev=SobolevOptions())


def test_the_sobolev_factor_lasts_as_long_as_the_edges(
    count_calls: Callable[[Any, str], list[tuple[Any, ...]]],
) -> None:
    factors = count_calls(scipy.sparse.linalg, "splu")
    searches = count_calls(LineSearch, "search")
    points = large(30).points
    start = Start(points, rest_poses(points).normals[:4])
    options = PaperOptions(step="line_search", steps=40, finish="none", sobolev=SobolevOptions())
    solve_paper(start, np.full(4, 0.25), options)
    edges = []
    for _, at, _ in searches:
        hull = at.rests.hull
        edges.append(frozenset(zip(hull.tail.tolist(), hull.head.tolist(), strict=True)))
    changes = sum(edges[i] != edges[i - 1] for i in range(1, len(edges)))
    assert 0 < changes < len(edges) - 5
    assert len(factors) == 1 + changes


def test_rejected_trials_have_no_gradient(
    count_calls: Callable[[Any, str], list[tuple[Any, ...]]],
) -> None:
    gradients = count_calls(torch.autograd, "grad")
    evaluations = count_calls(Objective, "evaluate")
    searches = count_calls(LineSearch, "search")
    result = descend(steps=60)
    assert len(evaluations) == result.evaluations
    assert len(gradients) <= len(searches)
    assert len(evaluations) > len(searches) + 1


# A recipe.

PLAIN = "name: d4\nseed: 1\ntarget: {fair: 4}\nstart: {repulsion: {}}\nengrave: false\n"


def test_a_plain_convex_recipe_loads_no_engraver_and_no_solver(tmp_path: Path) -> None:
    (tmp_path / "d4.yaml").write_text(PLAIN)
    loaded = modules_after(["run", "d4.yaml", "--out", "d4"], tmp_path)
    assert {"torch", "dicedesign.recipe.pipeline"} <= loaded
    others = {"manifold3d", "trimesh", "lxml", "uharfbuzz", "matplotlib.pyplot"}
    others |= {"sympy", "mpmath", "functorch", "torch._dynamo", "OCP"}
    assert loaded & (others | SOLVERS) == set()
    own = {name for name in loaded if name.startswith("dicedesign.")}
    # What a recipe may say of a concave die is read, what makes one is not.
    concave = {name for name in own if name.startswith("dicedesign.concave")}
    assert concave == {
        "dicedesign.concave",
        "dicedesign.concave.options",
    }
    assert not any(name.startswith(("benchmarks", "tests")) for name in own)
    engravers = {"fonts", "label_layout", "label_art", "engraving"}
    assert own & {f"dicedesign.fabricate.{name}" for name in engravers} == set()
    stages = json.loads((tmp_path / "d4" / "result.json").read_text())["stages"]
    assert [stage["name"] for stage in stages] == [
        "start", "load", "design", "export", "check", "printing", "tolerances", "figures", "report",
    ]  # fmt: skip
    assert all(stage["seconds"] >= 0.0 for stage in stages)
    assert all(50.0 < stage["peak_mb"] < 5000.0 for stage in stages)


CONCAVE = """
name: cube
target: {fair: 6}
start: {mesh: {path: cube.obj}}
method: {concave: {attempts: 1}}
"""


def test_a_plain_concave_recipe_loads_no_engraver_no_solver_and_no_remesher(tmp_path: Path) -> None:
    """But what `test_a_plain_convex_recipe_loads_no_engraver_and_no_solver` finds missing."""
    write_cube(tmp_path / "cube.obj")
    (tmp_path / "cube.yaml").write_text(CONCAVE)
    loaded = modules_after(["run", "cube.yaml", "--no-figures", "--out", "cube"], tmp_path)
    assert {"dicedesign.concave.search", "dicedesign.concave.hull_design"} <= loaded
    assert {"dicedesign.recipe.concave", "manifold3d"} <= loaded
    others = {"fast_simplification", "trimesh", "fontTools", "uharfbuzz", "matplotlib"}
    engravers = {"fonts", "label_layout", "label_art", "marks"}
    others |= {f"dicedesign.fabricate.{name}" for name in engravers}
    assert loaded & (others | SOLVERS) == set()


def test_the_solvers_looked_for_are_those_that_can_be_loaded() -> None:
    """Else none would be found whatever is loaded."""
    assert "clarabel" in SOLVERS
    assert importlib.util.find_spec("clarabel") is not None
    assert importlib.util.find_spec("fast_simplification") is not None
