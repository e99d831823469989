"""List the resting poses of a mesh, and roll it from one orientation to rest.

python examples/resting_poses.py [MESH]
"""

from __future__ import annotations

import sys

import numpy as np

import dicedesign as dd

BRICK = np.array([[x, y, z] for x in (0.0, 3.0) for y in (0.0, 2.0) for z in (0.0, 1.0)])


def main() -> None:
    """Print the poses of a mesh file, or of a brick of 3 by 2 by 1."""
    body = dd.read_body(sys.argv[1]) if len(sys.argv) > 1 else BRICK
    poses = dd.rest_poses(body)
    print(f"center of mass {poses.center_of_mass} ({poses.center_of_mass_source})")
    for probability, normal, margin in zip(
        poses.probabilities, poses.normals, np.degrees(poses.margins), strict=True
    ):
        print(f"{probability:.6f}  down {np.round(normal, 4)}  tips over after {margin:.1f}°")
    for step in dd.roll(body, [0.3, -0.2, 1.0]):
        print(f"on a {step.contact}, center of mass {step.height:.4f} above the table")


if __name__ == "__main__":
    main()
