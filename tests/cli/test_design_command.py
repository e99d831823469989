"""`dicedesign design`: from probabilities on the command line to files that have them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
from check_outputs import check
from common.bumpy import bent_capsule

from dicedesign import read_body, rest_poses
from dicedesign.cli.main import main
from dicedesign.recipe.reading import parse_recipe, read_recipe
from dicedesign.recipe.recipe import Recipe


def test_fractions_and_labels_become_a_die_with_these_probabilities(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["design", "1/5, 1/4,1/4, 3/10", "--labels", "-1,yes, no,2.5", "--no-figures"]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("die: die.stl has your probabilities ")
    assert [line.split() for line in captured.out.splitlines()[3:7]] == [
        ["-1", "0.20000", "0.20000", "0.20000"],
        ["yes", "0.25000", "0.25000", "0.25000"],
        ["no", "0.25000", "0.25000", "0.25000"],
        ["2.5", "0.30000", "0.30000", "0.30000"],
    ]
    folder = tmp_path / "outputs" / "die"
    assert read_recipe(folder / "recipe.yaml").size_mm == 30.0
    # An icosahedron.
    for name in ("die_plain.stl", "die.stl"):
        poses = rest_poses(read_body(folder / name))
        np.testing.assert_allclose(poses.probabilities, np.full(20, 0.05), atol=1e-5)


def test_decimals_and_all_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    icon = tmp_path / "icon.svg"
    icon.write_text("<svg xmlns='http://www.w3.org/2000/svg'><path d='M0 0h9v9z'/></svg>")
    options = ["--name", "loaded", "--seed", "3", "--size-mm", "6.4cm", "--files", "obj, glb"]
    options += [
        "--faces",
        "one",
        "--pips",
        "--edges",
        "2mm",
        "--font",
        "DejaVu Serif",
        "--icons",
        f"4={icon}",
    ]
    command = ["design", "--target", ".1,0.2,3e-1,2/5", *options, "--no-figures"]
    assert main([*command, "--out", str(tmp_path / "here")]) == 0
    output = capsys.readouterr().out
    assert output.startswith("loaded: die.stl has your probabilities")
    poses = rest_poses(read_body(tmp_path / "here" / "die_plain.stl"))
    np.testing.assert_allclose(poses.probabilities, [0.4, 0.3, 0.2, 0.1], atol=1e-5)
    recipe = read_recipe(tmp_path / "here" / "recipe.yaml")
    assert (recipe.name, recipe.seed, recipe.size_mm) == ("loaded", 3, 64.0)
    assert recipe.edges.radius_mm == 2.0
    assert (recipe.engrave.content, recipe.engrave.font) == ("pips", "DejaVu Serif")
    assert recipe.engrave.icons == {"4": str(icon)}
    assert recipe.target.probabilities == [0.1, 0.2, 0.3, 0.4]
    assert recipe.files == ["stl", "obj", "glb"]
    for name in ("die.stl", "die.obj", "die.glb"):
        assert (tmp_path / "here" / name).is_file()
        assert name in output.splitlines()[-1]


def test_the_size_grows_until_the_labels_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To the smallest whole number of millimeters, which the written recipe has."""
    labels = [*"abcde", "1000000"]
    command = ["design", "d6", "--labels", ",".join(labels), "--faces", "6", "--no-figures"]
    assert main([*command, "--out", str(tmp_path / "grown")]) == 0
    size = yaml.safe_load((tmp_path / "grown" / "recipe.yaml").read_text())["size_mm"]
    assert size > 30
    assert f"\nnote: size_mm: {size:g}, so that the labels fit" in capsys.readouterr().err
    facets = json.loads((tmp_path / "grown" / "result.json").read_text())["facets"]
    assert sorted(facet["label"] for facet in facets) == sorted(labels)


def test_labels_that_need_more_than_the_largest_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("dicedesign.recipe.solid.MOST_MM", 31.0)
    command = ["design", "d6", "--labels", "a,b,c,d,e,1000000000000", "--faces", "6"]
    assert main([*command, "--out", str(tmp_path)]) == 2
    assert "label '1000000000000': expected room on facet" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def design_with(monkeypatch: pytest.MonkeyPatch, method: dict[str, Any]) -> None:
    """Give the command a method that it has no options for."""

    def change_entries(entries: dict[str, Any]) -> Recipe:
        return parse_recipe({**entries, "method": method})

    monkeypatch.setattr("dicedesign.cli.dice.parse_recipe", change_entries)


def test_a_target_out_of_reach_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    design_with(monkeypatch, {"exact": {"starts": 1}})
    folder = tmp_path / "out"
    target = ["design", "--target", "0.999998,1e-6,1e-6", "--faces", "one", "--out", str(folder)]
    assert main(target) == 1
    printed = capsys.readouterr().out
    assert "\nno_start: no starting shape led to the target; try another" in printed
    assert "allow more with method.exact.starts" in printed
    summary = check(folder)
    assert summary["status"] == "no_start"
    assert summary["design"]["starts"] == 1
    poses = rest_poses(read_body(folder / "die_plain.stl"))
    assert max(poses.probabilities) == pytest.approx(max(summary["probabilities"]), abs=1e-5)


def test_the_time_limit_is_reported_with_its_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    design_with(monkeypatch, {"exact": {"seconds": 1e-3}})
    target = ["design", "--target", "1/2,1/3,1/6", "--no-figures", "--out", str(tmp_path / "out")]
    # On a busy machine, time may run out before the first shape.
    code = main(target)
    printed, errors = capsys.readouterr()
    assert code == 1 or (code == 2 and not (tmp_path / "out").exists())
    assert code == 2 or "\ntime_limit: ran out of time; max |p - q| is " in printed
    assert "; allow more with method.exact.seconds" in (printed if code == 1 else errors)


def test_a_printer_gets_an_oriented_file(tmp_path: Path) -> None:
    folder = tmp_path / "die"
    command = ["design", "--target", ".1,.2,.3,.4", "--faces", "one", "--no-figures"]
    assert main([*command, "--printer", "sla", "--out", str(folder)]) == 0
    result = json.loads((folder / "result.json").read_text())
    assert result["printability"]["printer"] == "sla"
    points = read_body(folder / "die_oriented.stl").points
    assert points[:, 2].min() == pytest.approx(0.0, abs=1e-5)
    assert np.ptp(points[:, 2]) == pytest.approx(result["printability"]["best"]["height_mm"])
    # The written recipe has the printer and its options.
    recipe = tmp_path / "again.yaml"
    entries = yaml.safe_load((folder / "recipe.yaml").read_text())
    assert entries["print"]["printer"] == "sla"
    recipe.write_text(yaml.safe_dump({**entries, "print": {"nozzle_mm": 0.6}}))
    again = ["run", str(recipe), "--no-figures", "--printer", "fdm"]
    assert main([*again, "--out", str(tmp_path / "fdm")]) == 0
    output = json.loads((tmp_path / "fdm" / "result.json").read_text())["printability"]
    assert (output["printer"], output["spot_mm"]) == ("fdm", pytest.approx(0.6))


@pytest.mark.full
def test_a_mesh_with_holes_becomes_a_die(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # A coarse repair; other tests are for the fine one.
    monkeypatch.setattr("dicedesign.geometry.surfaces.repair.CELLS", 25)
    whole, path = bent_capsule(), tmp_path / "capsule.obj"
    # A sheet inside makes it more than a surface with a hole.
    triangles = np.vstack([whole.triangles[9:], [[0, 100, 200]]])
    trimesh.Trimesh(whole.points, triangles, process=False).export(path)
    command = ["design", "--target", "1/2,1/2", "--mesh", str(path), "--no-figures", "--repair"]
    folder = tmp_path / "die"
    assert main([*command, "--out", str(folder)]) == 0
    assert "repaired the mesh" in capsys.readouterr().err
    poses = rest_poses(read_body(folder / "die_plain.stl"))
    np.testing.assert_allclose(poses.probabilities[:2], 0.5, atol=0.005)


@pytest.mark.parametrize(
    "change",
    [
        {"size_mm": 0.01, "engrave": {"depth_mm": 2e-4, "margin_mm": 2e-4, "min_height_mm": 1e-3}},
        {"size_mm": 1000, "edges": {"radius_mm": 50.0}},
        {"engrave": {"depth_mm": 1e-4}, "edges": {"radius_mm": 0.1, "shape": "chamfer"}},
    ],
    ids=["tiny", "huge", "shallow"],
)
def test_extreme_sizes_are_made(change: dict[str, Any], tmp_path: Path) -> None:
    recipe = {"name": "die", "target": {"fair": 4}, "report": False, **change}
    (tmp_path / "die.yaml").write_text(yaml.safe_dump(recipe))
    arguments = ["run", str(tmp_path / "die.yaml"), "--no-figures", "--out", str(tmp_path / "out")]
    assert main(arguments) == 0
    assert (tmp_path / "out" / "die.stl").is_file()
