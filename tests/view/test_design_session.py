"""Design sessions run, pause, undo and change; probabilities come from the corners alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dicedesign.optimize.options import PaperWeights
from dicedesign.optimize.preferences import Preferences
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.view.design_session import DesignedShape, DesignSession, DieRequest

COIN = {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]}

PATIENCE = 120.0


def facet_probabilities(shape: DesignedShape) -> np.ndarray:
    """(k,) probabilities of the facets of the outcomes."""
    poses = rest_poses(shape.hull.vertices)
    cosines = shape.directions @ poses.normals.T
    assert (cosines.max(axis=1) > 1.0 - 1e-9).all()
    return poses.probabilities[cosines.argmax(axis=1)]


def support(shape: DesignedShape, directions: np.ndarray) -> np.ndarray:
    """(p,) support function of a shape in directions (p, 3)."""
    return (shape.hull.vertices @ directions.T).max(axis=0)


def wait_for(session: DesignSession) -> None:
    assert session.wait(PATIENCE)


def finish(session: DesignSession) -> DesignSession:
    session.run()
    wait_for(session)
    assert (session.state, session.status) == ("done", Status.CONVERGED)
    return session


@pytest.fixture
def make_session() -> Iterator[Any]:
    """Makes sessions that are closed after the test."""
    with ExitStack() as ends:

        def make(target: Any, **entries: Any) -> DesignSession:
            session = DesignSession(DieRequest(target, **entries))
            ends.callback(session.close)
            return session

        yield make


@pytest.mark.parametrize(("method", "target"), [("exact", {"binomial": 3}), ("paper", COIN)])
def test_a_die_gets_the_probabilities(make_session, target: dict[str, Any], method: str) -> None:
    session = finish(make_session(target, method=method))
    np.testing.assert_allclose(
        facet_probabilities(session.shape), session.target.probabilities, atol=1e-11
    )
    assert session.message == Status.CONVERGED.value
    assert session.shape.error < 1e-11


def test_one_step_at_a_time(make_session) -> None:
    session, whole = make_session({"fair": 5}), finish(make_session({"fair": 5}))
    assert session.state == "paused"
    assert session.shape is None
    for number in range(1, 5):
        session.run(1)
        wait_for(session)
        assert session.state == "paused"
        assert len(session.shapes) == number
    # A run without pauses has the same shapes.
    finish(session)
    assert len(session.shapes) == len(whole.shapes)
    for shape, expected in zip(session.shapes, whole.shapes, strict=True):
        np.testing.assert_array_equal(shape.hull.vertices, expected.hull.vertices)


def test_a_pause_holds(make_session) -> None:
    session = make_session({"fair": 5})

    def pause_at_three() -> None:
        if len(session.shapes) == 3:
            session.on_change = lambda: None
            session.pause()

    session.on_change = pause_at_three
    session.run()
    wait_for(session)
    assert (session.state, len(session.shapes)) == ("paused", 3)
    finish(session)
    assert len(session.shapes) > 3


def test_undo_restores_the_previous_shape(make_session) -> None:
    session = make_session({"fair": 5})
    for _ in range(4):
        session.run(1)
        wait_for(session)
    first, second, third, _ = session.shapes
    session.undo()
    assert session.shape is third
    session.undo()
    assert session.shape is second
    assert session.state == "paused"
    session.run(1)
    wait_for(session)
    assert session.shapes[:2] == (first, second)
    assert len(session.shapes) == 3
    for _ in range(5):
        session.undo()
    assert session.shapes == (first,)
    finish(session)
    assert session.shapes[0] is first
    session.undo()
    assert (session.state, session.status, session.final_design) == ("paused", None, None)


def area_spread(shape: DesignedShape) -> float:
    """Standard deviation of the logarithms of the areas of the outcomes' facets."""
    hull, areas = shape.hull, []
    for direction in shape.directions:
        corners = hull.polygon(int(np.argmax(hull.normals @ direction)))
        edges = corners[1:] - corners[0]
        areas.append(np.linalg.norm(np.cross(edges[:-1], edges[1:]).sum(axis=0)) / 2.0)
    return float(np.log(areas).std())


def test_preferences_change_the_shape_and_keep_the_probabilities(make_session) -> None:
    session = finish(make_session({"sum_of_dice": [4, 4]}, prefer=Preferences(roundness=1.0)))
    before = session.shape
    session.change(replace(session.request, prefer=Preferences(areas=1.0)))
    assert session.state == "paused"
    finish(session)
    assert area_spread(session.shape) < 0.8 * area_spread(before)
    np.testing.assert_allclose(
        facet_probabilities(session.shape), session.target.probabilities, atol=1e-11
    )


def test_weights_change_during_a_run(make_session) -> None:
    """The paper's descent continues from the current shape with the new weights."""
    request = DieRequest({"fair": 5}, method="paper", weights=PaperWeights(barycenter=0.0))
    session = DesignSession(request)

    def change_at_forty() -> None:
        if len(session.shapes) == 40:
            session.change(replace(request, weights=PaperWeights(barycenter=5.0)))

    session.on_change = change_at_forty
    session.run()
    wait_for(session)
    before, after = session.shapes[39:41]
    assert before.terms.get("barycenter", 0.0) == 0.0
    assert after.terms["barycenter"] > 0.0
    assert (
        np.abs(np.sort(after.hull.vertices, axis=0) - np.sort(before.hull.vertices, axis=0)).max()
        < 0.05
    )
    assert session.status is Status.CONVERGED


def test_another_method_continues_from_the_current_shape(make_session) -> None:
    session = make_session({"fair": 6}, method="paper")
    for _ in range(5):
        session.run(1)
        wait_for(session)
    before = session.shape
    session.change(replace(session.request, method="exact", prefer=Preferences()))
    finish(session)
    assert session.shapes[4] is before
    np.testing.assert_allclose(facet_probabilities(session.shape), 1.0 / 6.0, atol=1e-11)


def test_pinned_facets_stay_until_they_are_unpinned(make_session) -> None:
    session = make_session({"sum_of_dice": [4, 4]}, prefer=Preferences(roundness=1.0))
    session.run(1)
    wait_for(session)
    before = session.shape
    session.change(replace(session.request, pinned=("3", "6")))
    finish(session)
    places = [session.labels.index("3"), session.labels.index("6")]
    held = before.directions[places]
    np.testing.assert_allclose(session.shape.directions[places], held, atol=1e-12)
    np.testing.assert_allclose(support(session.shape, held), support(before, held), atol=1e-12)
    others = [place for place in range(len(session.labels)) if place not in places]
    moved = np.abs(session.shape.directions - before.directions).max(axis=1)
    assert (moved[others] > 1e-6).all()

    pinned = session.shape
    session.change(replace(session.request, pinned=(), prefer=Preferences(areas=1.0)))
    finish(session)
    assert np.abs(session.shape.directions - pinned.directions)[places].max() > 1e-6


def test_swapped_labels_leave_pins_on_their_facets(make_session) -> None:
    target = [0.23, 0.22, 0.2, 0.18, 0.17]
    session = finish(make_session({"probabilities": target, "labels": list("abcde")}))
    before = session.shape
    session.change(replace(session.request, pinned=("a", "c")))
    session.swap("a", "e")
    assert session.request.pinned == ("e", "c")
    np.testing.assert_array_equal(session.shape.directions, before.directions[[4, 1, 2, 3, 0]])
    assert session.shape.error == pytest.approx(0.06)
    session.undo()
    assert session.shape is before
    session.change(replace(session.request, pinned=("c",)))
    session.swap("a", "e")
    finish(session)
    np.testing.assert_allclose(facet_probabilities(session.shape), target, atol=1e-11)
    np.testing.assert_allclose(session.shape.directions[2], before.directions[2], atol=1e-12)
    nearest = np.argmax(session.shape.directions @ before.directions.T, axis=1)
    np.testing.assert_array_equal(nearest, [4, 1, 2, 3, 0])


def test_random_button_presses_still_converge(make_session) -> None:
    """The buttons are random, and their timing depends on the machine."""
    rng = np.random.default_rng(0)
    session = make_session({"fair": 5})

    def change() -> None:
        prefer = Preferences(roundness=float(rng.random()))
        session.change(replace(session.request, prefer=prefer))

    def swap() -> None:
        if session.shape is not None:
            session.swap(*rng.choice(session.labels, 2, replace=False).tolist())

    acts = (session.run, session.pause, lambda: session.run(1), session.undo, change, swap)
    for _ in range(60):
        acts[rng.integers(len(acts))]()
        session.wait(float(rng.choice([0.0, 0.01])))
        assert session.state in ("running", "paused", "done")
    finish(session)
    np.testing.assert_allclose(facet_probabilities(session.shape), 0.2, atol=1e-11)
