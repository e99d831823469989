"""Shadows on a table."""

from __future__ import annotations

import numpy as np

from dicedesign.report.render.raster import Camera
from dicedesign.report.render.shadow import shadowed_table

ABOVE = Camera(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3), 2.0)
PLATE = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)])
TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)])
UP = np.array([0.0, 0.0, 1.0])


def test_shadows_are_under_the_body_and_fade_with_height() -> None:
    middles = []
    for height in (0.0, 0.3, 1.0, 50.0):
        points = PLATE + height * UP
        shade = shadowed_table(points, TRIANGLES, points[:, 2], UP, ABOVE, 200, 1.0)
        assert shade.shape == (200, 200)
        np.testing.assert_allclose(shade[[5, 5, 195, 195], [5, 195, 5, 195]], 1.0)
        middle = shade[70:130, 70:130]
        assert np.ptp(middle) < 1e-9
        middles.append(middle.mean())
    assert np.all(np.diff(middles) > 0.0)
    assert 0.0 < middles[0] < middles[-1] < 0.9


def test_the_lowest_place_casts_the_shadow() -> None:
    low = np.concatenate([PLATE, PLATE + 0.5 * UP])
    both = np.concatenate([TRIANGLES, TRIANGLES + 4])
    alone = shadowed_table(PLATE, TRIANGLES, PLATE[:, 2], UP, ABOVE, 60, 1.0)
    np.testing.assert_array_equal(shadowed_table(low, both, low[:, 2], UP, ABOVE, 60, 1.0), alone)
