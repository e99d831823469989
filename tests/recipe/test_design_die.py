"""Dice designed in Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from check_outputs import check

from dicedesign import rest_poses
from dicedesign.errors import InputError, LabelRoomError
from dicedesign.optimize.targets import Target
from dicedesign.recipe.design_die import Die, design


@pytest.fixture(scope="module")
def coin() -> Die:
    return design(["1/2", 1 / 3, 1 / 6], labels=["heads", "tails", "edge"], seed=3, size_mm=40.0)


def test_a_die_of_probabilities(coin: Die) -> None:
    """Judged by the forward model on its vertices."""
    assert (coin.status, coin.converged, coin.is_engraved) == ("converged", True, False)
    assert coin.message.startswith("The die has your probabilities: off by ")
    assert coin.labels == ("heads", "tails", "edge")
    np.testing.assert_allclose(coin.target, [1 / 2, 1 / 3, 1 / 6], rtol=1e-15)
    assert coin.max_abs_error < 1e-7
    np.testing.assert_allclose(coin.probabilities, coin.target, atol=1e-7)
    poses = rest_poses(coin.vertices)
    np.testing.assert_allclose(poses.probabilities, [1 / 2, 1 / 3, 1 / 6], atol=1e-12)
    span = np.linalg.norm(coin.vertices[:, None] - coin.vertices[None], axis=2).max()
    assert span == pytest.approx(40.0, rel=1e-12)
    solid = trimesh.Trimesh(coin.vertices, coin.triangles, process=False)
    assert solid.is_watertight
    assert solid.volume > 0.0
    assert coin.history[0].step == 0
    assert coin.history[-1].max_abs_error < 1e-12


def test_targets_of_every_kind(coin: Die) -> None:
    """Lists, mappings and `Target`s give identical dice."""
    target = Target(coin.labels, coin.target)
    mapping = {"probabilities": ["1/2", "1/3", "1/6"], "labels": list(coin.labels)}
    for same in (target, mapping):
        die = design(same, seed=3, size_mm=40.0)
        assert die.labels == coin.labels
        np.testing.assert_array_equal(die.vertices, coin.vertices)
    fair = design({"fair": 4}, labels="abcd", start="repulsion", method={"exact": {"prefer": {}}})
    assert fair.labels == ("a", "b", "c", "d")
    np.testing.assert_allclose(fair.probabilities, 0.25, atol=1e-7)


def test_an_engraved_die_is_saved_and_read_back(coin: Die, tmp_path: Path) -> None:
    die = design(coin.target, labels=coin.labels, seed=3, size_mm=40.0)
    assert die.engrave(depth_mm=0.6) is die
    assert die.is_engraved
    assert len(die.vertices) > len(coin.vertices)
    assert 0.0 < die.result.engraved.max_abs_error < 5e-3
    coin.save(tmp_path / "plain.stl")
    whole = trimesh.load_mesh(tmp_path / "plain.stl").volume
    for ending in ("stl", "obj", "3mf"):
        die.save(tmp_path / f"die.{ending}")
        volume = trimesh.load(tmp_path / f"die.{ending}", force="mesh").volume
        assert 0.9 * whole < volume < whole
    # A second engraving replaces the first.
    first = die.message
    assert first.count("reached the tolerance") == coin.message.count("reached the tolerance") == 1
    assert die.engrave(depth_mm=0.4).message != first
    assert die.message.count(" in die.stl") == 1
    assert die.engrave(depth_mm=0.6).message == first


def test_a_report_has_the_files_of_a_run(tmp_path: Path) -> None:
    die = design({"fair": 3}, engrave=True)
    with pytest.raises(InputError, match="die: expected a die that was written to a folder"):
        len(str(die.result.plain_file))
    for name in ("new", "again"):
        result = die.report(tmp_path / name)
        assert result.folder == tmp_path / name
        assert result.plain_file.is_file()
        assert check(tmp_path / name)["status"] == "converged"
        assert [stage.name for stage in result.stages].count("report") == 1
    assert die.result.folder is None


def test_invalid_arguments() -> None:
    for target in ([0.5, 0.4], {"fare": 3}, "fair", [0.5, "x"], {"fair": 3, "labels": [10**400]}):
        with pytest.raises(InputError, match="target"):
            design(target)
    with pytest.raises(InputError, match=r"start"):
        design({"fair": 3}, start="nowhere")
    with pytest.raises(LabelRoomError):
        design({"fair": 11}, size_mm=4.0, engrave=True)
    die = design({"fair": np.int64(3)}, seed=np.int64(3), size_mm=np.float32(4.0))
    assert (die.recipe.seed, die.recipe.size_mm) == (3, 4.0)
    with pytest.raises(LabelRoomError):
        die.engrave()
    assert not die.is_engraved


def test_engraving_keeps_rounded_edges(tmp_path: Path) -> None:
    die = design({"fair": 5}, edges={"radius_mm": 1.5}, printing="sla")
    assert not die.is_engraved
    rounded = die.result
    assert rounded.engraved.max_abs_error < 1e-6
    assert rounded.engraved.reading is None
    assert rounded.printability.printer == "sla"
    assert rounded.printability.labels == ()
    die.engrave(depth_mm=0.5)
    engraved = die.result
    assert (die.is_engraved, die.converged) == (True, True)
    assert die.recipe.edges.radius_mm == 1.5
    assert engraved.engraved.max_abs_error < 1e-6
    assert len(engraved.printability.labels) >= 5
    assert engraved.printability.weight_g < rounded.printability.weight_g
    assert engraved.tolerances.rolls > 0
    assert "label" in engraved.engraved.reading
    die.save(tmp_path / "die.stl")
    probabilities = np.sort(rest_poses(trimesh.load_mesh(tmp_path / "die.stl")).probabilities)[-5:]
    np.testing.assert_allclose(probabilities, 0.2, atol=1e-5)


def test_rounded_edges_survive_single_precision() -> None:
    """Strips as fine as rounding errors would merge, with errors of percents."""
    probabilities = np.random.default_rng(1).dirichlet(np.full(5, 12.0)) + 0.02
    die = design(probabilities / probabilities.sum(), edges={"radius_mm": 1.0})
    assert die.converged
    assert die.result.engraved.max_abs_error < 1e-6
