"""Printed dice with a given center of mass."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from dicedesign.errors import InputError
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import read_result


def recipe(inside: Any, **entries: Any) -> dict[str, Any]:
    return {
        "name": "weighted",
        "target": {"fair": 5},
        "start": {"prism": {"sides": 5}},
        "center_of_mass": [0.05, 0.02, 0.0],
        "size_mm": 40,
        "inside": inside,
        "print": False,
        "figures": False,
        "report": False,
        **entries,
    }


def probabilities(mesh: trimesh.Trimesh, center: np.ndarray, count: int) -> np.ndarray:
    """The largest probabilities of a mesh with a center of mass."""
    poses = rest_poses(np.asarray(mesh.vertices).astype(np.float32), center)
    return np.sort(poses.probabilities)[::-1][:count]


def test_a_cavity_below_labels(tmp_path: Path) -> None:
    result = run(parse_recipe(recipe({"by": "cavity", "wall_mm": 1.5})), tmp_path)
    assert result.converged
    mesh = trimesh.load(tmp_path / "die.stl")
    assert mesh.is_watertight
    # The given center of mass is at the origin, and so is that of the file.
    np.testing.assert_allclose(mesh.center_mass, 0.0, atol=1e-5)
    np.testing.assert_allclose(probabilities(mesh, mesh.center_mass, 5), 0.2, atol=1e-6)
    assert result.inside.wall_mm >= 1.5 * (1.0 - 1e-4)
    assert result.engraved.max_abs_error <= 1e-6
    assert read_result(tmp_path).inside == result.inside


def test_a_cavity_of_a_die_under_a_prior(tmp_path: Path) -> None:
    prior = "vmf:0,0,-1:1"
    result = run(parse_recipe(recipe("cavity", engrave=False, prior=prior)), tmp_path)
    mesh = trimesh.load(tmp_path / "die.stl")
    corners = np.asarray(mesh.vertices).astype(np.float32)
    computed = rest_poses(corners, mesh.center_mass).under(prior).probabilities
    np.testing.assert_allclose(computed[:5], 0.2, atol=1e-6)
    assert result.converged
    assert result.engraved.max_abs_error == pytest.approx(
        np.abs(computed[:5] - 0.2).max(), abs=1e-7
    )


def test_infill_has_a_file_of_its_own(tmp_path: Path) -> None:
    result = run(parse_recipe(recipe("infill", engrave=False)), tmp_path)
    assert result.converged
    assert "die_sparse.stl" in result.files.values()
    assert result.inside.off_mm <= 1e-4 < result.inside.shift_mm


def test_a_wall_without_room_is_refused() -> None:
    with pytest.raises(InputError, match=r"inside: .*wall_mm"):
        run(parse_recipe(recipe({"wall_mm": 19.0}, engrave=False)))
