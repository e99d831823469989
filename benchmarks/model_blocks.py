"""Models as of a carpenter: beams, posts and wedges that meet at sharp edges, with bores."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.surfaces.remeshing import refined
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["blocks"]


def blocks(rng: np.random.Generator, count: int) -> Surface:
    """Two to five solids of few faces as one, and up to two bores.

    Its large faces have long triangles, as those of drawn solids do. count: least number of points.
    Raises InputError where they do not make a good surface.
    """
    from manifold3d import Manifold

    from dicedesign.geometry.manifold import mesh_of

    body = Manifold.cube(tuple(rng.uniform([1.0, 0.5, 0.3], [2.2, 1.2, 0.9])), True)
    low, high = np.split(np.array(body.bounding_box()), 2)
    for _ in range(int(rng.integers(1, 5))):
        place = rng.uniform(0.8 * low, 0.8 * high)
        if rng.random() < 0.5:
            part = Manifold.cube(tuple(rng.uniform([0.3, 0.3, 0.6], [0.8, 0.8, 2.0])), True)
        else:
            wide, narrow = rng.uniform([0.25, 0.12], [0.6, 0.5])
            sides = int(rng.integers(3, 10))
            part = Manifold.cylinder(rng.uniform(0.6, 2.0), wide, narrow, sides, True)
        if rng.random() < 0.5:
            part = part.rotate(tuple(rng.uniform(-90.0, 90.0, size=3)))
        body += part.translate(tuple(place))
    for _ in range(int(rng.integers(0, 3))):
        bore = Manifold.cylinder(6.0, rng.uniform(0.12, 0.25), -1.0, 8, True)
        angles = 90.0 * rng.integers(0, 2, size=3)
        body -= bore.rotate(tuple(angles)).translate(tuple(rng.uniform(0.6 * low, 0.6 * high)))
    return refined(Surface(*mesh_of(body)), count)[0]
