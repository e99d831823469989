"""Check a results folder with tools that share nothing with what wrote it: trimesh reads the STL
files, and directions sampled at random and rolled one by one stand in for the areas of basins.

Usage: python tests/check_outputs.py FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import trimesh
import yaml

PNG = b"\x89PNG\r\n\x1a\n"


def rolled_frequencies(
    corners: np.ndarray, center: np.ndarray, normals: np.ndarray, steps: int
) -> np.ndarray:
    """Share of sampled directions that end nearest to each of the normals (r, 3), following
    U(d) = max r_j . d downhill in so many small steps."""
    radii = corners - center
    directions = np.random.default_rng(0).normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    step = 0.02
    for _ in range(steps):
        lowest = radii[np.argmax(directions @ radii.T, axis=1)]
        slope = lowest - (lowest * directions).sum(1)[:, None] * directions
        length = np.maximum(np.linalg.norm(slope, axis=1), 1e-12)[:, None]
        directions = directions - step * slope / length
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        step = max((1.0 - 3.0 / steps) * step, 1e-3)
    nearest = np.argmax(directions @ normals.T, axis=1)
    return np.bincount(nearest, minlength=len(normals)) / len(directions)


def check(folder: Path) -> dict[str, object]:
    """Raise AssertionError at the first thing wrong; return result.json."""
    result = json.loads((folder / "result.json").read_text())
    for name in result["files"].values():
        assert (folder / name).stat().st_size > 0, name
        if name.endswith(".png"):
            assert (folder / name).read_bytes().startswith(PNG), name
    leftovers = {p.name for p in folder.iterdir()} - set(result["files"].values())
    assert not leftovers, leftovers

    plain = trimesh.load_mesh(folder / "die_plain.stl")
    assert plain.is_watertight
    assert plain.is_winding_consistent
    assert plain.volume > 0
    if "die" in result["files"]:
        die = trimesh.load_mesh(folder / "die.stl")
        assert die.is_watertight
        assert die.is_winding_consistent
        assert len(die.split()) == 1
        assert 0.8 * plain.volume < die.volume < plain.volume
        hull = plain.convex_hull
        # Facets were moved to balance the labels, and edges and marks take a little off.
        moved = (
            2.0
            * result.get("engraved", {}).get("balance", {}).get("moved_mm", 0.0)
            * hull.area
            / hull.volume
        )
        recipe = yaml.safe_load((folder / "recipe.yaml").read_text())
        rough = "concave" in result or recipe["edges"]
        flat = (1e-2 if rough else 1e-5) + moved
        assert np.allclose(die.convex_hull.volume, hull.volume, rtol=flat)
    corners = plain.convex_hull.vertices
    span = np.linalg.norm(corners[:, None] - corners[None], axis=2).max()
    size = yaml.safe_load((folder / "recipe.yaml").read_text())["size_mm"]
    assert abs(span - size) < 1e-4 * size, (span, size)

    labels, probabilities = result["labels"], np.array(result["probabilities"])
    target = np.array(result["target"])
    assert abs(probabilities - target).max() == result["max_abs_error"]
    assert abs(sum(f["probability"] for f in result["facets"]) - 1.0) < 1e-12
    normals = np.array([facet["normal"] for facet in result["facets"]])
    # A hull of many corners has valleys along which little is won by each step.
    steps = 6000 if "concave" in result else 600
    frequencies = rolled_frequencies(corners, plain.center_mass, normals, steps)
    if "concave" in result:
        # Rests of one outcome may be too near to each other to tell them apart by rolling.
        outcomes = [facet["outcome"] for facet in result["facets"]]
        names = [*labels, None]
        expected = [*probabilities, result["elsewhere"]]
        of_name = [[outcome == name for outcome in outcomes] for name in names]
        frequencies = np.array([frequencies[counted].sum() for counted in of_name])
    else:
        names = result["facets"]
        expected = [facet["probability"] for facet in result["facets"]]
    for name, wanted, frequency in zip(names, expected, frequencies, strict=True):
        spread = 5.0 * np.sqrt(max(wanted * (1 - wanted), 0.0) / 4000) + 0.005
        assert abs(frequency - wanted) < spread, (name, wanted, frequency)
    if result["status"] == "converged":
        assert {f["label"] for f in result["facets"] if f["label"]} == set(labels)
    page = (folder / "report.html").read_text()
    assert "http:" not in page  # embedded pictures are base64, which has no colon
    assert "https:" not in page
    return result


if __name__ == "__main__":
    summary = check(Path(sys.argv[1]))
    print(
        f"{sys.argv[1]}: {summary['status']}, max |p - q| {summary['max_abs_error']:.2e}, all good"
    )
