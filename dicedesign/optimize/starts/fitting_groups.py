"""Point groups that a target allows its die to have, the most helpful ones first."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.point_groups import HIGHEST_ORDER, fixed_space, point_group
from dicedesign.optimize.starts.orbit_layouts import Layout, OrbitLayouts
from dicedesign.runtime.arrays import Floats

__all__ = ["fitting_groups", "group_names"]

FLAT: Final = 1e-6
"""Singular value of an orbit's directions, over their number, below which they lie in a plane."""


DRAWS: Final = 8
"""Ways to spread the outcomes that are looked at, of which one suffices."""


def group_names() -> list[str]:
    """All that `point_group` knows but C1, those with several axes first."""
    several = ["Ih", "I", "Oh", "O", "Th", "Td", "T"]
    orders = range(HIGHEST_ORDER, 1, -1)
    forms = ("D{}d", "D{}h", "D{}", "C{}v", "C{}h", "C{}")
    one = [form.format(order) for order in orders for form in forms]
    odd = [f"S{2 * order}" for order in orders]
    return [*several, *one, *odd, "Cs", "Ci"]


def fitting_groups(target: Floats) -> list[str]:
    """Names of the point groups under which equally probable outcomes can be images of each other.

    Images are equally frequent however the die is thrown. So groups are sorted by how many odds
    they leave to be found: by the fewest orbits that the outcomes can lie on. Of those with as
    many, groups by which the facets of the outcomes alone enclose a solid come first, then larger
    ones. None leaves as many odds as there are outcomes.

    target: (k,) wanted probabilities.
    """
    found = []
    for place, name in enumerate(group_names()):
        group = point_group(name)
        try:
            layouts = OrbitLayouts(target, group)
        except InputError:
            continue
        if layouts.fewest < len(target):
            found.append((layouts.fewest, _is_open(layouts, group), -len(group), place, name))
    return [entry[-1] for entry in sorted(found)]


def _is_open(layouts: OrbitLayouts, group: Floats) -> bool:
    """Whether facets of the outcomes alone leave a solid unbounded: all in one belt around it, or
    all of one orbit about an axis with two different ends."""
    if layouts.fewest == 1 and np.trace(fixed_space(group)) > 0.5:
        return True
    rng = np.random.default_rng(0)
    return all(_is_unbounded(layouts.draw(rng), rng) for _ in range(DRAWS))


def _is_unbounded(layout: Layout, rng: np.random.Generator) -> bool:
    """Whether the facets are fewer than four, or face directions that lie in a plane."""
    directions = np.concatenate([site.carriers @ site.direction(rng) for site, _ in layout])
    if len(directions) < 4:
        return True
    return bool(np.linalg.svd(directions, compute_uv=False)[-1] < FLAT * len(directions))
