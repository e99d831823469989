"""Gauss map: areas of basins, their outlines, and the texts and lines over them."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import color_mask, is_whole
from matplotlib.path import Path

from dicedesign.errors import InputError
from dicedesign.palette import BASINS
from dicedesign.report.discs import basin_of_directions, basin_outlines
from dicedesign.report.gauss_map import (
    gauss_map_figure,
    heights_figure,
    paths_figure,
    place_texts,
)
from dicedesign.rest.poses import RestPoses, rest_poses

PATH = "#d6006e"
CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
TUMBLER = "tumbler"
"""A ball with a pointed top whose center of mass is so low that it rights itself."""


def random_directions(count: int, seed: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def body(name: str) -> RestPoses:
    if name == "cube":
        return rest_poses(CUBE)
    if name == "box":
        return rest_poses(CUBE * [1.0, 1.7, 2.3])
    if name == TUMBLER:
        dome = random_directions(400, 3)
        foot = [[0.2, 0, -1.05], [-0.2, 0.2, -1.05], [-0.2, -0.2, -1.05]]
        return rest_poses(
            np.concatenate([dome, [[0, 0, 1.8]], foot]), center_of_mass=[0.0, 0.0, -0.9]
        )
    return rest_poses(random_directions(60, 8) * [1.0, 1.0, 9.0])


def test_texts_stay_in_their_region_and_do_not_overlap():
    anchors = np.array([[0.0, 0.0], [0.03, 0.0], [0.0, 0.03]])
    everywhere = np.ones((8, 8), dtype=bool)
    places = place_texts(anchors, ["10.0 %"] * 3, [everywhere] * 3, anchors, 0.05)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        apart = np.abs(places[i] - places[j])
        assert apart[0] > 0.05 * 0.62 * 6 or apart[1] > 0.05 * 1.25
    left = np.arange(40) < 20 + np.zeros((40, 1))
    anchor = np.array([[-0.01, 0.0]])
    ((x, _),) = place_texts(anchor, ["ab"], [left], anchor, 0.05)
    assert x < -0.02


@pytest.mark.parametrize("prior", [None, "cap:0.3,-0.5,0.7:100"])
def test_strong_areas_are_the_probabilities(prior):
    poses = body("box") if prior is None else body("box").under(prior)
    figure = gauss_map_figure(poses)
    areas = np.array([color_mask(figure, color).sum() for color in BASINS[: len(poses.normals)]])
    np.testing.assert_allclose(areas / areas.sum(), poses.probabilities, atol=0.02)


def test_figure_writes_labels_and_probabilities():
    """And none at many improbable rests."""
    texts = gauss_map_figure(body("cube"), ["a", "b", "c", "d", "e", ""]).texts
    written = sorted(text for text in texts if "%" in text)
    assert written == ["16.7 %", *(f"{letter}\n16.7 %" for letter in "abcde")]
    turns = 2 * np.pi * np.arange(120) / 120
    ring = np.stack([np.cos(turns), np.sin(turns), np.full(120, 40.0)], axis=1)
    poses = rest_poses(np.concatenate([ring, ring * [1, 1, -1]]))
    assert not any("%" in text for text in gauss_map_figure(poses).texts)


def test_heights_are_drawn_from_the_lowest_to_the_highest():
    poses = body("box")
    figure = heights_figure(poses)
    assert is_whole(figure)
    # The ends of the color map.
    for color in ("#440154", "#fde725"):
        assert color_mask(figure, color).any()


def test_paths_are_drawn_and_no_others() -> None:
    poses = body("box")
    few = np.array([[0.9, 0.3, 0.2], [-0.2, -0.9, 0.3], [0.1, 0.2, -0.9]])
    figure = paths_figure(poses, few)
    assert is_whole(figure)
    more = paths_figure(poses, np.random.default_rng(2).normal(size=(40, 3)))
    assert color_mask(more, PATH).sum() > 4 * color_mask(figure, PATH).sum()


def test_unsuitable_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="6 rests, got 2"):
        gauss_map_figure(body("cube"), ["a", "b"])
    for down in ([0.0, 0.0, 0.0], [np.nan, 1.0, 0.0]):
        with pytest.raises(InputError, match="down"):
            paths_figure(body("box"), np.array([down]))


@pytest.mark.parametrize("name", ["needle", TUMBLER])
def test_each_direction_is_in_the_outline_of_its_rest_alone(name: str) -> None:
    poses = body(name)
    directions = random_directions(1500, 4)
    rests = basin_of_directions(poses, directions)
    is_within = np.zeros((len(directions), len(poses.facets)), dtype=bool)
    for disc, outlines in basin_outlines(poses):
        on_disc = disc.heights(directions) >= 0.0
        points = disc.to_paper(disc.project(directions[on_disc]))
        for rest, rings in enumerate(outlines):
            for ring in rings:
                is_within[on_disc, rest] ^= Path(ring).contains_points(points)
    # Pieces of borders are straight on paper, so that a few directions are on the wrong side.
    wrong = (is_within != (np.arange(len(poses.facets)) == rests[:, None])).any(axis=1)
    assert wrong.mean() < 0.01
