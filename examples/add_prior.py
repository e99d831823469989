"""Add a prior of start directions: an axis near level, as of a bottle that rolls.

The name is what stands before the first colon in `--prior` and in a recipe's `prior`; `read` gets
the rest.
"""

import numpy as np

import dicedesign as dd


def belt(text):
    axis = np.array([float(x) for x in text.split(",")])
    axis /= np.linalg.norm(axis)
    return dd.DensityFunction(lambda directions: np.exp(-20.0 * (directions @ axis) ** 2))


dd.extensions.PRIORS.register(
    dd.extensions.PriorKind(name="belt", line="the axis near level", form="belt:x,y,z", read=belt)
)

box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1.2)])
print(dd.rest_poses(box).under("belt:0,0,1").probabilities)
