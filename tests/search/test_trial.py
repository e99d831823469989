"""What a trial measures, against closed forms."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError, MeshFileError
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.search.trial import run_trial

EXACT = {"start": {"search": {}}, "method": {"exact": {}}}


def test_a_tetrahedron_is_measured() -> None:
    entries = {"name": "four", "target": {"fair": 4}, "size_mm": 40, **EXACT}
    result = pickle.loads(pickle.dumps(run_trial)).__call__(entries)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert result["status"] == "converged"
    assert result["max_abs_error"] < 1e-12
    vertices = np.array(result["vertices"])
    edges = np.linalg.norm(vertices[:, None] - vertices[None], axis=-1)
    assert edges.max() == pytest.approx(40.0)
    # Triangle of side 40; normals are acos(-1/3) apart, and borders lie half way between.
    assert result["inradius_mm"] == pytest.approx(40.0 / (2.0 * np.sqrt(3.0)), rel=1e-6)
    assert result["margin_deg"] == pytest.approx(np.degrees(np.arccos(-1.0 / 3.0)) / 2.0, rel=1e-6)
    assert result["asymmetry"] == pytest.approx(0.0, abs=1e-6)
    below = vertices @ np.array(result["down"])
    assert np.sort(below)[-3:] == pytest.approx(below.max())
    assert result["seconds"] > 0.0


def test_the_vertices_are_those_of_a_die_with_the_odds() -> None:
    entries = {"name": "total", "seed": 5, "target": {"sum_of_dice": [2, 3]}, **EXACT}
    result = run_trial(checked_recipe(entries).resolved())
    poses = rest_poses(np.array(result["vertices"]))
    # Coordinates are those of the file, with 24 bits.
    wanted = np.array([2, 2, 1, 1]) / 6.0
    np.testing.assert_allclose(poses.probabilities, wanted, atol=1e-5)
    # Two outcomes are equally probable, and rounding alone says which of them comes first.
    likely = poses.normals[:2]
    assert np.abs(likely - np.array(result["down"])).max(axis=1).min() < 1e-5
    assert result["max_abs_error"] < 1e-12


def test_a_start_that_leads_to_no_die_is_a_result_too() -> None:
    entries = {
        "name": "flat",
        "target": {"fair": 3},
        "start": {"prism": {"cap": 0.0}},
        "method": {"exact": {"starts": 2}},
    }
    result = run_trial(entries)
    assert result["status"] == "no_die"
    assert "expected" in result["message"]
    assert result["max_abs_error"] is None
    assert result["vertices"] is None


def test_whether_a_center_is_inside_depends_on_the_seed() -> None:
    """The start bounds the unit sphere; how it is turned is random."""
    entries = {
        "name": "off",
        "target": {"fair": 4},
        "start": {"repulsion": {}},
        "center_of_mass": [1.5, 0, 0],
        "method": {"paper": {"step": "line_search", "finish": "none", "steps": 1}},
    }
    found = [run_trial({**entries, "seed": seed})["status"] for seed in range(8)]
    assert set(found) == {"no_die", "step_limit"}


def test_an_error_of_the_recipe_is_no_trial() -> None:
    entries = {
        "name": "apart",
        "target": {"sum_of_dice": [6, 6]},
        "start": {"hendecahedron": "bisymmetric"},
        "symmetry": "C2",
        "method": {"exact": {}},
    }
    with pytest.raises(InputError, match=r"symmetry: expected labels .* to be equally probable"):
        run_trial(entries)


def test_a_die_that_misses_an_outcome_has_no_circle(monkeypatch: pytest.MonkeyPatch) -> None:
    def incomplete(*arguments: Any, **options: Any) -> SimpleNamespace:
        work = design_recipe(*arguments, **options)
        first, *others = work.result().facets
        facets = (replace(first, label=None), *others)
        return SimpleNamespace(
            solid=work.solid, result=lambda: replace(work.result(), facets=facets)
        )

    monkeypatch.setattr("dicedesign.search.trial.design_recipe", incomplete)
    result = run_trial({"name": "four", "target": {"fair": 4}, **EXACT})
    assert result["status"] == "no_die"
    assert result["inradius_mm"] is None
    assert result["margin_deg"] is None
    assert len(result["vertices"]) == 4


def test_a_missing_file_is_an_error() -> None:
    entries = {
        "name": "lost",
        "target": {"fair": 4},
        "start": {"mesh": {"path": "/nowhere.stl"}},
        "method": {"exact": {}},
    }
    with pytest.raises(MeshFileError, match="nowhere"):
        run_trial(entries)


def test_the_error_of_a_thrown_die_is_that_of_its_thrown_odds() -> None:
    target = {"probabilities": [0.3, 0.3, 0.2, 0.2]}
    entries = {"name": "thrown", "target": target, "method": {"exact": {"odds": "thrown"}}}
    result = run_trial(entries)
    assert result["status"] == "converged"
    assert result["max_abs_error"] < 1e-12
