"""Bodies of several densities, against closed forms and samples of points."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import dicedesign as dd
from dicedesign.cli.main import main

SIDES = np.array([4.0, 2.0, 2.0])


def block(sides: tuple[float, float, float], middle: tuple[float, float, float]) -> trimesh.Trimesh:
    box = trimesh.creation.box(sides)
    box.apply_translation(middle)
    return box


def box_inertia(sides: np.ndarray) -> np.ndarray:
    return (np.diag(np.full(3, (sides**2).sum())) - np.diag(sides**2)) / 12.0


def test_an_inner_part_replaces_the_material_around_it() -> None:
    outer, inner = block((4, 2, 2), (0, 0, 0)), block((1, 1, 1), (1.2, 0.1, -0.3))
    body = dd.weighted_body([(outer, 1.0), (inner, 7.8)])
    assert body.mass_properties is not None
    known = body.mass_properties
    # (7.8 - 1) of the inner one are added to the whole.
    mass = 16.0 + 6.8
    center = 6.8 * np.array([1.2, 0.1, -0.3]) / mass
    assert known.mass == pytest.approx(mass, rel=1e-14)
    np.testing.assert_allclose(known.center_of_mass, center, atol=1e-14)
    arms = np.array([[0.0, 0.0, 0.0], [1.2, 0.1, -0.3]]) - center
    expected = np.zeros((3, 3))
    for share, sides, arm in zip((16.0, 6.8), (SIDES, np.ones(3)), arms, strict=True):
        expected += share * (box_inertia(sides) + arm @ arm * np.eye(3) - np.outer(arm, arm))
    np.testing.assert_allclose(known.inertia, expected / mass, atol=1e-13)
    poses = dd.rest_poses(body)
    np.testing.assert_allclose(poses.center_of_mass, center, atol=1e-14)
    same = dd.rest_poses(np.asarray(outer.vertices), center)
    np.testing.assert_allclose(poses.probabilities, same.probabilities, atol=1e-13)
    np.testing.assert_allclose(dd.rigid_body(body, poses).inertia, known.inertia, atol=1e-13)


def test_a_part_of_zero_density_is_a_cavity_and_one_of_equal_density_has_no_effect() -> None:
    outer, inner = block((4, 2, 2), (0, 0, 0)), block((1, 1, 1), (1, 0, 0))
    hollow = dd.weighted_body([(outer, 2.0), (inner, 0.0)]).mass_properties
    even = dd.weighted_body([(outer, 2.0), (inner, 2.0)]).mass_properties
    assert hollow is not None
    assert even is not None
    np.testing.assert_allclose(hollow.center_of_mass, [-1.0 / 15.0, 0, 0], atol=1e-14)
    assert hollow.mass == pytest.approx(30.0, rel=1e-14)
    assert hollow.volume == pytest.approx(15.0, rel=1e-14)
    assert even.volume == pytest.approx(16.0, rel=1e-14)
    np.testing.assert_allclose(even.center_of_mass, 0.0, atol=1e-14)
    np.testing.assert_allclose(even.inertia, box_inertia(SIDES), atol=1e-13)


def test_an_adjacent_part_is_joined_and_extends_the_hull() -> None:
    body = dd.weighted_body([(block((2, 2, 2), (0, 0, 0)), 1), (block((2, 2, 2), (0, 0, 2)), 3)])
    assert any("not inside" in note for note in body.notes)
    poses = dd.rest_poses(body)
    np.testing.assert_allclose(poses.center_of_mass, [0, 0, 1.5], atol=1e-14)
    assert np.ptp(poses.hull.vertices[:, 2]) == pytest.approx(4.0)
    assert (
        poses.probabilities[np.argmax(poses.normals @ [0, 0, 1])]
        > poses.probabilities[np.argmax(poses.normals @ [0, 0, -1])]
    )


def test_parts_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    block((4, 2, 2), (0, 0, 0)).export(tmp_path / "box.stl")
    block((1, 1, 1), (1.25, 0, 0)).export(tmp_path / "weight.stl")
    box, weight = str(tmp_path / "box.stl"), str(tmp_path / "weight.stl")
    assert main(["rest", box, "--part", f"{weight}:5", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["center_of_mass"] == pytest.approx([0.25, 0.0, 0.0], abs=1e-12)
    assert "densities" in printed["center_of_mass_source"]
    assert main(["drop", box, "--part", f"{weight}:5", "--down", "1,1,1"]) == 0
    capsys.readouterr()
    for bad in (weight, f"{weight}:heavy", f"{tmp_path}/none.stl:5"):
        assert main(["rest", box, "--part", bad]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert main(["rest", str(tmp_path), "--out", str(tmp_path / "t.csv"), "--part", "a:1"]) == 2
    assert "--part" in capsys.readouterr().err
