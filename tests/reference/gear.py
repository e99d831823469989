"""A toothed wheel."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold

from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.triangles import Surface

SPACING = 0.085
"""Longest edge."""


def gear() -> Surface:
    """A spur gear of nine teeth with a hole; its rims are sharp; genus 1."""
    turn = 2.0 * np.pi / 9
    profile = ((0.78, -0.5), (0.78, -0.30), (1.08, -0.17), (1.08, 0.17), (0.78, 0.30))
    rim = [
        (radius * np.cos(turn * (tooth + part)), radius * np.sin(turn * (tooth + part)))
        for tooth in range(9)
        for radius, part in profile
    ]
    face = CrossSection([rim]) - CrossSection.circle(0.33, 24)
    wheel = Manifold.extrude(face, 0.5).translate((0.0, 0.0, -0.25)).refine_to_length(SPACING)
    return mesh_of(wheel)
