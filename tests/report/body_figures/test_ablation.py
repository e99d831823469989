"""Dice beside each other: further rests are in a colour of their own, and told."""

from __future__ import annotations

import numpy as np
from common.drawings import is_whole

from dicedesign.report.body_figures.ablation import ablation_figure
from dicedesign.report.body_figures.body_figure import Ablation
from dicedesign.report.charts.palette import ACCENT, rgb
from dicedesign.rest.poses import rest_poses

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def share_like_accent(picture: np.ndarray) -> float:
    """Part of the drawn pixels whose red, green and blue are in the proportions of the accent."""
    pixels = picture.reshape(-1, 3).astype(float)
    pixels = pixels[(pixels < 255).any(axis=1)]
    accent = rgb([ACCENT])[0]
    cosines = pixels @ accent / (np.linalg.norm(pixels, axis=1) * np.linalg.norm(accent))
    return float((cosines > 0.995).mean())


def test_further_rests_are_told_and_shown() -> None:
    poses = rest_poses(CUBE)
    clean = Ablation("all terms", 1e-3, poses, np.arange(6))
    # Opposite facets for one outcome: three of the six rests are further ones.
    opposite = np.abs(poses.normals).argmax(axis=1)
    doubled = Ablation("without coplanar", 0.25, poses, opposite)
    figure = ablation_figure([clean, doubled])
    assert is_whole(figure)
    text = " ".join(figure.texts)
    assert "6 rests for 6 of them" in text
    assert "6 rests for 3 of them, up to 180.0° off" in text
    assert "2.5e-01" in text
    assert text.count("outcomes 90° apart") == 2
    shares = [share_like_accent(picture) for picture in figure.pictures]
    assert len(shares) == 4
    assert max(shares[:2]) < 0.02
    assert sum(shares[2:]) > 0.3


def test_one_outcome() -> None:
    poses = rest_poses(CUBE)
    figure = ablation_figure([Ablation("all terms", 0.0, poses, np.zeros(6, dtype=np.int64))] * 3)
    assert is_whole(figure)
    assert len(figure.pictures) == 6
