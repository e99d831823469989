"""Gauss map: areas of basins, their outlines, and the texts and lines over them."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import color_mask, is_whole, words, written
from matplotlib.colors import to_hex
from matplotlib.path import Path

from dicedesign.errors import InputError
from dicedesign.palette import BLANK, luminance, outcome_colors
from dicedesign.report.discs import basin_outlines
from dicedesign.report.gauss_map import (
    gauss_map,
    heights,
    paths,
    place_text,
)
from dicedesign.report.sheet import NOTE, text_width
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


def test_a_text_is_placed_where_all_of_it_fits_nearest_to_its_anchor() -> None:
    centers = (2.0 * np.arange(201) + 1.0) / 201 - 1.0
    left_half = np.broadcast_to(centers < 0.0, (201, 201))
    anchor, radius = np.array([0.2, 0.1]), 50.0
    place = place_text("16.7 %", anchor, left_half, radius)
    half = text_width("16.7 %", NOTE) / radius / 2.0
    np.testing.assert_allclose(place, [-half, 0.1], atol=0.02)
    assert place_text("16.7 %", anchor, left_half, 5.0) is None
    assert (
        place_text("16.7 %", anchor, np.abs(centers) < 0.9 * half + 0.0 * left_half, radius) is None
    )


@pytest.mark.parametrize("prior", [None, "cap:0.3,-0.5,0.7:100"])
def test_strong_areas_are_the_probabilities(prior: str | None) -> None:
    """Without what is drawn over them."""
    poses = body("box") if prior is None else body("box").under(prior)
    figure = gauss_map(poses)
    colors = outcome_colors(len(poses.normals))
    areas = np.array([color_mask(figure, color).sum() for color in colors])
    np.testing.assert_allclose(areas / areas.sum(), poses.probabilities, atol=0.03)


def test_basins_have_the_colors_of_their_outcomes() -> None:
    """Two rests of one outcome have one color, those of none another."""
    figure = gauss_map(body("cube"), ["a", "b"], [1, 0, -1, 1, -1, 1])
    areas = [color_mask(figure, color).sum() for color in (*outcome_colors(2), BLANK)]
    np.testing.assert_allclose(np.array(areas) / sum(areas), [1 / 6, 3 / 6, 2 / 6], atol=0.03)


def test_figure_writes_labels_and_probabilities_in_colors_to_be_read() -> None:
    """And none at many improbable rests."""
    figure = gauss_map(body("cube"), list("abcde"), [0, 1, 2, 3, 4, -1])
    texts = [text for text in written(figure) if "%" in text.get_text()]
    expected = ["16.7 %", *(f"{letter}\n16.7 %" for letter in "abcde")]
    assert sorted(text.get_text() for text in texts) == expected
    color_of = dict(zip("abcde", outcome_colors(5), strict=True))
    for text in texts:
        ground = luminance(color_of.get(text.get_text()[0], BLANK))
        low, high = sorted([ground, luminance(to_hex(text.get_color()))])
        assert (high + 0.05) / (low + 0.05) >= 4.5
    turns = 2 * np.pi * np.arange(120) / 120
    ring = np.stack([np.cos(turns), np.sin(turns), np.full(120, 40.0)], axis=1)
    poses = rest_poses(np.concatenate([ring, ring * [1, 1, -1]]))
    assert not any("%" in text for text in words(gauss_map(poses)))


def test_what_does_not_fit_into_a_basin_is_in_the_legend() -> None:
    poses = rest_poses(CUBE * [1.0, 1.7, 2.3])
    names = [f"a label of many letters {k}" for k in range(6)]
    (legend,) = gauss_map(poses, names).legends
    entries = [text.get_text() for text in legend.get_texts()]
    expected = [f"{n}: {100 * p:.1f} %" for n, p in zip(names, poses.probabilities, strict=True)]
    assert [text for text in entries if "%" in text] == expected
    assert is_whole(gauss_map(poses, names))


def test_heights_are_drawn_from_the_lowest_to_the_highest() -> None:
    poses = body("box")
    figure = heights(poses)
    assert is_whole(figure)
    # The ends of the color map.
    for color in ("#440154", "#fde725"):
        assert color_mask(figure, color).any()


def test_paths_are_drawn_and_no_others() -> None:
    poses = body("box")
    few = np.array([[0.9, 0.3, 0.2], [-0.2, -0.9, 0.3], [0.1, 0.2, -0.9]])
    figure = paths(poses, few)
    assert is_whole(figure)
    more = paths(poses, np.random.default_rng(2).normal(size=(40, 3)))
    assert color_mask(more, PATH).sum() > 4 * color_mask(figure, PATH).sum()


def test_unsuitable_arguments_are_refused() -> None:
    for labels, outcomes in ((["a", "b"], None), (["a", "b"], [0, 1]), (["a"], [0, 0, 1, 0, 0, 0])):
        with pytest.raises(InputError, match="6 rests"):
            gauss_map(body("cube"), labels, outcomes)
    for down in ([0.0, 0.0, 0.0], [np.nan, 1.0, 0.0]):
        with pytest.raises(InputError, match="down"):
            paths(body("box"), np.array([down]))


@pytest.mark.parametrize("name", ["needle", TUMBLER])
def test_each_direction_is_in_the_outline_of_its_rest_alone(name: str) -> None:
    poses = body(name)
    directions = random_directions(1500, 4)
    rests = poses.morse.basins_of(directions)
    is_within = np.zeros((len(directions), len(poses.facets)), dtype=bool)
    for disc, outlines in basin_outlines(poses):
        on_disc = disc.heights(directions) >= 0.0
        points = disc.to_paper(disc.project(directions[on_disc]))
        for rest, rings in enumerate(outlines):
            for ring in rings:
                is_within[on_disc, rest] ^= Path(ring).contains_points(points)
    # Pieces of borders are straight on paper, so that a few directions are on the wrong side.
    wrong = (is_within != (np.arange(len(poses.facets)) == rests[:, None])).any(axis=1)
    assert wrong.mean() < 0.003
