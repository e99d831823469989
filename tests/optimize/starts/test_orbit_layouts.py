"""Layouts of outcomes on orbits against exhaustive search, and the most helpful symmetries."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts, fitting_groups
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.targets import binomial, fair, sum_of_dice

# Sizes of orbits in textbooks: on each end of the axes, then those of which there is any number.
ORBITS = {
    "C1": ([], [1]),
    "Cs": ([], [1, 2]),
    "C2": ([1, 1], [2]),
    "C2v": ([1, 1], [2, 4]),
    "C5v": ([1, 1], [5, 10]),
    "S4": ([2], [4]),
    "D3": ([2, 3, 3], [6]),
    "D3h": ([2, 3, 3], [6, 12]),
    "D3d": ([2, 6], [6, 12]),
    "T": ([4, 4, 6], [12]),
    "Oh": ([6, 8, 12], [24, 48]),
}


def fewest_orbits(classes: list[int], name: str) -> int | None:
    """Least number of orbits for classes of numbers of outcomes, by exhaustive search."""
    poles, others = ORBITS[name]
    best = None
    for owner in product(range(len(classes) + 1), repeat=len(poles)):
        total = 0
        for number, outcomes in enumerate(classes):
            on_axes = [size for size, of in zip(poles, owner, strict=True) if of == number]
            rest = outcomes - sum(on_axes)
            ways = [
                sum(counts)
                for counts in product(range(max(rest, 0) + 1), repeat=len(others))
                if sum(n * size for n, size in zip(counts, others, strict=True)) == rest
            ]
            if not ways:
                break
            total += len(on_axes) + min(ways)
        else:
            best = total if best is None else min(best, total)
    return best


def target_of(classes: list[int]) -> np.ndarray:
    """Probabilities in random order, with classes of equal ones."""
    weights = np.repeat(1.0 + np.arange(len(classes)), classes)
    return np.random.default_rng(0).permutation(weights / weights.sum())


@pytest.mark.parametrize("name", ORBITS)
def test_layouts_are_as_small_as_by_exhaustive_search(name: str) -> None:
    rng = np.random.default_rng(1)
    poles, others = ORBITS[name]
    possible = 0
    for _ in range(40):
        classes = rng.integers(1, 15, size=rng.integers(1, 4)).tolist()
        fewest, target = fewest_orbits(classes, name), target_of(classes)
        if fewest is None:
            with pytest.raises(InputError, match="to fill whole orbits of facets"):
                OrbitLayouts(target, point_group(name))
            continue
        possible += 1
        layout = OrbitLayouts(target, point_group(name)).draw(rng)
        assert len(layout) == fewest
        assert sorted(outcome for _, outcomes in layout for outcome in outcomes) == list(
            range(len(target))
        )
        for site, outcomes in layout:
            assert len(outcomes) == len(site.carriers)
            assert len(set(target[list(outcomes)])) == 1
            assert len(outcomes) in (others if site.pole is None else poles)
        # No end of an axis is taken twice.
        ends = [site.pole for site, _ in layout if site.pole is not None]
        assert len({tuple(np.round(end, 9)) for end in ends}) == len(ends)
    assert possible >= (1 if name == "Oh" else 3)


def test_probabilities_that_differ_by_rounding_are_equal() -> None:
    target = np.array([0.1 + 0.2, 0.3, 0.2, 0.2])
    layout = OrbitLayouts(target, point_group("Ci")).draw(np.random.default_rng(0))
    assert target[0] != target[1]
    assert {outcomes for _, outcomes in layout} == {(0, 1), (2, 3)}


@pytest.mark.parametrize(
    ("outcomes", "name"), [(4, "Td"), (6, "Oh"), (7, "D7h"), (10, "D5d"), (30, "Ih")]
)
def test_fair_dice_have_the_symmetry_of_isohedral_solids(outcomes: int, name: str) -> None:
    """Tetrahedron, cube, octahedron, dodecahedron, icosahedron, trapezohedra, the rhombic
    triacontahedron, and prisms for odd numbers."""
    assert fitting_groups(fair(outcomes).probabilities)[0] == name


def test_the_first_groups_have_an_orbit_for_each_probability() -> None:
    for target, distinct in ((binomial(4), 3), (sum_of_dice([6, 6]), 6)):
        for name in fitting_groups(target.probabilities)[:2]:
            group = point_group(name)
            starts = shapes_near(target.probabilities, 0, group=group)
            start = next(one for one in starts if one is not None)
            orbits = orbits_of_directions(start.directions, group)
            assert len(np.unique(orbits)) == distinct
            for orbit in np.unique(orbits):
                assert np.ptp(target.probabilities[orbits == orbit]) < 1e-12
    assert fitting_groups(np.array([0.5, 0.3, 0.2])) == []
