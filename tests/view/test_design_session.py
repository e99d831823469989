"""Design sessions run and change; probabilities come from the corners alone."""

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


def finish(session: DesignSession) -> DesignSession:
    session.run()
    assert session.wait(PATIENCE)
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
    assert session.state == "new"
    finish(session)
    assert area_spread(session.shape) < 0.8 * area_spread(before)
    np.testing.assert_allclose(
        facet_probabilities(session.shape), session.target.probabilities, atol=1e-11
    )


def change_at(session: DesignSession, step: int, **entries: Any) -> list[DesignedShape]:
    """Change the request after a step of a run. Returns all shapes of the run."""
    shapes: list[DesignedShape] = []

    def on_change() -> None:
        shape = session.shape
        if shape is not None and (not shapes or shape is not shapes[-1]):
            shapes.append(shape)
            if len(shapes) == step:
                session.change(replace(session.request, **entries))

    session.on_change = on_change
    finish(session)
    return shapes


def test_weights_change_during_a_run(make_session) -> None:
    """The paper's descent continues from the current shape with the new weights."""
    session = make_session({"fair": 5}, method="paper", weights=PaperWeights(barycenter=0.0))
    shapes = change_at(session, 40, weights=PaperWeights(barycenter=5.0))
    before = shapes[39]
    after = next(shape for shape in shapes[40:] if "barycenter" in shape.terms)
    assert before.terms.get("barycenter", 0.0) == 0.0
    assert after.terms["barycenter"] > 0.0
    assert (
        np.abs(np.sort(after.hull.vertices, axis=0) - np.sort(before.hull.vertices, axis=0)).max()
        < 0.05
    )


def test_another_method_continues_from_the_current_shape(make_session) -> None:
    session = make_session({"fair": 6}, method="paper")
    shapes = change_at(session, 5, method="exact", prefer=Preferences())
    assert np.abs(shapes[6].directions - shapes[4].directions).max() < 0.3
    np.testing.assert_allclose(facet_probabilities(session.shape), 1.0 / 6.0, atol=1e-11)
    assert not session.follows_recipe


def test_swapped_labels_go_to_each_others_facets(make_session) -> None:
    target = [0.23, 0.22, 0.2, 0.18, 0.17]
    session = finish(make_session({"probabilities": target, "labels": list("abcde")}))
    before = session.shape
    session.swap("a", "e")
    np.testing.assert_array_equal(session.shape.directions, before.directions[[4, 1, 2, 3, 0]])
    assert session.shape.error == pytest.approx(0.06)
    session.swap("a", "e")
    np.testing.assert_array_equal(session.shape.directions, before.directions)
    session.swap("a", "e")
    finish(session)
    np.testing.assert_allclose(facet_probabilities(session.shape), target, atol=1e-11)
    nearest = np.argmax(session.shape.directions @ before.directions.T, axis=1)
    np.testing.assert_array_equal(nearest, [4, 1, 2, 3, 0])


def test_random_changes_still_converge(make_session) -> None:
    """The changes are random, and their timing depends on the machine."""
    rng = np.random.default_rng(0)
    session = make_session({"fair": 5})

    def change() -> None:
        prefer = Preferences(roundness=float(rng.random()))
        session.change(replace(session.request, prefer=prefer))

    def swap() -> None:
        if session.shape is not None:
            session.swap(*rng.choice(session.labels, 2, replace=False).tolist())

    acts = (session.run, change, swap)
    for _ in range(60):
        acts[rng.integers(len(acts))]()
        session.wait(float(rng.choice([0.0, 0.01])))
        assert session.state in ("new", "running", "done")
    finish(session)
    np.testing.assert_allclose(facet_probabilities(session.shape), 0.2, atol=1e-11)
