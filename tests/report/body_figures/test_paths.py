"""Paths over the Gauss map: they begin at their dots, lead downhill, and end at rests."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import is_whole, painted
from scipy.ndimage import binary_dilation, label

from dicedesign.errors import InputError
from dicedesign.report.body_figures.paths import path_of, paths_figure
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.roll import roll_steps

PATH = "#d6006e"
BOX = np.array([(x, y, z) for x in (-1, 1) for y in (-1.4, 1.4) for z in (-2, 2)], dtype=float)


def test_a_path_goes_down_to_a_rest() -> None:
    poses = rest_poses(BOX)
    for down in np.random.default_rng(1).normal(size=(20, 3)):
        path = path_of(roll_steps(poses.morse.equilibria, down))
        np.testing.assert_allclose(path[0], down / np.linalg.norm(down), atol=1e-15)
        heights = (path @ BOX.T).max(axis=1)
        assert (np.diff(heights) < 1e-12).all()
        assert np.linalg.norm(poses.normals - path[-1], axis=1).min() < 1e-12


def test_paths_are_drawn_and_no_others() -> None:
    poses = rest_poses(BOX)
    few = np.array([[0.9, 0.3, 0.2], [-0.2, -0.9, 0.3], [0.1, 0.2, -0.9]])
    figure = paths_figure(poses, few)
    assert is_whole(figure)
    # A path over the rim is in two pieces; marks and numbers may lie across one. The legend, which
    # has a sample, is cut off.
    drawn = painted(figure, PATH)[: figure.height - 130]
    _, pieces = label(binary_dilation(drawn, iterations=6))
    assert 3 <= pieces <= 8
    more = paths_figure(poses, np.random.default_rng(2).normal(size=(40, 3)))
    assert painted(more, PATH).sum() > 4 * painted(figure, PATH).sum()
    assert figure.png() == paths_figure(poses, 7.0 * few).png()


def test_a_body_that_rests_has_a_dot_alone() -> None:
    poses = rest_poses(BOX)
    figure = paths_figure(poses, poses.normals[:1])
    # The mark of the rest lies over it.
    assert painted(figure, PATH)[: figure.height - 130].sum() < 100


@pytest.mark.parametrize("down", [[0.0, 0.0, 0.0], [np.nan, 1.0, 0.0]])
def test_no_direction(down: list[float]) -> None:
    with pytest.raises(InputError, match="down"):
        paths_figure(rest_poses(BOX), np.array([down]))
