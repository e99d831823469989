"""The compiled kernels are there wherever they can be built, and are handed a hull once."""

from __future__ import annotations

import copy
import pickle
import re
import runpy
import shutil
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common.kernels import compiled_only, without_kernels

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.kernels import ops as kernels
from dicedesign.rest.poses import rest_poses


def test_kernels_are_built_where_there_is_a_compiler(request: pytest.FixtureRequest) -> None:
    if request.config.getoption("--without-kernels"):
        assert not kernels.available()
    elif any(shutil.which(name) for name in ("c++", "g++", "clang++")):
        assert kernels.available()
    else:
        pytest.skip("no C++ compiler")


def test_python_and_kernels_count_the_same_interface(repository: Path) -> None:
    module = (repository / "dicedesign" / "kernels" / "module.cpp").read_text()
    (number,) = re.findall(r'attr\("INTERFACE"\) = (\d+);', module)
    assert int(number) == kernels.INTERFACE


def test_kernels_of_another_interface_are_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """None where they are missing."""
    for change, used in ((0, True), (1, False), (-1, False), (None, False)):
        stub = None if change is None else SimpleNamespace(INTERFACE=kernels.INTERFACE + change)
        monkeypatch.setitem(sys.modules, "dicedesign_kernels", stub)
        again = runpy.run_path(str(kernels.__file__))
        assert again["available"]() is used


def test_one_module_knows_whether_there_are_kernels(repository: Path) -> None:
    for path in (repository / "dicedesign").rglob("*.py"):
        if path.name != "ops.py":
            text = path.read_text()
            assert "kernels.compiled" not in text, path
            assert "dicedesign_kernels" not in text, path


def test_all_sources_are_compiled_and_none_is_installed(repository: Path) -> None:
    folder = repository / "dicedesign" / "kernels"
    listed = (folder / "CMakeLists.txt").read_text()
    excluded = tomllib.loads((repository / "pyproject.toml").read_text())
    excluded = excluded["tool"]["scikit-build"]["wheel"]["exclude"]
    for path in [*folder.rglob("*.cpp"), *folder.rglob("*.hpp")]:
        assert any(path.relative_to(repository).match(pattern) for pattern in excluded), path
        if path.suffix == ".cpp" and path.parent != folder:
            names = re.findall(rf"set\({path.parent.name} ([^)]*)\)", listed)[0].split()
            assert path.stem in names, path


@compiled_only
def test_copies_of_a_hull_do_not_share_its_handle() -> None:
    """Hulls with handles are sent to worker processes."""
    points = np.random.default_rng(0).normal(size=(20, 3))
    poses = rest_poses(points)
    handle = poses.hull.handle
    assert rest_poses(poses.hull.vertices).hull.handle is not handle
    assert poses.hull.handle is handle
    for again in (pickle.loads(pickle.dumps(poses)), copy.deepcopy(poses)):
        assert "handle" not in vars(again.hull)
        np.testing.assert_array_equal(again.hull.vertices, poses.hull.vertices)
        side = again.basins[0]
        areas = kernels.basin_areas(again.hull, side.paths, side.equilibria.center_of_mass)
        np.testing.assert_array_equal(areas, side.areas)


@compiled_only
def test_a_handle_outlives_its_hull() -> None:
    hull = convex_hull(np.random.default_rng(1).normal(size=(30, 3)))
    center = hull.centroid
    expected = kernels.surroundings(hull, center)
    handle = hull.handle
    del hull
    np.zeros((1000, 30))
    assert kernels.compiled.surroundings(handle, center) == expected


def test_without_kernels_nothing_is_answered() -> None:
    hull = convex_hull(np.eye(4, 3))
    with without_kernels():
        assert not kernels.available()
        assert kernels.surroundings(hull, hull.centroid) is None
        assert kernels.separatrices(hull, hull.centroid, 0.0) is None
