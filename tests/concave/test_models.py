"""A public model as a die, judged from its file by the forward model alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from common.paths import DATA

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.search import make_concave_die
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses

SPOT = DATA / "models" / "spot.obj"


@pytest.mark.skipif(not SPOT.exists(), reason="the public models are not beside this checkout")
def test_spot_becomes_a_fair_three_sided_die(tmp_path: Path) -> None:
    surface, notes = make_surface(read_body(SPOT))
    assert notes == ()
    target = np.full(3, 1.0 / 3.0)
    die = make_concave_die(surface, target, ConcaveOptions())
    (tmp_path / "die.stl").write_bytes(stl_bytes(die.after.points, die.after.triangles))
    poses = rest_poses(read_body(tmp_path / "die.stl"))
    assert poses.center_of_mass_source == "uniform solid"
    odds = outcome_odds(poses, die.directions)
    assert odds.error(target) <= 0.005
    assert len(intersecting_triangles(die.after.points, die.after.triangles)) == 0
    assert die.progress.best is not None
    assert die.progress.best.gap <= 1e-4
    assert die.progress.best.displacement <= 0.05
