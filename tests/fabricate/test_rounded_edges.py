"""Rounded edges, by laws of parallel bodies: probabilities of the core, Steiner's volume."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dicedesign.errors import InputError
from dicedesign.fabricate.convex_object import round_edges
from dicedesign.fabricate.finish_options import EdgeOptions, core_scale
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.rest.poses import analyze

CUBE = convex_hull(np.array(np.meshgrid([-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0])).reshape(3, -1).T)


def random_hull(seed: int) -> ConvexHull:
    random = np.random.default_rng(seed)
    points = random.standard_normal((14, 3))
    return convex_hull(10.0 * points / np.linalg.norm(points, axis=1)[:, None])


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    radius=st.floats(0.05, 3.0),
    shape=st.sampled_from(["fillet", "chamfer"]),
)
def test_a_rounded_body_has_the_probabilities_of_its_core(
    seed: int, radius: float, shape: str
) -> None:
    """Its height over the table is the core's plus the radius in every direction, so its edges and
    corners have no rests either. The center of mass is the same."""
    core = random_hull(seed)
    body = round_edges(core, core.centroid, EdgeOptions(radius, shape))
    before, after = analyze(core, core.centroid), analyze(body, core.centroid)
    assert len(after.normals) == len(before.normals)
    pairs = np.argmax(before.normals @ after.normals.T, axis=1)
    np.testing.assert_allclose(after.normals[pairs], before.normals, atol=1e-9)
    # Strips are flat, so paths deviate slightly from those of a round body.
    rough = {"fillet": 5e-4, "chamfer": 5e-3}[shape] * radius
    np.testing.assert_allclose(after.probabilities[pairs], before.probabilities, atol=rough)


def test_a_cube_keeps_its_faces_and_steiners_volume() -> None:
    radius = 2.0
    body = round_edges(CUBE, np.zeros(3), EdgeOptions(radius))
    poses = analyze(body, np.zeros(3))
    np.testing.assert_allclose(poses.probabilities, np.full(6, 1 / 6), atol=1e-12)
    np.testing.assert_allclose(poses.areas, np.full(6, 100.0), rtol=1e-9)
    np.testing.assert_allclose(np.ptp(body.vertices, axis=0), np.full(3, 14.0), rtol=1e-12)
    steiner = 1000.0 + 600.0 * radius + 3 * 10.0 * math.pi * radius**2 + 4 / 3 * math.pi * radius**3
    sharp = 14.0**3
    # Flat strips are inside the round ones.
    assert steiner - 0.02 * (sharp - steiner) < body.surface.volume < steiner


def test_chamfers_are_two_strips_over_a_saddle() -> None:
    """Each edge of a cube has a saddle, where one flat chamfer would be a rest."""
    body = round_edges(CUBE, np.zeros(3), EdgeOptions(1.0, "chamfer"))
    slopes = np.sort(np.abs(body.normals), axis=1)[:, 1:]
    edges = body.normals[(np.abs(body.normals).min(axis=1) < 1e-9) & (slopes[:, 0] > 1e-9)]
    assert len(edges) == 24
    np.testing.assert_allclose(edges.max(axis=1) ** 2 + edges.min(axis=1) ** 2 <= 1.0 + 1e-9, True)
    assert len(analyze(body, np.zeros(3)).normals) == 6


def test_unsuitable_radii_are_refused() -> None:
    """Within a hundredth and a fifth of the size; chamfers may be finer."""
    for part in (0.01, 0.2):
        assert 0.0 < core_scale(EdgeOptions(part * 30.0), 30.0) < 1.0
    for radius in (0.299, 6.001):
        with pytest.raises(InputError, match=r"edges\.radius_mm: expected at (least 0\.3|most 6)"):
            core_scale(EdgeOptions(radius), 30.0)
    with pytest.raises(InputError, match="radius_mm"):
        EdgeOptions(math.nan)
    with pytest.raises(InputError, match="fillet or chamfer"):
        EdgeOptions(1.0, "round")
    assert core_scale(EdgeOptions(0.03, "chamfer"), 30.0) == pytest.approx(0.998)
