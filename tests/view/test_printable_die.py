"""Files of a designed die are read back, and its recipe is run again."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.optimize.preferences import Preferences
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_target
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.results.result import Result
from dicedesign.view.design_session import DesignSession, DieRequest
from dicedesign.view.new_die_panel import PRESETS
from dicedesign.view.printable_die import PrintableDie, make_printable

COIN = {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]}

PATIENCE = 120.0


def design(**entries) -> DesignSession:
    session = DesignSession(DieRequest(**{"target": COIN, "name": "coin", **entries}))
    session.run()
    assert session.wait(PATIENCE)
    return session


def run_again(die: PrintableDie, folder: Path) -> Result:
    """Run the downloaded recipe."""
    name, data = die.recipe_file()
    path = folder / name
    if name.endswith(".zip"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            archive.extractall(folder)
        path = folder / "recipe.yaml"
    else:
        path.write_bytes(data)
    return run(path, folder / "again", changes=["figures=false", "report=false"])


@pytest.fixture(scope="module")
def coin() -> DesignSession:
    """Session of a finished design; tests must not change it."""
    return design()


def test_files_have_the_probabilities(tmp_path: Path, coin: DesignSession) -> None:
    stages: list[str] = []
    die = make_printable(coin, on_stage=stages.append)
    assert stages == ["size", "export", "check", "engrave"]
    assert die.work.status is Status.CONVERGED
    for ending in ("stl", "3mf", "obj"):
        name, data = die.file(ending)
        assert name == f"coin.{ending}"
        (tmp_path / name).write_bytes(data)
        poses = rest_poses(read_body(tmp_path / name))
        np.testing.assert_allclose(poses.probabilities, [1 / 2, 1 / 3, 1 / 6], atol=1e-6)
    labels, target, probabilities = zip(*die.rows(), strict=True)
    assert labels == ("heads", "tails", "edge")
    np.testing.assert_allclose(target, [1 / 2, 1 / 3, 1 / 6])
    np.testing.assert_allclose(probabilities, poses.probabilities, atol=1e-6)


@pytest.mark.parametrize("method", ["exact", "paper"])
def test_an_unchanged_design_needs_only_its_recipe(tmp_path: Path, method: str) -> None:
    """`dicedesign run` writes identical bytes."""
    die = make_printable(design(method=method))
    assert not die.needs_shape
    assert die.recipe_file()[0] == "coin.yaml"
    result = run_again(die, tmp_path)
    assert result.converged
    assert (tmp_path / "again" / "die.stl").read_bytes() == die.file("stl")[1]


def assert_same_die(die: PrintableDie, result: Result) -> None:
    """Compare probabilities with and without labels, and the facet of each label."""
    probabilities = [has for _, _, has in die.rows()]
    np.testing.assert_allclose(result.engraved.probabilities, probabilities, atol=1e-7)
    np.testing.assert_allclose(
        result.probabilities, die.work.plain.outcomes.probabilities, atol=1e-7
    )
    again = {facet.label: facet.normal for facet in result.facets if facet.label is not None}
    poses = die.work.plain.poses
    normals = poses.normals[outcome_probabilities(poses, die.shape.directions).main]
    for (label, _, _), normal in zip(die.rows(), normals, strict=True):
        np.testing.assert_allclose(again[label], normal, atol=1e-6)


def test_a_changed_design_needs_its_shape(tmp_path: Path) -> None:
    session = design()
    session.swap("heads", "edge")
    session.change(replace(session.request, prefer=Preferences(roundness=1.0)))
    session.run()
    assert session.wait(PATIENCE)
    die = make_printable(session)
    assert die.needs_shape
    assert die.work.status is Status.CONVERGED
    name, data = die.recipe_file()
    assert name == "coin.zip"
    assert zipfile.ZipFile(io.BytesIO(data)).namelist() == ["recipe.yaml", "shape.obj"]
    result = run_again(die, tmp_path)
    assert result.converged
    assert_same_die(die, result)


def test_every_preset_is_a_target() -> None:
    for probabilities, labels in PRESETS.values():
        recipe = DieRequest(parse_target(probabilities, labels or None)).recipe()
        assert sum(recipe.target.target().probabilities) == pytest.approx(1.0)


def test_labels_determine_the_size() -> None:
    session = design(target={**COIN, "labels": ["1000000000", "2000000000", "3000000000"]})
    labeled = make_printable(session)
    size = labeled.work.recipe.size_mm
    assert size > 30.0
    start = f"size_mm: {size:g}, so that the labels fit"
    assert any(note.startswith(start) for note in labeled.work.notes)
    assert labeled.recipe_file()[1].decode().count(f"size_mm: {size:g}") == 1
    with pytest.raises(InputError, match=r"use size_mm = \d+"):
        make_printable(session, size_mm=0.5 * size)
    plain = make_printable(session, size_mm=20.0, engrave=False)
    assert pdist(plain.work.finished.points).max() == pytest.approx(20.0, rel=1e-6)
    assert len(plain.work.finished.triangles) < len(labeled.work.finished.triangles)


@pytest.mark.parametrize("size", [0.0, float("nan"), 1e9])
def test_invalid_sizes_are_refused(size: float, coin: DesignSession) -> None:
    with pytest.raises(InputError, match="size_mm: "):
        make_printable(coin, size_mm=size)


def test_a_session_without_shape_is_refused() -> None:
    with pytest.raises(InputError, match="expected a shape to print, got none yet"):
        make_printable(DesignSession(DieRequest({"fair": 5})))
