"""The bench of probes: its family, what it finds best, the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from common.benches import run_bench
from common.kernels import compiled_only
from scipy.spatial import ConvexHull

from dicedesign.bench.benches.probe import Extent, frustum, probe_family
from dicedesign.cli.main import main
from dicedesign.rest.poses import rest_poses


def test_a_frustum() -> None:
    hull = ConvexHull(frustum(6, 0.9, 0.5))
    assert len(hull.vertices) == 12
    areas = [1.5 * 3**0.5 * radius**2 for radius in (1.0, 0.5)]
    # Source: Heron.
    assert hull.volume == pytest.approx(0.9 / 3.0 * (sum(areas) + np.sqrt(areas[0] * areas[1])))


def test_all_of_the_family_rest_on_every_facet() -> None:
    """A flat one rolls off its sides, and is left out."""
    extent = Extent((4, 7), (0.6, 0.1), (0.2, 0.5), 1, 1)
    names = [die.name for die in probe_family(extent)]
    for die in probe_family(extent):
        assert len(die.body.rest_heights) == int(die.name.split()[1].rstrip(",")) + 2
    assert "frustum 4, 0.6, 0.5" in names
    assert len(rest_poses(frustum(4, 0.1, 0.5)).probabilities) < 6
    assert not any(" 0.1," in name for name in names)


@compiled_only
def test_the_command_prints_a_table_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe = tmp_path / "coin.yaml"
    recipe.write_text("name: coin\ntarget: {probabilities: [0.5, 0.25, 0.25]}\n")
    extent = Extent((6,), (0.8,), (0.3, 0.45), 2_000, 2_000)
    assert run_bench("probe", recipe, "--out", tmp_path, extent=extent) == 0
    text = capsys.readouterr().out
    rows = json.loads((tmp_path / "probe.json").read_text())["rows"]
    assert [row["name"].split()[0] for row in rows] == ["frustum", "frustum", "coin", "box"]
    assert rows[0]["rests"] == 8
    assert all(row["name"] in text for row in rows)


def test_bad_input_is_said_plainly(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "probe", "--quick", "none.stl"]) == 2
    assert "none.stl: no such file" in capsys.readouterr().err
