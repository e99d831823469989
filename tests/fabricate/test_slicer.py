"""A slicer opens what is written, and makes of it what was said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.dented_cube import write_cube
from common.made_up_die import SIDES, box, checked
from common.slicer import slice_file, slicer_info

from dicedesign.fabricate.file_formats import save_mesh
from dicedesign.fabricate.printability import PrintedSolid, placement_on_bed
from dicedesign.fabricate.printers import PRINTERS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.triangles import solid_properties
from dicedesign.recipe.pipeline import run, run_stages
from dicedesign.recipe.reading import read_recipe
from dicedesign.results.result import Result

LAYER = PRINTERS["fdm"].layer_mm

SOUND = {"manifold": "yes", "number_of_parts": "1"}

MEASURES = {f"{kind}_{axis}" for kind in ("size", "min", "max") for axis in "xyz"}
MEASURES |= {"number_of_facets", "volume", *SOUND}
"""Of a file without a defect the slicer says these and nothing else."""


def check(result: Result) -> None:
    """Raise AssertionError unless the slicer takes the file that lies as is best without repair,
    and fills it in as many layers as it is high."""
    assert result.folder is not None
    assert result.printability is not None
    file, best = result.folder / result.files["die_oriented"], result.printability.best
    told = slicer_info(file)
    assert SOUND.items() <= told.items()
    assert told.keys() == MEASURES
    assert float(told["size_z"]) == pytest.approx(best.height_mm, rel=1e-5)
    assert float(told["min_z"]) == pytest.approx(0.0, abs=1e-4)
    body = read_body(file)
    assert body.triangles is not None
    volume = solid_properties(body.points, body.triangles)[0]
    assert float(told["volume"]) == pytest.approx(volume, rel=1e-4)
    assert result.printability.file.volume_mm3 == pytest.approx(volume, rel=1e-5)
    made = slice_file(file, LAYER)
    assert made.layers[0] == pytest.approx(LAYER)
    assert made.layers[-1] == pytest.approx(best.height_mm, abs=1.01 * LAYER)
    assert len(made.layers) == pytest.approx(best.height_mm / LAYER, abs=2.0)
    assert made.volume_mm3 == pytest.approx(volume, rel=0.06)


@pytest.mark.parametrize("name", ["2d6_hendecahedron", "d20_half"])
def test_engraved_dice_are_sliced_without_repair(
    repository: Path, tmp_path: Path, name: str
) -> None:
    changes = ["figures=false", "report=false", "print.oriented=true"]
    recipe = read_recipe(repository / "recipes" / f"{name}.yaml", changes)
    check(run(recipe, tmp_path))


def test_a_marked_concave_die_is_sliced_without_repair(tmp_path: Path) -> None:
    write_cube(tmp_path / "cube.obj")
    recipe: dict[str, Any] = {
        "name": "cube",
        "target": {"fair": 6},
        "start": {"mesh": {"path": str(tmp_path / "cube.obj")}},
        "method": {"concave": {"attempts": 1}},
        "engrave": True,
        "figures": False,
        "report": False,
        "print": {"oriented": True},
    }
    check(run(recipe, tmp_path / "die"))


def test_other_files_of_the_same_die_are_sound_too(tmp_path: Path) -> None:
    work = checked(box(1.0, 1.2, 1.4), SIDES, entries={"engrave": True})
    run_stages(work, after="check", last="engrave")
    assert work.engraved is not None
    for ending in (".3mf", ".obj", ".stl"):
        file = tmp_path / f"die{ending}"
        save_mesh(file, work.engraved.points, work.engraved.triangles)
        told = slicer_info(file)
        assert SOUND.items() <= told.items()
        assert told.keys() == MEASURES
    # A triangle that is missing is noticed.
    save_mesh(file, work.engraved.points, work.engraved.triangles[1:])
    told = slicer_info(file)
    assert told["manifold"] == "no"
    assert "open_edges" in told


def test_supports_are_where_an_overhang_is_and_nowhere_else(tmp_path: Path) -> None:
    """Of some polyhedra on each of their facets, but where a facet that looks down is small or
    hardly rises from the bed."""
    seen = []
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
            save_mesh(file, laid, hull.triangles)
            assert (slice_file(file, LAYER, supports=True).supports > 0) == (
                pose.overhang_mm2 > 0.0
            )
            seen.append(pose.overhang_mm2 > 0.0)
    assert len(set(seen)) == 2
