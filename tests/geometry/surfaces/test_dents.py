"""Surfaces of which no concave die can be made are told from those with dents."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bent_capsule, bumpy_sphere, surface_of
from common.paths import public_data

from dicedesign.concave.shapes import SHAPES, shape
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.surfaces.closed_surface import make_surface, require_dents
from dicedesign.geometry.surfaces.surface import Surface


def subdivided_cube() -> Surface:
    mesh = trimesh.creation.box()
    for _ in range(3):
        mesh = mesh.subdivide()
    return surface_of(mesh)


def egg() -> Surface:
    surface = ball(3)
    return surface.moved(surface.points * [1.0, 1.0, 1.4] * (1.0 + 0.1 * surface.points[:, 2:]))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("made", [subdivided_cube, egg])
def test_convex_surfaces_are_sent_to_the_exact_method(made: object, scale: float) -> None:
    assert callable(made)
    surface = made()
    with pytest.raises(InputError, match="a convex one; take method"):
        require_dents(surface.moved(scale * surface.points + 3.0 * scale))


@pytest.mark.parametrize("height", [0.0, 0.01])
def test_no_die_is_near_a_sphere(height: float) -> None:
    surface = ball(3)
    ripples = 1.0 + height * np.sin(7.0 * surface.points[:, :1])
    with pytest.raises(InputError, match="nearly a sphere"):
        require_dents(surface.moved(surface.points * ripples))


def test_surfaces_with_dents_pass() -> None:
    for surface in (bumpy_sphere(), bent_capsule(), *(shape(name) for name in SHAPES)):
        require_dents(surface)


@pytest.mark.parametrize("name", ["spot", "penguin", "koala", "bunny", "armadillo"])
def test_models_pass(name: str) -> None:
    surface, _ = make_surface(read_body(public_data(f"models/{name}.obj")))
    require_dents(surface)
