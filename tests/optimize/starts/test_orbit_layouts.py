"""Outcomes spread over orbits, against all ways there are."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.optimize.targets import sum_of_dice

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
    """The least number of orbits that hold classes of so many outcomes, by trying everything."""
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
    """Odds of which so many are equal, in a random order."""
    weights = np.repeat(1.0 + np.arange(len(classes)), classes)
    return np.random.default_rng(0).permutation(weights / weights.sum())


@pytest.mark.parametrize("name", ORBITS)
def test_layouts_are_those_that_trying_everything_finds(name: str) -> None:
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
        assert sorted(outcome for _, some in layout for outcome in some) == list(range(len(target)))
        for site, some in layout:
            assert len(some) == len(site.carriers)
            assert len(set(target[list(some)])) == 1
            assert len(some) in (others if site.pole is None else poles)
        # No end of an axis is taken twice.
        ends = [site.pole for site, _ in layout if site.pole is not None]
        assert len({tuple(np.round(end, 9)) for end in ends}) == len(ends)
    assert possible >= (1 if name == "Oh" else 3)


@pytest.mark.parametrize("name", ORBITS)
def test_a_site_has_as_many_directions_as_it_says(name: str) -> None:
    group = point_group(name)
    layouts, rng = (
        OrbitLayouts(np.full(len(group), 1.0 / len(group)), group),
        np.random.default_rng(0),
    )
    poles, others = ORBITS[name]
    assert sorted(len(site.carriers) for site in layouts.poles) == poles
    assert [layouts.smallest, layouts.largest] == [min(others), max(others)]
    for site in [*layouts.poles, *layouts.planes, layouts.anywhere]:
        direction = site.direction(rng)
        np.testing.assert_allclose(site.projection @ direction, direction, atol=1e-15)
        assert np.linalg.norm(direction) == pytest.approx(1.0, rel=1e-15)
        images = {tuple(row) for row in ((group @ direction).round(9) + 0.0).tolist()}
        carried = {tuple(row) for row in ((site.carriers @ direction).round(9) + 0.0).tolist()}
        assert carried == images
        assert len(carried) == len(site.carriers)
        np.testing.assert_array_equal(site.carriers[0], np.eye(3))


def test_two_dice_make_five_pairs_and_a_seven() -> None:
    target = sum_of_dice([6, 6]).probabilities
    for name in ("Cs", "C2"):
        layout = OrbitLayouts(target, point_group(name)).draw(np.random.default_rng(0))
        assert {some for _, some in layout} == {(5,), *((i, 10 - i) for i in range(5))}


def test_odds_that_differ_by_rounding_are_equal() -> None:
    target = np.array([0.1 + 0.2, 0.3, 0.2, 0.2])
    layout = OrbitLayouts(target, point_group("Ci")).draw(np.random.default_rng(0))
    assert target[0] != target[1]
    assert {some for _, some in layout} == {(0, 1), (2, 3)}


@pytest.mark.parametrize(
    ("classes", "name", "text"),
    [
        ([2], "Oh", "got 2 of probability 0.5 where orbits have 48 facets, or 24 on mirror planes"),
        ([11], "S4", "where orbits have 4 facets, and on axes, once each, 2; take a smaller group"),
        ([1, 1, 1], "C2", "got 1 of probability 0.166667 where orbits have 2 facets, and on axes"),
    ],
)
def test_odds_that_fill_no_orbits_are_refused_in_words(
    classes: list[int], name: str, text: str
) -> None:
    with pytest.raises(InputError, match=text):
        OrbitLayouts(target_of(classes), point_group(name))
