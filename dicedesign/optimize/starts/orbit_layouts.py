"""Ways to spread a target's outcomes over the orbits of a point group, and the groups that allow
one, the most helpful ones first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.point_groups import (
    HIGHEST_ORDER,
    fixed_space,
    mirrors,
    point_group,
    pole_orbits,
)
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import EQUAL_PROBABILITIES

SAME: Final = 9
"""Decimal digits to which products of matrices are compared."""


@dataclass(frozen=True)
class OrbitSite:
    """Directions that the first facet of an orbit may face, and how it is carried to the others.

    Attributes
    ----------
    projection: (3, 3) onto all of space, a mirror plane or an axis.
    carriers: (s, 3, 3) the elements of the group that make its s images, the identity first.
    pole: (3,) the end of the axis that is meant, or None.
    """

    projection: Floats
    carriers: Floats
    pole: Floats | None = None

    @classmethod
    def of(cls, group: Floats, projection: Floats, pole: Floats | None = None) -> OrbitSite:
        """The site of directions that a projection keeps, under a group (g, 3, 3)."""
        products = (group @ projection).reshape(len(group), 9).round(SAME) + 0.0
        first = np.unique(products, axis=0, return_index=True)[1]
        return cls(projection, group[np.sort(first)], pole)

    @property
    def size(self) -> int:
        """Facets of the orbit."""
        return len(self.carriers)

    def direction(self, rng: np.random.Generator) -> Floats:
        """(3,) a random unit vector there."""
        drawn = rng.normal(size=3)
        return unit_vectors(self.projection @ drawn) if self.pole is None else self.pole


Layout = list[tuple[OrbitSite, tuple[int, ...]]]
"""Sites of orbits, with the outcomes on each."""


class OrbitLayouts:
    """Ways to spread outcomes over as few orbits as possible, with equal probabilities on each.

    There is one facet at most at each end of an axis, and any number on mirror planes and off them.
    """

    def __init__(self, target: Floats, group: Floats) -> None:
        """target: (k,) wanted probabilities; group: (g, 3, 3).

        Raises InputError where equal probabilities do not fill whole orbits.
        """
        self.poles = [
            OrbitSite.of(group, np.outer(orbit[0], orbit[0]), orbit[0])
            for orbit in pole_orbits(group)
        ]
        self.planes = [
            OrbitSite.of(group, fixed_space(np.stack([group[0], mirror])))
            for mirror in mirrors(group)
        ]
        self.anywhere = OrbitSite.of(group, group[0])
        self.smallest = (self.planes or [self.anywhere])[0].size
        """Facets of the smallest orbit of which there is any number."""
        descending = np.argsort(-target, kind="stable")
        probabilities = target[descending]
        breaks = (
            np.flatnonzero(np.diff(probabilities) < -EQUAL_PROBABILITIES * probabilities[:-1]) + 1
        )
        self._classes = [np.sort(members) for members in np.split(descending, breaks)]
        # For the first classes of equal outcomes, the fewest orbits by the pole orbits in use.
        self._fewest = [{frozenset[int](): 0}]
        every = frozenset(range(len(self.poles)))
        for members in self._classes:
            fewest_by_poles: dict[frozenset[int], int] = {}
            for used, orbits in self._fewest[-1].items():
                for taken, more in self._splits(len(members), every - used):
                    both = used | taken
                    fewest_by_poles[both] = min(
                        fewest_by_poles.get(both, orbits + more), orbits + more
                    )
            if not fewest_by_poles:
                raise InputError(self._refusal(len(members), float(target[members[0]])))
            self._fewest.append(fewest_by_poles)
        self.fewest = min(self._fewest[-1].values())
        """Orbits of the outcomes."""

    def draw(self, rng: np.random.Generator) -> Layout:
        """One of them, at random."""
        ends = [used for used, orbits in self._fewest[-1].items() if orbits == self.fewest]
        used = ends[rng.integers(len(ends))]
        layout: Layout = []
        for number in reversed(range(len(self._classes))):
            members = self._classes[number].tolist()
            before, orbits = self._fewest[number], self._fewest[number + 1][used]
            ways = [
                taken
                for taken, more in self._splits(len(members), used)
                if before.get(used - taken, np.inf) + more == orbits
            ]
            taken = ways[rng.integers(len(ways))]
            sites = [self.poles[pole] for pole in sorted(taken)]
            rest = len(members) - sum(site.size for site in sites)
            if rest % self.anywhere.size:
                sites.append(self._plane(rng))
            sites += [self.anywhere] * (rest // self.anywhere.size)
            for site in sites:
                layout.append((site, tuple(members[: site.size])))
                members = members[site.size :]
            used = used - taken
        return layout

    def helper(self, rng: np.random.Generator) -> OrbitSite:
        """A site of an orbit without outcome: not on an axis, where a facet is always a rest."""
        return self._plane(rng) if self.planes and rng.random() < 0.5 else self.anywhere

    def _plane(self, rng: np.random.Generator) -> OrbitSite:
        return self.planes[rng.integers(len(self.planes))]

    def _splits(self, outcomes: int, free: frozenset[int]) -> Iterator[tuple[frozenset[int], int]]:
        """Free pole orbits for a number of outcomes, with the number of all orbits."""
        for few in range(len(free) + 1):
            for taken in combinations(sorted(free), few):
                rest = outcomes - sum(self.poles[pole].size for pole in taken)
                if rest >= 0 and rest % self.smallest == 0:
                    yield frozenset(taken), few + -(-rest // self.anywhere.size)

    def _refusal(self, outcomes: int, probability: float) -> str:
        sizes = f"{self.anywhere.size} facets"
        if self.planes:
            sizes += f", or {self.smallest} on mirror planes"
        if self.poles:
            ends = ", ".join(str(site.size) for site in self.poles)
            sizes += f", and on axes, once each, {ends}"
        return (
            "symmetry: expected outcomes of equal probability to fill whole orbits of facets, got "
            f"{outcomes} of probability {probability:.6g} where orbits have {sizes}; take a "
            "smaller group such as Cs, or another number of equal outcomes"
        )


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

    Images are equally frequent however the die is thrown. So groups are sorted by how many
    probabilities they leave to be found: by the fewest orbits that the outcomes can lie on. Of
        those with as
    many, groups by which the facets of the outcomes alone enclose a solid come first, then larger
    ones. None leaves as many probabilities as there are outcomes.

    target: (k,) wanted probabilities.
    """
    all_layouts = []
    for place, name in enumerate(group_names()):
        group = point_group(name)
        try:
            layouts = OrbitLayouts(target, group)
        except InputError:
            continue
        if layouts.fewest < len(target):
            rng = np.random.default_rng(0)
            # One orbit about an axis with two different ends leaves one of them open.
            is_open = layouts.fewest == 1 and np.trace(fixed_space(group)) > 0.5
            is_open = is_open or all(_is_unbounded(layouts.draw(rng), rng) for _ in range(DRAWS))
            all_layouts.append((layouts.fewest, is_open, -len(group), place, name))
    return [entry[-1] for entry in sorted(all_layouts)]


def _is_unbounded(layout: Layout, rng: np.random.Generator) -> bool:
    """Whether the facets are fewer than four, or face directions that lie in a plane."""
    directions = np.concatenate([site.carriers @ site.direction(rng) for site, _ in layout])
    if len(directions) < 4:
        return True
    return bool(np.linalg.svd(directions, compute_uv=False)[-1] < FLAT * len(directions))
