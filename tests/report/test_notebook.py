"""What notebooks show, and the notebook of the examples."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import nbformat
import numpy as np
import pytest
from common.paths import ROOT

import dicedesign as dd


def cells(html: str) -> list[str]:
    """Text of all cells of a table."""
    return [unescape(cell) for cell in re.findall(r"<td[^>]*>([^<]*)</td>", html)]


def test_poses_show_their_hull_and_probabilities() -> None:
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)])
    poses = dd.rest_poses(box)
    html = poses._repr_html_()
    shown = [float(cell.rstrip("%")) / 100 for cell in cells(html)[1::3]]
    np.testing.assert_allclose(shown, poses.probabilities, atol=1e-6)
    assert "<iframe" in html
    assert "6 rests" in repr(poses)


def test_a_result_without_files_shows_its_table_alone() -> None:
    target = {"fair": 3, "labels": ["<b>", "two", "three"]}
    die = dd.design(target, start="prism")
    html = die.result._repr_html_()
    assert cells(html)[::3] == ["<b>", "two", "three"]
    assert "<iframe" not in html
    assert "<iframe" in die._repr_html_()
    assert replace(die.result, folder=Path("nowhere"))._repr_html_() == html


def test_the_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    notebook = nbformat.read(ROOT / "examples" / "first_die.ipynb", as_version=4)
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    exec(compile("\n".join(cells), "first_die", "exec"), {})
    assert (tmp_path / "total_of_2d4.stl").is_file()
