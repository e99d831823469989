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
    assert coin.labels == ("heads", "tails", "edge")
    np.testing.assert_allclose(coin.target, [1 / 2, 1 / 3, 1 / 6], rtol=1e-15)
    assert coin.max_abs_error < 1e-7
    np.testing.assert_allclose(coin.probabilities, coin.target, atol=1e-7)
    # A cube, whose six sides are parted.
    np.testing.assert_allclose(rest_poses(coin.vertices).probabilities, 6 * [1 / 6], atol=1e-12)
    sides = [facet.label for facet in coin.result.facets]
    assert [sides.count(label) for label in coin.labels] == [3, 2, 1]
    span = np.linalg.norm(coin.vertices[:, None] - coin.vertices[None], axis=2).max()
    assert span == pytest.approx(40.0, rel=1e-12)
    solid = trimesh.Trimesh(coin.vertices, coin.triangles, process=False)
    assert solid.is_watertight
    assert solid.volume > 0.0


def test_targets_of_every_kind(coin: Die) -> None:
    """Lists, mappings and `Target`s give identical dice."""
    first = design(coin.target, labels=coin.labels, start="prism", size_mm=40.0)
    target = Target(coin.labels, coin.target)
    mapping = {"probabilities": list(coin.target), "labels": list(coin.labels)}
    for same in (target, mapping):
        die = design(same, start="prism", size_mm=40.0)
        assert die.labels == coin.labels
        np.testing.assert_array_equal(die.vertices, first.vertices)


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
    assert die.engrave(depth_mm=0.4).message != first
    assert die.engrave(depth_mm=0.6).message == first


def test_a_report_has_the_files_of_a_run(tmp_path: Path) -> None:
    die = design({"fair": 3}, start="prism", engrave=True)
    with pytest.raises(InputError, match="die: "):
        len(str(die.result.plain_file))
    result = die.report(tmp_path / "new")
    assert result.folder == tmp_path / "new"
    assert result.plain_file.is_file()
    assert check(tmp_path / "new")["status"] == "converged"
    assert die.result.folder is None


def test_invalid_arguments() -> None:
    for target in ([0.5, 0.4], {"fare": 3}, "fair", [0.5, "x"], {"fair": 3, "labels": [10**400]}):
        with pytest.raises(InputError, match="target"):
            design(target)
    with pytest.raises(InputError, match="start"):
        design({"fair": 3}, start="nowhere")
    with pytest.raises(InputError, match="table"):
        design({"fair": 3}, method="exact", table="carpet")
    with pytest.raises(LabelRoomError):
        design({"fair": 3}, start="prism", size_mm=4.0, engrave=True)
    die = design({"fair": np.int64(3)}, start="prism", seed=np.int64(3), size_mm=np.float32(4.0))
    assert (die.recipe.seed, die.recipe.size_mm) == (3, 4.0)
    with pytest.raises(LabelRoomError):
        die.engrave()
    assert not die.is_engraved


def test_engraving_keeps_rounded_edges(tmp_path: Path) -> None:
    """Strips are so fine that rounding errors might merge them, with errors of percents."""
    wanted = np.random.default_rng(1).dirichlet(np.full(5, 12.0)) + 0.02
    wanted /= wanted.sum()
    die = design(wanted, start="prism", edges={"radius_mm": 1.0}, printing="sla")
    rounded = die.result
    assert (die.is_engraved, die.converged) == (False, True)
    assert rounded.engraved.max_abs_error < 1e-6
    assert (rounded.engraved.reading, rounded.printability.labels) == (None, ())
    die.engrave(depth_mm=0.5)
    engraved = die.result
    assert (die.is_engraved, die.converged) == (True, True)
    assert engraved.engraved.max_abs_error < 1e-6
    assert len(engraved.printability.labels) >= 5
    assert engraved.printability.weight_g < rounded.printability.weight_g
    assert engraved.tolerances.rolls > 0
    die.save(tmp_path / "die.stl")
    probabilities = rest_poses(trimesh.load_mesh(tmp_path / "die.stl")).probabilities
    np.testing.assert_allclose(np.sort(probabilities)[-5:], np.sort(wanted), atol=1e-5)
