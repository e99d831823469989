"""Entries about labels, edges, prints and files that cannot be are refused in one line that names
them; extremes that can be are made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from dicedesign.cli.main import main

KEYS = (
    "engrave.depth_mm",
    "engrave.margin_mm",
    "engrave.min_height_mm",
    "engrave.max_height_mm",
    "engrave.stroke_mm",
    "engrave.border_mm",
    "engrave.content",
    "engrave.icons",
    "engrave.font",
    "engrave.upright",
    "engrave.ambiguous",
    "engrave.style",
    "engrave.balance",
    "engrave.read",
    "edges",
    "edges.radius_mm",
    "edges.shape",
    "numbering",
    "print",
    "print.printer",
    "print.nozzle_mm",
    "print.material",
    "print.density_g_cm3",
    "print.oriented",
    "print.infill",
    "print.walls_mm",
    "print.errors",
    "print.errors.dimensional_mm",
    "print.errors.shrinkage",
    "print.errors.density_gradient",
    "print.errors.bubble_mm3",
    "files",
    "data_sheet",
    "method.exact.prefer.tolerance",
)

WRONG: tuple[Any, ...] = (-1, float("nan"), float("inf"), 1e300, "wrong", [1], {"wrong": 1})


def entries(key: str, value: Any) -> dict[str, Any]:
    """A recipe with one entry, by its dotted key."""
    recipe: dict[str, Any] = {"name": "die", "target": {"fair": 4}}
    *parents, last = key.split(".")
    inner = recipe
    for parent in parents:
        inner = inner.setdefault(parent, {})
    inner[last] = value
    return recipe | {"figures": False, "report": False}


def run(folder: Path, recipe: dict[str, Any]) -> int:
    (folder / "die.yaml").write_text(yaml.safe_dump(recipe))
    return main(["run", str(folder / "die.yaml"), "--out", str(folder / "out")])


@pytest.mark.parametrize("key", KEYS)
def test_wrong_entries_are_refused_by_their_key(
    key: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for value in WRONG:
        assert run(tmp_path, entries(key, value)) == 2, value
        captured = capsys.readouterr()
        assert captured.out == ""
        (line,) = captured.err.splitlines()
        assert key.split(".")[-1] in line, value
        assert "; " in line, value  # before a remedy


@pytest.mark.parametrize(
    ("recipe", "message"),
    [
        (entries("engrave.depth_mm", 1e-12), "engrave.depth_mm: expected at least 3e-05"),
        (entries("edges.radius_mm", 6.1), "edges.radius_mm: expected at most 6"),
        (entries("edges.radius_mm", 0.29), "edges.radius_mm: expected at least 0.3"),
        (entries("edges.radius_mm", 5.9), "circle that is left flat on facet"),
        (entries("engrave.stroke_mm", 50.0), "for digits of at least min_height_mm"),
        (entries("engrave.icons", {"1": "none.svg"}), "engrave.icons: label '1': "),
        (entries("engrave.icons", {"9": "none.svg"}), "engrave.icons: expected labels"),
        (entries("engrave.depth_mm", 25.0), "reduce depth_mm"),
        (entries("files", ["stl", "dxf"]), "files: expected formats out of"),
    ],
)
def test_what_does_not_fit_the_die_is_refused(
    recipe: dict[str, Any], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, recipe) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not (tmp_path / "out" / "die.stl").exists()


@pytest.mark.parametrize(
    "change",
    [
        {"size_mm": 0.01, "engrave": {"depth_mm": 2e-4, "margin_mm": 2e-4, "min_height_mm": 1e-3}},
        {"size_mm": 1000, "edges": {"radius_mm": 50.0}},
        {"engrave": {"depth_mm": 1e-4}, "edges": {"radius_mm": 0.1, "shape": "chamfer"}},
        {"engrave": False, "edges": {"radius_mm": 0.3}, "print": False},
    ],
)
def test_extremes_are_made(change: dict[str, Any], tmp_path: Path) -> None:
    assert run(tmp_path, {**entries("seed", 0), **change}) == 0
    assert (tmp_path / "out" / "die.stl").is_file()
