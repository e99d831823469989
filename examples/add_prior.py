"""Add a prior of start directions: an axis close to horizontal, as of a bottle that rolls.

`--prior` and a recipe's `prior` are the name, a colon and a text, which `read` turns into a prior.
"""

import numpy as np

import dicedesign as dd
from dicedesign.extensions import PRIORS, PriorKind


def belt(text):
    axis = np.array([float(x) for x in text.split(",")])
    axis /= np.linalg.norm(axis)
    return dd.DensityFunction(lambda directions: np.exp(-20.0 * (directions @ axis) ** 2))


PRIORS.register(
    PriorKind(name="belt", line="the axis close to horizontal", form="belt:x,y,z", read=belt)
)

box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1.2)])
print(dd.rest_poses(box).under("belt:0,0,1").probabilities)
