"""Finished dice of recipes/finished, made by one command and read by other libraries."""

from __future__ import annotations

import json
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh
from common.paths import ROOT
from common.programs import slicer_info

from dicedesign.cli.main import main
from dicedesign.rest.poses import rest_poses

SHIPPED = ("finished_binomial_3", "finished_loaded_d6")
NAMES = ["finished_2d6", *(pytest.param(name, marks=pytest.mark.shipped) for name in SHIPPED)]
WITHIN = {"stl": 1e-6, "obj": 1e-9, "3mf": 1e-9, "glb": 1e-6}
"""Largest |p - q|; STL and GLB are in single precision."""


def probabilities(file: Path, result: dict) -> np.ndarray:
    """(k,) probabilities of the outcomes of a file read by trimesh."""
    loaded = trimesh.load(file, force="scene", process=False)
    bodies = [body.copy() for body in loaded.dump()]
    if file.suffix == ".stl" and "die_inlay" in result["files"]:
        bodies.append(trimesh.load(file.with_name(result["files"]["die_inlay"]), process=False))
    volumes = np.array([body.volume for body in bodies])
    middle = volumes @ [body.center_mass for body in bodies] / volumes.sum()
    points = np.concatenate([body.vertices for body in bodies])
    if file.suffix == ".glb":  # y is upward there
        points, middle = points[:, [0, 2, 1]] * [1, -1, 1], middle[[0, 2, 1]] * [1, -1, 1]
    poses = rest_poses(points, center_of_mass=middle)
    facets = [facet for facet in result["facets"] if facet["label"] is not None]
    nearest = np.argmax(poses.normals @ np.array([f["normal"] for f in facets]).T, axis=1)
    labels = [result["labels"].index(facets[k]["label"]) for k in nearest]
    return np.bincount(labels, poses.probabilities, len(result["labels"]))


@pytest.fixture(scope="module", params=NAMES)
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results folder of a recipe."""
    recipe = ROOT / "recipes" / "finished" / f"{request.param}.yaml"
    out = tmp_path_factory.mktemp("finished") / request.param
    assert main(["run", str(recipe), "--out", str(out), "--no-figures"]) == 0
    return out


def test_a_slicer_needs_no_repair(folder: Path) -> None:
    for kind in ("stl", "3mf"):
        assert slicer_info(folder / f"die.{kind}")["manifold"] == "yes"


def test_every_file_has_the_probabilities_names_and_colors(folder: Path) -> None:
    result = json.loads((folder / "result.json").read_text())
    assert result["status"] == "converged"
    for kind, most in WITHIN.items():
        computed = probabilities(folder / f"die.{kind}", result)
        assert np.abs(computed - result["target"]).max() <= most, kind

    model = lib3mf.Wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(folder / "die.3mf"))
    assert reader.GetWarningCount() == 0
    group = model.GetMetaDataGroup()
    entries = [group.GetMetaData(k) for k in range(group.GetMetaDataCount())]
    assert ("Title", folder.name) in [(entry.GetName(), entry.GetValue()) for entry in entries]
    colors = model.GetBaseMaterialGroups()
    assert colors.MoveNext()
    assert len(colors.GetCurrentBaseMaterialGroup().GetAllPropertyIDs()) == 2
