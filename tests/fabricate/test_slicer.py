"""Files in PrusaSlicer: sound, and with the predicted layers, volume and supports."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.bodies import write_mesh
from common.dented_cube import write_cube
from common.made_up_die import SIDES, box, run_to_check
from common.programs import MISSING_SLICER, SLICER, slice_file, slicer_info

from dicedesign.fabricate.printability import PrintedSolid, placement_on_bed
from dicedesign.fabricate.printers import PRINTERS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.recipe.pipeline import run, run_stages
from dicedesign.results.result import Result

LAYER = PRINTERS["fdm"].layer_mm

SOUND = {"manifold": "yes", "number_of_parts": "1"}

MEASURES = {f"{kind}_{axis}" for kind in ("size", "min", "max") for axis in "xyz"}
MEASURES |= {"number_of_facets", "volume", *SOUND}
"""All facts that the slicer prints about a file without defects."""


def check(result: Result) -> None:
    """Assert that the slicer takes the oriented file without repair, and fills its height with
    layers."""
    assert result.folder is not None
    assert result.printability is not None
    file, best = result.folder / result.files["die_oriented"], result.printability.best
    facts = slicer_info(file)
    assert SOUND.items() <= facts.items()
    assert facts.keys() == MEASURES
    assert float(facts["size_z"]) == pytest.approx(best.height_mm, rel=1e-5)
    assert float(facts["min_z"]) == pytest.approx(0.0, abs=1e-4)
    body = read_body(file)
    assert body.triangles is not None
    volume = body.surface.volume
    assert float(facts["volume"]) == pytest.approx(volume, rel=1e-4)
    assert result.printability.file.volume_mm3 == pytest.approx(volume, rel=1e-5)
    sliced = slice_file(file, LAYER)
    assert sliced.layers[0] == pytest.approx(LAYER)
    assert sliced.layers[-1] == pytest.approx(best.height_mm, abs=1.01 * LAYER)
    assert len(sliced.layers) == pytest.approx(best.height_mm / LAYER, abs=2.0)
    assert sliced.volume_mm3 == pytest.approx(volume, rel=0.06)


@pytest.fixture(autouse=True)
def slicer() -> None:
    """Skip the test at once if there is no slicer."""
    if shutil.which(SLICER) is None:
        pytest.skip(f"{MISSING_SLICER}{SLICER}")


QUICK = {"figures": False, "report": False, "print": {"oriented": True}}


@pytest.mark.parametrize(
    "changes",
    [
        {"target": {"fair": 5}, "start": {"prism": {}}},
        pytest.param({"target": {"sum_of_dice": [6, 6]}}, marks=pytest.mark.full),
    ],
)
def test_engraved_dice_are_sliced_without_repair(changes: dict[str, Any], tmp_path: Path) -> None:
    check(run({"name": "die", **changes, **QUICK}, tmp_path / "die"))


@pytest.mark.full
def test_a_marked_concave_die_is_sliced_without_repair(tmp_path: Path) -> None:
    write_cube(tmp_path / "cube.obj")
    recipe = {
        "name": "cube",
        "target": {"fair": 6},
        "start": {"mesh": {"path": str(tmp_path / "cube.obj")}},
        "method": {"concave": {"attempts": 1}},
        "engrave": True,
    }
    check(run({**recipe, **QUICK}, tmp_path / "die"))


def test_other_files_of_a_die_are_sound(tmp_path: Path) -> None:
    work = run_to_check(box(1.0, 1.2, 1.4), SIDES, entries={"engrave": True})
    run_stages(work, after="check", last="engrave")
    assert work.engraved is not None
    for ending in (".3mf", ".obj", ".stl"):
        file = tmp_path / f"die{ending}"
        write_mesh(file, work.engraved.points, work.engraved.triangles)
        facts = slicer_info(file)
        assert SOUND.items() <= facts.items()
        assert facts.keys() == MEASURES
    # A missing triangle is reported.
    write_mesh(file, work.engraved.points, work.engraved.triangles[1:])
    facts = slicer_info(file)
    assert facts["manifold"] == "no"
    assert "open_edges" in facts


def test_supports_are_at_overhangs_only(tmp_path: Path) -> None:
    """Polyhedra on each of their facets, except where an overhang is small or hardly rises from the
    bed."""
    cases = set()
    for seed in range(3):
        points = np.random.default_rng(seed).normal(size=(9, 3)) * (6.0, 7.0, 8.0)
        hull = convex_hull(points)
        solid = PrintedSolid(hull.vertices, hull.triangles, hull, (), np.zeros((0, 3)))
        for pose in solid.poses(hull.normals, PRINTERS["fdm"])[:4]:
            if 0.0 < pose.support_mm3 < 60.0:
                continue
            placement = placement_on_bed(hull.vertices, np.array(pose.normal))
            laid = hull.vertices @ placement[:3, :3].T + placement[:3, 3]
            file = tmp_path / "solid.stl"
            write_mesh(file, laid, hull.triangles)
            assert (slice_file(file, LAYER, supports=True).supports > 0) == (
                pose.overhang_mm2 > 0.0
            )
            cases.add(pose.overhang_mm2 > 0.0)
    assert len(cases) == 2
