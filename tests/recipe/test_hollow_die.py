"""A concave die with a cavity, from its recipe to its files read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dicedesign.geometry.meshes.body import shells_of
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface, solid_properties
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses

WALL_MM = 1.0


@pytest.mark.shipped
def test_a_hollow_die_has_the_probabilities_by_its_own_center_of_mass(tmp_path: Path) -> None:
    tolerance = 0.005
    recipe = {
        "name": "hollow",
        "target": {"fair": 3},
        "start": {"shape": "duck"},
        "method": {
            "concave": {"tolerance": tolerance, "attempts": 1, "hollow": {"wall_mm": WALL_MM}}
        },
        "engrave": {"depth_mm": 0.4},
        "size_mm": 50,
        "figures": False,
        "report": False,
    }
    result = run(parse_recipe(recipe), tmp_path)
    assert result.concave.cavities is not None
    for name in ("die_plain.stl", "die.stl"):
        body = read_body(tmp_path / name)
        assert body.triangles is not None
        poses = rest_poses(body)
        own = {facet.label: facet.normal for facet in result.facets}
        downs = np.array([own[label] for label in result.labels])
        probabilities = outcome_probabilities(poses, downs).probabilities
        np.testing.assert_allclose(probabilities, 1.0 / 3.0, atol=tolerance)
    body = read_body(tmp_path / "die_plain.stl")
    assert body.triangles is not None
    shell = shells_of(body.triangles)
    outer, inner = (Surface(body.points, body.triangles[shell == k]) for k in range(2))
    assert outer.volume > 0.0 > inner.volume
    np.testing.assert_allclose(-inner.volume, result.concave.cavities.volume_mm3, rtol=1e-9)
    # Without the cavity the probabilities would be others.
    centroid = solid_properties(outer.points, outer.triangles)[1]
    assert np.linalg.norm(centroid - rest_poses(body).center_of_mass) > 0.1
    near = distances_from_surface(outer, body.points[np.unique(inner.triangles)]).min()
    assert near >= WALL_MM * (1.0 - 1e-4)
