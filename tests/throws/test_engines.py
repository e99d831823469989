"""The package's own engine, against closed forms, conservation laws and symmetry, and MuJoCo where
soft and hard contacts have to agree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only, without_kernels
from common.thrown import (
    BOARD,
    alike,
    box,
    fits,
    random_body,
    random_points,
    rigid_body_with_rests,
    sample_states,
    turns_of,
)

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.throws.engines import ENGINES, advance, longest_throw, throw_states, time_step
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import GRAVITY, load_table, mixture_tables
from examples.mujoco_engine import MUJOCO, rest_below

WOOD = load_table("hard-wood")

SLIPPERY = 9
"""Place of a table in the mixture of board-game."""


@compiled_only
def test_energy_and_angular_momentum_in_flight() -> None:
    body, _ = rigid_body_with_rests(random_points(2))
    before = sample_states(body, WOOD, 20)
    before[:, 2] = 1000.0
    after, steps = before.copy(), 280
    seconds = steps * time_step(WOOD)
    rests, taken = advance(body, WOOD, after, steps)
    assert (rests == -1).all()
    assert (taken == steps).all()
    fallen = before[:, 9] * seconds - 0.5 * GRAVITY * seconds**2
    np.testing.assert_allclose(after[:, 2] - before[:, 2], fallen, rtol=1e-9)
    np.testing.assert_allclose(after[:, 7:9], before[:, 7:9])
    momenta = [
        np.einsum("nij,nj->ni", turns_of(state), state[:, 10:] * body.moments)
        for state in (before, after)
    ]
    np.testing.assert_allclose(*momenta, atol=1e-9 * WOOD.spin)
    energies = [state[:, 10:] ** 2 @ body.moments for state in (before, after)]
    np.testing.assert_allclose(*energies, rtol=1e-9)


@compiled_only
@pytest.mark.parametrize(("entry", "number"), [(2, np.inf), (9, np.nan)])
def test_a_motion_that_is_not_finite_ends(entry: int, number: float) -> None:
    body, _ = random_body(1)
    states = sample_states(body, BOARD, 3)
    states[1, entry] = number
    rests, taken = advance(body, BOARD, states, 40)
    assert rests.tolist() == [-1, -1, -1]
    assert taken.tolist() == [40, 0, 40]


@compiled_only
def test_certain_rests_are_reached() -> None:
    """Throws that continue after their rest is certain end at no other rest."""
    body, _ = random_body(4)
    states = sample_states(body, WOOD, 100)
    rests, _ = advance(body, WOOD, states, 100_000)
    assert (rests >= 0).all()
    for _ in range(100):
        again, _ = advance(body, WOOD, states, 16)
        assert ((again == rests) | (again == -1)).all()
    np.testing.assert_array_equal(again, rests)


@compiled_only
def test_throws_that_end_in_a_slide_end_as_they_would_later() -> None:
    """On a slippery table; without the early end they stop on the same rests."""
    table, saved = mixture_tables("board-game")[SLIPPERY], 0
    for number in range(4):
        body, _ = random_body(number)
        states = sample_states(body, table, 60, number)
        # No edge is far enough from the foot to let it slide.
        patient = replace(body, flat=body.flat * [1.0, -1.0, 1.0])
        steps = round(longest_throw(table) / time_step(table))
        early, taken = advance(body, table, states.copy(), steps)
        late, all_steps = advance(patient, table, states.copy(), steps)
        np.testing.assert_array_equal(early, late)
        saved += int(all_steps.sum() - taken.sum())
    assert saved > 0


@compiled_only
def test_a_box_has_the_probabilities_of_its_symmetry() -> None:
    body, poses = rigid_body_with_rests(box(1.0, 1.15, 1.3))
    throws = simulate(body, BOARD, 3000, 1)
    assert throws.unresolved == 0
    pairs = throws.counts.reshape(3, 2)
    # Opposite sides are equally probable.
    for pair in pairs:
        assert fits(pair, [0.5, 0.5]) > 1e-3
    # Momentum favors the most probable sides.
    assert fits(throws.counts, poses.probabilities) < 1e-6
    assert pairs[0].sum() / 3000 > poses.probabilities[:2].sum()


@without_kernels()
def test_without_the_kernels() -> None:
    body, _ = random_body(1)
    with pytest.raises(InputError, match=r"engine native: expected the compiled .* C\+\+ compiler"):
        throw_states(body, BOARD, sample_states(body, BOARD, 1))


@pytest.mark.parametrize("restitution", [0.0, 0.95])
def test_the_time_limit_of_a_bouncing_ball(restitution: float) -> None:
    table = replace(BOARD, height=30.0, restitution=restitution)
    speed = np.sqrt(2.0 * GRAVITY * 30.0)
    ball = speed / GRAVITY * (1.0 + 2.0 * (restitution ** np.arange(1, 1000)).sum())
    set_down = longest_throw(replace(table, height=0.0))
    assert longest_throw(table) == pytest.approx(ball + set_down, rel=1e-12)


# The example engine, MuJoCo.


@compiled_only
def test_rests_compiled_and_in_python() -> None:
    names = "vertices start neighbors left right normals rest_of_facet barriers"
    fields = names.split(" ")
    for seed in range(3):
        body, _ = random_body(seed)
        downs = unit_vectors(np.random.default_rng(seed).normal(size=(200, 3)))
        compiled = kernels.compiled.rests_below(*(getattr(body, name) for name in fields), downs)
        np.testing.assert_array_equal(compiled, [rest_below(body, down) for down in downs])


@pytest.fixture
def mujoco() -> Iterator[str]:
    """Name of the engine, which is registered."""
    pytest.importorskip("mujoco", reason="the extra 'bench' is not installed")
    yield ENGINES.register(MUJOCO).name
    ENGINES.unregister(MUJOCO.name)


@compiled_only
def test_frequencies_without_friction(mujoco: str) -> None:
    """There is no slip to couple with, and soft contacts have the table's restitution."""
    body, _ = random_body(1)
    table = replace(BOARD, friction=0.0, speed=0.0, spin=0.0)
    ours = simulate(body, table, 2000, 1).counts
    theirs = simulate(body, table, 100, 2, engine=mujoco)
    assert theirs.unresolved == 0
    assert alike(ours, theirs.counts) > 1e-3
