"""Add a starting shape: two pyramids, base to base.

`options` is a dataclass with the keys that a recipe may give. `check` refuses impossible options
while the recipe is read. `make` returns a `dd.starts.Start`: call `normalize_start` with points
(n, 3) in any unit and the outward unit normals (k, 3) of the facets with outcomes, in the order of
the target, unless the recipe's `assignment` reorders them. The exact method needs rests on these
facets and on no other. `search`
instead of `make` yields one shape after another; `surface` returns the closed surface of a concave
die.
"""

from dataclasses import dataclass

import numpy as np

import dicedesign as dd
from dicedesign.extensions import STARTS, Options, StartKind
from dicedesign.starts import normalize_start


@dataclass(frozen=True)
class BipyramidOptions(Options):
    """`height` of each tip over the base's circumscribed radius."""

    height: float = 1.0


def check(options, outcomes):
    if outcomes < 6 or outcomes % 2:
        raise ValueError(f"start.bipyramid: expected an even number from 6 on, got {outcomes}")


def make(options, task):
    angles = 4.0 * np.pi * np.arange(task.outcomes // 2) / task.outcomes
    ring = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    tip = np.array([[0.0, 0.0, options.height]])
    upper = np.cross(np.roll(ring, -1, axis=0) - ring, tip - ring)
    upper /= np.linalg.norm(upper, axis=1, keepdims=True)
    directions = np.concatenate([upper, upper * [1.0, 1.0, -1.0]])
    return normalize_start(np.concatenate([ring, tip, -tip]), directions)


STARTS.register(
    StartKind(
        name="bipyramid",
        line="two pyramids, base to base; an even number of outcomes",
        options=BipyramidOptions,
        check=check,
        make=make,
    )
)

die = dd.design({"fair": 8}, start={"bipyramid": {"height": 1.2}})
print(die.message)
