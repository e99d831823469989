"""A die is designed step by step; what it does is found from its corners alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError, RecipeError
from dicedesign.optimize.options import PaperWeights
from dicedesign.optimize.preferences import Preferences
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.view.design_session import DesignedShape, DesignSession, DieRequest

COIN = {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]}

PATIENCE = 120.0


def facet_probabilities(shape: DesignedShape) -> np.ndarray:
    """(k,) probabilities of the facets that bear the outcomes."""
    poses = rest_poses(shape.hull.vertices)
    cosines = shape.directions @ poses.normals.T
    assert (cosines.max(axis=1) > 1.0 - 1e-9).all()
    return poses.probabilities[cosines.argmax(axis=1)]


def reach(shape: DesignedShape, directions: np.ndarray) -> np.ndarray:
    """(p,) how far a shape reaches in each direction."""
    return (shape.hull.vertices @ directions.T).max(axis=0)


def wait_for(session: DesignSession) -> DesignSession:
    assert session.wait(PATIENCE)
    return session


def finished(session: DesignSession) -> DesignSession:
    session.run()
    wait_for(session)
    assert (session.state, session.status) == ("done", Status.CONVERGED)
    return session


@pytest.fixture
def session() -> Iterator[Any]:
    """Makes sessions, which end with the test."""
    made: list[DesignSession] = []

    def make(target: Any, **entries: Any) -> DesignSession:
        made.append(DesignSession(DieRequest(target, **entries)))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.mark.parametrize(("method", "target"), [("exact", {"binomial": 3}), ("paper", COIN)])
def test_a_die_gets_the_probabilities(session, target: dict[str, Any], method: str) -> None:
    made = finished(session(target, method=method))
    np.testing.assert_allclose(facet_probabilities(made.shape), made.target, atol=1e-11)
    assert made.message == Status.CONVERGED.value
    assert made.shape.error < 1e-11


def test_one_step_at_a_time(session) -> None:
    made, whole = session({"fair": 5}), finished(session({"fair": 5}))
    assert made.state == "paused"
    assert made.shape is None
    for number in range(1, 5):
        made.step()
        wait_for(made)
        assert made.state == "paused"
        assert len(made.shapes) == number
    # Those of a run without a pause.
    finished(made)
    assert len(made.shapes) == len(whole.shapes)
    for one, other in zip(made.shapes, whole.shapes, strict=True):
        np.testing.assert_array_equal(one.hull.vertices, other.hull.vertices)


def test_a_pause_holds(session) -> None:
    made = session({"fair": 5})

    def pause_at_three() -> None:
        if len(made.shapes) == 3:
            made.on_change = lambda: None
            made.pause()

    made.on_change = pause_at_three
    made.run()
    wait_for(made)
    assert (made.state, len(made.shapes)) == ("paused", 3)
    finished(made)
    assert len(made.shapes) > 3


def test_undo_goes_back_to_the_very_shape(session) -> None:
    made = session({"fair": 5})
    for _ in range(4):
        made.step()
        wait_for(made)
    first, second, third, _ = made.shapes
    made.undo()
    assert made.shape is third
    made.undo()
    assert made.shape is second
    assert made.state == "paused"
    made.step()
    wait_for(made)
    assert made.shapes[:2] == (first, second)
    assert len(made.shapes) == 3
    for _ in range(5):
        made.undo()
    assert made.shapes == (first,)
    finished(made)
    assert made.shapes[0] is first
    made.undo()
    assert (made.state, made.status, made.final_design) == ("paused", None, None)


def area_spread(shape: DesignedShape) -> float:
    """Standard deviation of the logarithms of the areas of the outcomes' facets."""
    hull, areas = shape.hull, []
    for direction in shape.directions:
        corners = hull.polygon(int(np.argmax(hull.normals @ direction)))
        edges = corners[1:] - corners[0]
        areas.append(np.linalg.norm(np.cross(edges[:-1], edges[1:]).sum(axis=0)) / 2.0)
    return float(np.log(areas).std())


def test_preferences_change_the_shape_and_keep_the_probabilities(session) -> None:
    made = finished(session({"sum_of_dice": [4, 4]}, prefer=Preferences(roundness=1.0)))
    before = made.shape
    made.change(replace(made.request, prefer=Preferences(areas=1.0)))
    assert made.state == "paused"
    finished(made)
    assert area_spread(made.shape) < 0.8 * area_spread(before)
    np.testing.assert_allclose(facet_probabilities(made.shape), made.target, atol=1e-11)


def test_weights_that_change_on_the_way(session) -> None:
    """The paper's descent goes on from the present shape with the new weights."""
    request = DieRequest({"fair": 5}, method="paper", weights=PaperWeights(barycenter=0.0))
    made = DesignSession(request)

    def change_at_forty() -> None:
        if len(made.shapes) == 40:
            made.change(replace(request, weights=PaperWeights(barycenter=5.0)))

    made.on_change = change_at_forty
    made.run()
    wait_for(made)
    before, after = made.shapes[39:41]
    assert before.terms.get("barycenter", 0.0) == 0.0
    assert after.terms["barycenter"] > 0.0
    assert (
        np.abs(np.sort(after.hull.vertices, axis=0) - np.sort(before.hull.vertices, axis=0)).max()
        < 0.05
    )
    assert made.status is Status.CONVERGED


def test_another_method_from_the_present_shape(session) -> None:
    made = session({"fair": 6}, method="paper")
    for _ in range(5):
        made.step()
        wait_for(made)
    before = made.shape
    made.change(replace(made.request, method="exact", prefer=Preferences()))
    finished(made)
    assert made.shapes[4] is before
    np.testing.assert_allclose(facet_probabilities(made.shape), 1.0 / 6.0, atol=1e-11)


def test_pinned_facets_stay_until_they_are_let_go(session) -> None:
    made = session({"sum_of_dice": [4, 4]}, prefer=Preferences(roundness=1.0))
    made.step()
    wait_for(made)
    before = made.shape
    made.change(replace(made.request, pinned=("3", "6")))
    finished(made)
    places = [made.labels.index("3"), made.labels.index("6")]
    held = before.directions[places]
    np.testing.assert_allclose(made.shape.directions[places], held, atol=1e-12)
    np.testing.assert_allclose(reach(made.shape, held), reach(before, held), atol=1e-12)
    others = [place for place in range(len(made.labels)) if place not in places]
    moved = np.abs(made.shape.directions - before.directions).max(axis=1)
    assert (moved[others] > 1e-6).all()

    pinned = made.shape
    made.change(replace(made.request, pinned=(), prefer=Preferences(areas=1.0)))
    finished(made)
    assert np.abs(made.shape.directions - pinned.directions)[places].max() > 1e-6


def test_labels_change_places_and_the_pin_stays_with_the_facet(session) -> None:
    target = [0.23, 0.22, 0.2, 0.18, 0.17]
    made = finished(session({"probabilities": target, "labels": list("abcde")}))
    before = made.shape
    made.change(replace(made.request, pinned=("a", "c")))
    made.swap("a", "e")
    assert made.request.pinned == ("e", "c")
    np.testing.assert_array_equal(made.shape.directions, before.directions[[4, 1, 2, 3, 0]])
    assert made.shape.error == pytest.approx(0.06)
    made.undo()
    assert made.shape is before
    made.change(replace(made.request, pinned=("c",)))
    made.swap("a", "e")
    finished(made)
    np.testing.assert_allclose(facet_probabilities(made.shape), target, atol=1e-11)
    np.testing.assert_allclose(made.shape.directions[2], before.directions[2], atol=1e-12)
    nearest = np.argmax(made.shape.directions @ before.directions.T, axis=1)
    np.testing.assert_array_equal(nearest, [4, 1, 2, 3, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"target": {"fair": 4}}, "target: expected the labels of this die, heads, tails, edge"),
        ({"target": {"probabilities": ["1/2", "x"]}}, "expected a number or a fraction"),
        ({"pinned": ("rim",)}, "pinned: expected labels out of heads, tails, edge, got 'rim'"),
        ({"pinned": ("edge",), "method": "paper"}, "pinned: expected none with the paper's method"),
        ({"seed": -1}, "seed: "),
        ({"method": "guess"}, "method"),
    ],
)
def test_what_cannot_be_asked_for_changes_nothing(
    session, change: dict[str, Any], message: str
) -> None:
    made = finished(session(COIN))
    before = made.request, made.shapes
    with pytest.raises(InputError, match=message):
        made.change(replace(made.request, **change))
    with pytest.raises(InputError, match="label: expected one of heads, tails, edge, got 'rim'"):
        made.swap("heads", "rim")
    assert (made.request, made.shapes) == before
    assert made.state == "done"


def test_bad_requests_begin_nothing() -> None:
    with pytest.raises(RecipeError, match=r"expected a sum of 1, got 0\.8333"):
        DesignSession(DieRequest({"probabilities": ["1/2", "1/3"]}))
    with pytest.raises(RecipeError, match="start: expected a mesh or a search for 2 outcomes"):
        DesignSession(DieRequest({"fair": 2}, method="paper"))
    session = DesignSession(DieRequest({"fair": 5}))
    with pytest.raises(InputError, match="label: expected a shape"):
        session.swap("1", "2")


def test_probabilities_that_cannot_be_met(session) -> None:
    """All facets of a cube-like die are pinned, and so are the probabilities."""
    made = finished(session({"fair": 6}))
    assert len(made.shape.hull.normals) == 6
    other = {"probabilities": [0.2, 0.2, 0.2, 0.2, 0.1, 0.1]}
    made.change(replace(made.request, target=other, pinned=tuple(made.labels)))
    made.run()
    wait_for(made)
    assert made.state == "done"
    assert made.status is not Status.CONVERGED
    assert made.message == made.status.value
    np.testing.assert_allclose(facet_probabilities(made.shape), 1.0 / 6.0, atol=1e-9)


def test_labels_that_no_font_has_end_before_the_design(session) -> None:
    made = session({**COIN, "labels": ["heads", "tails", "\u65e5"]})
    made.run()
    wait_for(made)
    assert made.state == "failed"
    assert "expected characters of the font DejaVu" in made.message


def test_steps_that_are_watched_lead_to_the_same(session) -> None:
    made = session(COIN)
    made.least_seconds = 0.01
    finished(made)
    np.testing.assert_allclose(facet_probabilities(made.shape), [1 / 2, 1 / 3, 1 / 6], atol=1e-11)


def test_whatever_is_pressed_it_ends_at_the_probabilities(session) -> None:
    """Buttons pressed at random, at moments that the machine chooses."""
    rng = np.random.default_rng(0)
    made = session({"fair": 5})

    def change() -> None:
        prefer = Preferences(roundness=float(rng.random()))
        made.change(replace(made.request, prefer=prefer))

    def swap() -> None:
        if made.shape is not None:
            made.swap(*rng.choice(made.labels, 2, replace=False).tolist())

    acts = (made.run, made.pause, made.step, made.undo, change, swap)
    for _ in range(60):
        acts[rng.integers(len(acts))]()
        made.wait(float(rng.choice([0.0, 0.01])))
        assert made.state in ("running", "paused", "done")
    finished(made)
    np.testing.assert_allclose(facet_probabilities(made.shape), 0.2, atol=1e-11)
