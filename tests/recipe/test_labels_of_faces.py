"""Labels on the faces of dice: outcomes of several faces, assignment and numbering."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from common.kernels import compiled_only
from common.made_up_die import SIDES, box, run_to_design

from dicedesign.fabricate.numbering import spread_labels
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.clusters import ClusteredRests
from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.optimize.energy import Energy, energy_terms
from dicedesign.optimize.options import PaperWeights
from dicedesign.optimize.starts.shapes import prism, repulsion
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.results.parts import RoundOfThrows, Status
from tests.reference.oracle import hull_probabilities

LABELS = ["a", "b", "a", "c", "b", "b", "c"]
SHARES = [0.1, 0.12, 0.2, 0.18, 0.15, 0.05, 0.2]


def make(last: str = "engrave", **entries: Any) -> Work:
    given = {"name": "die", "symmetry": "none", "size_mm": 40, "print": False}
    work = Work(parse_recipe({**given, **entries}))
    run_stages(work, last=last)
    return work


def oracle_error(work: Work) -> float:
    """Largest |p - q| of a designed die in 60 digits, by outcome."""
    hull, target = work.die.hull, work.target
    shares = hull_probabilities(hull, [hull.centroid])
    facets = np.argmax(work.die.directions @ hull.normals.T, axis=1)
    sums = [0 * shares[0]] * len(target.labels)
    for facet, outcome in zip(facets, target.outcome_of_face.tolist(), strict=True):
        sums[outcome] += shares[facet]
    return max(abs(float(p - q)) for p, q in zip(sums, target.probabilities.tolist(), strict=True))


@pytest.mark.parametrize("method", ["exact", "paper"])
def test_the_faces_of_an_outcome_share_its_probability(method: str) -> None:
    entries: dict[str, Any] = {"target": {"probabilities": SHARES, "labels": LABELS}}
    if method == "paper":
        entries |= {"method": "paper", "start": {"repulsion": {}}}
    work = make(**entries)
    result = work.result()
    assert (result.status, result.labels) == ("converged", ("a", "b", "c"))
    np.testing.assert_allclose(result.target, [0.3, 0.32, 0.38], rtol=1e-14)
    assert oracle_error(work) <= 1e-12
    assert len(result.facets) == 7
    for label, p in zip(result.labels, result.target, strict=True):
        own = [facet.probability for facet in result.facets if facet.label == label]
        assert sum(own) == pytest.approx(p, abs=2e-8)
    assert result.engraved is not None
    assert result.engraved.max_abs_error <= 2e-8
    assert sorted(placement.text for placement in work.finished.placements) == sorted(LABELS)
    # The shares are free: they are no longer those given.
    own = sorted(facet.probability for facet in result.facets)
    assert np.abs(np.array(own) - np.sort(SHARES)).max() > 1e-4


def test_kept_shares_make_the_die_of_a_label_for_each_face() -> None:
    names = [f"{label}{place}" for place, label in enumerate(LABELS)]
    target = {"probabilities": SHARES, "labels": LABELS, "share": "equal"}
    joined = make("check", target=target, assignment=LABELS)
    apart = make("check", target={"probabilities": SHARES, "labels": names})
    # Faces with one label are assigned in their order.
    np.testing.assert_array_equal(joined.die.hull.vertices, apart.die.hull.vertices)
    split = apart.result().probabilities
    sums = [sum(p for p, each in zip(split, LABELS, strict=True) if each == k) for k in "abc"]
    np.testing.assert_allclose(joined.result().probabilities, sums, rtol=1e-9)


def test_thrown_probabilities_are_those_of_outcomes() -> None:
    method = {"exact": {"probabilities": "thrown", "prefer": {}, "starts": 20}}
    target = {"probabilities": SHARES, "labels": LABELS}
    result = make("throws", target=target, method=method).result()
    assert result.thrown is not None
    np.testing.assert_allclose(result.thrown.momentum, [0.3, 0.32, 0.38], atol=2e-3)


def test_a_thick_coin_has_the_known_thickness() -> None:
    """A third each: the height of a cylinder is its diameter over the root of 8 (von Neumann). As
    the rim has 12 sides, the height is that at which its regular pyramids have the solid angle."""
    outcomes = [
        {"label": "heads", "probability": "1/3"},
        {"label": "tails", "probability": "1/3"},
        {"label": "rim", "probability": "1/3", "faces": 12},
    ]
    work = make(
        target={"outcomes": outcomes}, symmetry="D12h", engrave={"blank": ["rim"]}, last="engrave"
    )
    assert work.result().status == "converged"
    assert [placement.text for placement in work.finished.placements] == ["heads", "tails"]
    hull = work.die.hull
    height = float(np.ptp(hull.vertices[:, 2]))
    radius = float(np.hypot(*hull.vertices.T[:2]).max())
    # Solid angle of a regular pyramid of n sides at its apex, the center of mass.
    high, turn = height / 2.0, np.pi / 12.0
    slant = np.hypot(high, radius * np.cos(turn))
    angle = 2.0 * np.pi - 24.0 * float(np.arcsin(high * np.sin(turn) / slant))
    assert angle == pytest.approx(4.0 * np.pi / 3.0, abs=1e-9)
    assert height / (2.0 * radius) == pytest.approx(8.0**-0.5, rel=0.03)


def test_equal_faces_of_three_coins_are_an_octahedron() -> None:
    """Its symmetries map any face to any other, so that it is right however it is thrown."""
    work = make(target={"binomial": 3, "faces": 8}, symmetry="Oh")
    assert work.result().status == "converged"
    assert sorted(placement.text for placement in work.finished.placements) == list("01112223")
    corners = work.die.hull.vertices
    between = np.abs(corners @ corners.T) / (corners**2).sum(axis=1).mean()
    np.testing.assert_allclose(between, np.round(between), atol=1e-12)
    assert len(corners) == 6


def test_equal_faces_are_equally_probable_without_a_symmetry() -> None:
    work = make("check", target={"binomial": 3, "faces": 8})
    assert len(work.final.poses.probabilities) == 8
    np.testing.assert_allclose(work.final.poses.probabilities, 0.125, atol=1e-9)


def test_equal_labels_come_on_opposite_sides_of_a_cube() -> None:
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    labels = np.array(["+", "+", "0", "0", "-", "-"])
    order = spread_labels(normals, labels.tolist(), np.full(6, 1 / 6))
    shown = labels[order]
    assert (shown[:3] == shown[3:]).all()
    # Faces of other probabilities keep their labels.
    unequal = np.array([0.1, 0.2, 0.3, 0.05, 0.15, 0.2])
    kept = spread_labels(normals, labels.tolist(), unequal)
    assert [int(k) for k in kept if kept[k] != k] in ([], [1, 5], [5, 1])


def test_energies_of_shared_outcomes_agree_with_torch() -> None:
    """The kernels' energy and gradient, against those of torch and difference quotients."""
    start, rng = repulsion(9, 0), np.random.default_rng(0)
    points = start.points * [1.0, 0.9, 0.8] + 0.02 * rng.normal(size=start.points.shape)
    outcome_of, target = np.array([0, 1, 2, 0, 1, 2, 2, 2, 1]), np.array([0.2, 0.3, 0.5])
    weights = PaperWeights().of_probabilities

    def state(moved: np.ndarray) -> ClusteredRests:
        rests = evaluate_rests(torch.from_numpy(moved).requires_grad_())
        return ClusteredRests.of(rests, start.directions, target, outcome_of)

    here = state(points)
    energy, terms = Energy(here, weights), energy_terms(here, weights)
    for name, value in energy.terms.items():
        assert value == pytest.approx(terms[name].item(), rel=1e-10, abs=1e-14)
    along = rng.normal(size=points.shape)
    step = 1e-6
    ends = [sum(Energy(state(points + s * along), weights).terms.values()) for s in (step, -step)]
    slope = (ends[0] - ends[1]) / (2.0 * step)
    hull_points = here.rests.vertices.detach().numpy()
    source = [int(np.argmin(np.abs(points - p).sum(axis=1))) for p in hull_points]
    assert float((energy.gradient * along[source]).sum()) == pytest.approx(slope, rel=1e-5)


# Assignment.

THROWN = {"exact": {"probabilities": "thrown", "prefer": {}}}


@pytest.mark.parametrize(
    "method",
    [
        {"paper": {"prefer": {}}},
        {"exact": {"prefer": {}}},
        pytest.param(THROWN, marks=compiled_only),
    ],
    ids=["paper", "exact", "thrown"],
)
def test_labels_get_their_places(method: dict[str, Any]) -> None:
    """In an order that differs from its inverse; facets move little from probabilities of 1/4."""
    order, shares = list("cabd"), {"a": 0.22, "b": 0.24, "c": 0.26, "d": 0.28}
    target = {"probabilities": list(shares.values()), "labels": list(shares)}
    entries = {"start": {"prism": {}}, "assignment": order, "method": method}
    work = design_recipe(parse_recipe({"name": "die", "target": target, **entries}), last="check")
    named = prism(4).directions[[order.index(label) for label in work.target.labels]]
    assert ((work.die.directions * named).sum(axis=1) > np.cos(np.radians(20.0))).all()
    if method is not THROWN:
        expected = [shares[label] for label in work.target.labels]
        np.testing.assert_allclose(work.solid.outcomes.probabilities, expected, atol=1e-5)


# Numbering.


def number_box(
    style: str, sides: tuple[float, float, float] = (1.0, 1.0, 1.0), **more: Any
) -> Work:
    """Run up to the stage "check" of a box with labels in the order of `SIDES`."""
    work = run_to_design(box(*sides), entries={"numbering": style, **more})
    run_stages(work, after="design", last="check")
    return work


def across(work: Work) -> list[float]:
    """Sums of the numbers on opposite facets."""
    directions = work.die.directions
    numbers = np.array([float(label) for label in work.target.labels])
    opposite = (directions @ directions.T).argmin(axis=1)
    return sorted(set((numbers + numbers[opposite]).tolist()))


def test_a_cube_gets_sums_of_seven() -> None:
    assert across(number_box("given")) == [5.0, 7.0, 9.0]
    work = number_box("standard", engrave=True)
    assert across(work) == [7.0]
    assert work.status is Status.CONVERGED
    assert any("sum to 7" in note for note in work.notes)
    # Labels follow their outcomes.
    run_stages(work, after="check", last="engrave")
    for direction, placement, text in zip(
        work.die.directions, work.engraved.placements, work.target.labels, strict=True
    ):
        assert placement.text == text
        np.testing.assert_allclose(placement.frame[:3, 2], -direction, atol=0.01)


@pytest.mark.parametrize("style", ["standard", "balanced"])
def test_probabilities_stay_with_their_labels(style: str) -> None:
    """Only opposite sides are interchangeable, and in a square box four sides."""
    for sides in ((4.0, 5.0, 6.0), (4.0, 4.0, 6.0)):
        work = number_box(style, sides)
        assert work.status is Status.CONVERGED
        before, after = SIDES, work.die.directions
        poses = work.plain.poses
        np.testing.assert_allclose(
            outcome_probabilities(poses, after).probabilities,
            outcome_probabilities(poses, before).probabilities,
            atol=1e-6,
        )
        assert sorted(map(tuple, after.tolist())) == sorted(map(tuple, before.tolist()))


def test_rounds_of_throws_are_reordered_too() -> None:
    requested = np.arange(6.0)
    thrown = RoundOfThrows(10, 0.0, 0.0, 0.0, True, tuple(requested), tuple(2.0 * requested))
    work = run_to_design(box(1.0, 1.0, 1.0), entries={"numbering": "standard"}, rounds=(thrown,))
    run_stages(work, after="design", last="numbering")
    (after,) = work.die.rounds
    of_side = (work.die.directions @ SIDES.T).argmax(axis=1)
    assert list(of_side) != list(range(6))
    np.testing.assert_array_equal(after.requested, requested[of_side])
    np.testing.assert_array_equal(after.frequencies, 2.0 * requested[of_side])


def test_a_symmetric_die_stays_symmetric() -> None:
    """Facets that the group maps to each other have equally probable labels."""
    probabilities = [1 / 8, 1 / 4, 1 / 8, 1 / 4, 1 / 8, 1 / 8]
    entries = {"symmetry": "D2h", "numbering": "standard", "engrave": False}
    recipe = parse_recipe({"name": "d6", "target": {"probabilities": probabilities}, **entries})
    work = design_recipe(recipe, last="check")
    assert work.status is Status.CONVERGED
    orbits = orbits_of_directions(work.die.directions, recipe.group())
    for orbit in np.unique(orbits):
        assert np.ptp(work.target.probabilities[orbits == orbit]) == 0.0


def test_a_die_with_a_missing_facet_is_not_renumbered() -> None:
    directions = SIDES.copy()
    directions[5] = [0.8, 0.6, 0.0]
    work = run_to_design(
        box(4.0, 5.0, 6.0), directions, Status.NO_PROGRESS, {"fair": 6}, {"numbering": "standard"}
    )
    run_stages(work, after="design", last="check")
    np.testing.assert_array_equal(work.die.directions, directions)
    assert any("no facet" in note for note in work.notes)
