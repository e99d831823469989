"""Layouts of a target's outcomes on the orbits of a point group, and the groups that have a layout,
the most helpful first."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

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

SAME = 9
"""Decimal digits for comparing products of matrices."""


@dataclass(frozen=True)
class OrbitSite:
    """Possible directions of the first facet of an orbit, and the maps to the others.

    Attributes
    ----------
    projection: (3, 3) onto space, a mirror plane or an axis.
    carriers: (s, 3, 3) elements of the group that map the first facet to the s facets, the identity
        first.
    pole: (3,) the end of the axis, or None.
    """

    projection: Floats
    carriers: Floats
    pole: Floats | None = None

    @classmethod
    def of(cls, group: Floats, projection: Floats, pole: Floats | None = None) -> OrbitSite:
        """Site of the directions that a projection keeps, for a group (g, 3, 3)."""
        products = (group @ projection).reshape(len(group), 9).round(SAME) + 0.0
        first = np.unique(products, axis=0, return_index=True)[1]
        return cls(projection, group[np.sort(first)], pole)

    @property
    def size(self) -> int:
        """Number of facets of the orbit."""
        return len(self.carriers)

    def direction(self, rng: np.random.Generator) -> Floats:
        """Random unit vector (3,) of the site."""
        drawn = rng.normal(size=3)
        return unit_vectors(self.projection @ drawn) if self.pole is None else self.pole


Layout = list[tuple[OrbitSite, tuple[int, ...]]]
"""Sites of orbits, and the outcomes on each."""


class OrbitLayouts:
    """Layouts of outcomes on as few orbits as possible, with equal probabilities on each.

    Each end of an axis has at most one facet; mirror planes and other directions have any number.
    """

    def __init__(self, target: Floats, group: Floats) -> None:
        """Find the least number of orbits. target: (k,) probabilities; group: (g, 3, 3).

        Raises InputError if equal probabilities do not fill whole orbits.
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
        """Number of facets of the smallest orbit that is not on an axis."""
        descending = np.argsort(-target, kind="stable")
        probabilities = target[descending]
        breaks = (
            np.flatnonzero(np.diff(probabilities) < -EQUAL_PROBABILITIES * probabilities[:-1]) + 1
        )
        self._classes = [np.sort(members) for members in np.split(descending, breaks)]
        # For the first n classes of equal outcomes: the fewest orbits, by the pole orbits in use.
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
        """Number of orbits of the outcomes."""

    def draw(self, rng: np.random.Generator) -> Layout:
        """Draw a random layout."""
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
        """Draw a site of an orbit without an outcome: not on an axis, where facets are always
        rests."""
        return self._plane(rng) if self.planes and rng.random() < 0.5 else self.anywhere

    def _plane(self, rng: np.random.Generator) -> OrbitSite:
        return self.planes[rng.integers(len(self.planes))]

    def _splits(self, outcomes: int, free: frozenset[int]) -> Iterator[tuple[frozenset[int], int]]:
        """Yield free pole orbits for a number of outcomes, and the number of all their orbits."""
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


FLAT = 1e-6
"""Singular value of directions, over their number, below which they are in a plane."""

DRAWS = 8
"""Number of layouts that are tried; one that encloses a solid suffices."""


def group_names() -> list[str]:
    """Names of all point groups but C1, groups with several axes first."""
    several = ["Ih", "I", "Oh", "O", "Th", "Td", "T"]
    orders = range(HIGHEST_ORDER, 1, -1)
    forms = ("D{}d", "D{}h", "D{}", "C{}v", "C{}h", "C{}")
    one = [form.format(order) for order in orders for form in forms]
    odd = [f"S{2 * order}" for order in orders]
    return [*several, *one, *odd, "Cs", "Ci"]


def fitting_groups(target: Floats) -> list[str]:
    """Names of the point groups under which equally probable outcomes can be images of each other.

    Images are equally probable however the die is thrown. So groups are sorted by the number of
    orbits of outcomes, the number of probabilities that remain to be found. Then come groups for
    which the facets of the outcomes alone enclose a solid, then larger groups. Groups with as many
    orbits as outcomes are left out.

    target: (k,) target probabilities.
    """
    all_layouts = []
    _, equal = np.unique(target.round(SAME), return_counts=True)
    for place, name in enumerate(group_names()):
        # Two outcomes may be on one axis; of more, some fill an orbit around it.
        if len(target) > 2 and _smallest_orbit(name) > equal.max():
            continue
        group = point_group(name)
        try:
            layouts = OrbitLayouts(target, group)
        except InputError:
            continue
        if layouts.fewest < len(target):
            rng = np.random.default_rng(0)
            # One orbit around an axis with two different ends leaves one of these open.
            is_open = layouts.fewest == 1 and np.trace(fixed_space(group)) > 0.5
            is_open = is_open or all(_is_unbounded(layouts.draw(rng), rng) for _ in range(DRAWS))
            all_layouts.append((layouts.fewest, is_open, -len(group), place, name))
    return [entry[-1] for entry in sorted(all_layouts)]


def _smallest_orbit(name: str) -> int:
    """Number of facets of the smallest orbit that is not on the main axis."""
    several = {"T": 4, "Td": 4, "Th": 6, "O": 6, "Oh": 6, "I": 12, "Ih": 12, "Cs": 1, "Ci": 1}
    order = re.search("[0-9]+", name)
    return several[name] if order is None else int(order[0])


def _is_unbounded(layout: Layout, rng: np.random.Generator) -> bool:
    """Whether there are fewer than four facets, or their directions are in a plane."""
    directions = np.concatenate([site.carriers @ site.direction(rng) for site, _ in layout])
    if len(directions) < 4:
        return True
    return bool(np.linalg.svd(directions, compute_uv=False)[-1] < FLAT * len(directions))
