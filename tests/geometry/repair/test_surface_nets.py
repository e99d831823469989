"""Surfaces between nodes of a grid are manifolds once no cell is cut twice."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.ndimage import gaussian_filter, label

from dicedesign.geometry.repair.grid_surface import surface_nets, without_double_cuts
from dicedesign.runtime.arrays import Floats, Integers


def middles(nodes: Integers, ahead: Integers) -> Floats:
    return (nodes + ahead) / 2.0


def noise(seed: int, blur: float, share: float) -> Floats:
    """Values of which a share is above 0, none on the border."""
    values = np.random.default_rng(seed).normal(size=(17, 14, 15))
    if blur:
        values = gaussian_filter(values, blur)
    values = values - np.quantile(values, 1.0 - share)
    border = np.pad(np.zeros(tuple(n - 2 for n in values.shape), dtype=bool), 1, constant_values=1)
    return np.where(border, -np.inf, values)


def rings_around_points(triangles: Integers) -> Integers:
    """How often the triangles around each point close to a ring, by walking from edge to edge."""
    after = {(int(t[k]), int(t[k - 2])): int(t[k - 1]) for t in triangles for k in range(3)}
    rings = np.zeros(int(triangles.max()) + 1, dtype=np.int64)
    seen: set[tuple[int, int]] = set()
    for point, neighbor in after:
        if (point, neighbor) not in seen:
            rings[point] += 1
            while (point, neighbor) not in seen:
                seen.add((point, neighbor))
                neighbor = after[point, neighbor]
    return rings


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("blur", "share"), [(0.0, 0.1), (0.0, 0.4), (0.7, 0.3), (1.5, 0.5)])
def test_the_surface_of_noise_is_a_manifold(seed: int, blur: float, share: float) -> None:
    values = noise(seed, blur, share)
    inside = without_double_cuts(values)
    assert inside[values > 0.0].all()
    points, triangles = surface_nets(inside, middles)
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    assert len(np.unique(edges, axis=0)) == len(edges)  # each once each way
    assert {tuple(edge) for edge in edges} == {tuple(edge) for edge in edges[:, ::-1]}
    assert (rings_around_points(triangles) == 1).all()
    # Nodes side by side are in one solid, or in one gap; the outer one has no surface of its own.
    parts = label(inside)[1] + label(~inside)[1] - 1
    assert trimesh.Trimesh(points, triangles, process=False).body_count == parts


def test_nothing_is_added_to_a_ball() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(20.0)] * 3, indexing="ij"), axis=-1)
    values = 7.3 - np.linalg.norm(grid - 9.6, axis=-1)
    inside = without_double_cuts(values)
    np.testing.assert_array_equal(inside, values > 0.0)

    def crossing(nodes: Integers, ahead: Integers) -> Floats:
        here, there = values[tuple(nodes.T)], values[tuple(ahead.T)]
        return nodes + (here / (here - there))[:, None] * (ahead - nodes)

    mesh = trimesh.Trimesh(*surface_nets(inside, crossing), process=False)
    assert mesh.volume == pytest.approx(4.0 / 3.0 * np.pi * 7.3**3, rel=0.03)
    assert np.abs(np.linalg.norm(mesh.vertices - 9.6, axis=1) - 7.3).max() < 0.25


def test_two_cubes_at_an_edge_are_joined_by_the_likelier_node() -> None:
    values = np.full((5, 5, 3), -1.0)
    values[1, 1, 1] = values[2, 2, 1] = 1.0
    values[1, 2, 1] = -0.5
    inside = without_double_cuts(values)
    assert inside.sum() == 3
    assert inside[1, 2, 1]


def test_no_node_inside_leaves_no_triangle() -> None:
    points, triangles = surface_nets(without_double_cuts(np.full((4, 4, 4), -1.0)), middles)
    assert (len(points), len(triangles)) == (0, 0)
