"""What is not asked for is not imported."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import trimesh
from common.dented_cube import write_cube

SOLVERS = {"clarabel", "osqp", "piqp", "proxsuite", "quadprog", "cvxpy", "highspy", "qpsolvers"}
"""Modules that solve quadratic programs."""

SCRIPT = """
import json, sys
import numpy, dicedesign
from dicedesign.cli.main import main

def show():
    loaded = [name for name, module in sys.modules.items() if module is not None]
    print("loaded", json.dumps(loaded))

dicedesign.rest_poses(numpy.random.default_rng(0).normal(size=(9, 3)))
show()
for line in sys.argv[1:]:
    assert main(line.split()) == 0, line
    show()
"""


def modules_after(folder: Path, *lines: str) -> list[set[str]]:
    """Modules, the package's own among them, that a new process has loaded after a query in Python
    and after each command."""
    # Where nothing can be written at home, libraries have warnings of their own.
    home = {**os.environ, "HOME": os.path.join(sys.executable, "home")}
    command = [sys.executable, "-c", SCRIPT, *lines]
    done = subprocess.run(
        command, cwd=folder, env=home, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    shown = [line[7:] for line in done.stdout.splitlines() if line.startswith("loaded ")]
    return [set(json.loads(text)) for text in shown]


def of_package(loaded: set[str], room: str) -> set[str]:
    """Names within a folder of the package."""
    start = f"dicedesign.{room}."
    return {name.removeprefix(start) for name in loaded if name.startswith(start)}


def test_queries_poses_and_figures_of_meshes_load_nothing_heavy(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for suffix in ("obj", "stl", "off", "ply", "glb", "3mf"):
        trimesh.creation.box().export(tmp_path / "meshes" / f"box.{suffix}")
    queries = [f"rest meshes/box.{suffix} --json" for suffix in ("obj", "stl", "off", "3mf")]
    pose = "pose meshes/box.stl --out posed.obj"
    chart = "rest meshes/box.stl --figure map.png"
    others = [f"rest meshes/box.{suffix} --json" for suffix in ("ply", "glb")]
    figure = "figure paths meshes/box.stl"
    room = "scatter meshes --count 3 --out room.glb --figure room.png"
    loaded = modules_after(tmp_path, *queries, pose, chart, *others, figure, room)
    after_queries, after_pose, after_chart, *_, after_all = loaded[4:]

    never = {"torch", "manifold3d", "pydantic"} | SOLVERS
    heavy = never | {"trimesh", "lxml", "matplotlib", "PIL", "fontTools", "uharfbuzz", "mpmath"}
    assert after_pose & (heavy | {"tqdm"}) == set()
    floors = {name.split(".")[1] for name in after_queries if name.startswith("dicedesign.")}
    assert floors & {"optimize", "fabricate", "report", "recipe", "results", "concave"} == set()
    assert not [name for name in of_package(after_queries, "rest") if name.startswith("prior")]
    # A chart loads what draws it alone.
    assert {"matplotlib", "dicedesign.report.gauss_map"} <= after_chart
    assert "trimesh" not in after_chart
    drawing = {"bar_charts", "curve_charts", "solid_figures", "renderer", "pages"}
    assert of_package(after_chart, "report") & drawing == set()
    assert "trimesh" in after_all
    assert after_all & never == set()


PLAIN = "name: d4\nseed: 1\ntarget: {fair: 4}\nstart: {repulsion: {}}\nengrave: false\n"

CONCAVE = """
name: cube
target: {fair: 6}
start: {mesh: {path: cube.obj}}
method: {concave: {attempts: 1}}
"""

ENGRAVERS = {"fonts", "label_layout", "label_reading", "label_art", "engraving", "marks"}


def test_plain_recipes_load_no_engraver_no_solver_and_no_remesher(tmp_path: Path) -> None:
    write_cube(tmp_path / "cube.obj")
    (tmp_path / "d4.yaml").write_text(PLAIN)
    (tmp_path / "cube.yaml").write_text(CONCAVE)
    _, convex = modules_after(tmp_path, "run d4.yaml --out d4")
    _, concave = modules_after(tmp_path, "run cube.yaml --no-figures --out cube")
    # What a recipe may say of a concave die is read, what makes one is not.
    assert {"torch", "dicedesign.recipe.pipeline"} <= convex
    assert of_package(convex, "concave") == {"options"}
    others = {"manifold3d", "matplotlib.pyplot", "sympy", "mpmath", "functorch", "torch._dynamo"}
    assert convex & (others | {"trimesh", "lxml", "uharfbuzz", "OCP"} | SOLVERS) == set()
    assert not any(name.startswith(("benchmarks", "tests")) for name in convex)
    assert of_package(convex, "fabricate") & ENGRAVERS == set()

    assert {"manifold3d", "dicedesign.concave.hull_design"} <= concave
    others = {"fast_simplification", "trimesh", "fontTools", "uharfbuzz", "matplotlib"}
    assert concave & (others | SOLVERS) == set()
    assert of_package(concave, "fabricate") & (ENGRAVERS - {"engraving"}) == set()


def test_the_solvers_looked_for_are_those_that_can_be_loaded() -> None:
    """Else none would be found whatever is loaded."""
    for name in ("clarabel", "fast_simplification"):
        assert importlib.util.find_spec(name) is not None
