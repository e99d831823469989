"""The example engine, Bullet, against the package's own."""

from __future__ import annotations

import runpy
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import BOARD, OCTAHEDRON, alike, box, rigid_body_with_rests, turn_down

from dicedesign.throws.engines import ENGINES
from dicedesign.throws.simulation import simulate


@pytest.fixture(scope="module")
def bullet() -> Iterator[dict[str, Any]]:
    """Namespace of the example, whose engine is registered."""
    pytest.importorskip("pybullet")
    yield runpy.run_path(str(Path(__file__).parents[2] / "examples" / "bullet_engine.py"))
    ENGINES.unregister("bullet")


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.8])
def test_a_ball_bounces(bullet: dict[str, Any], restitution: float) -> None:
    """An octahedron that falls onto a vertex rises to the squared restitution times the height."""
    body, _ = rigid_body_with_rests(OCTAHEDRON)
    with bullet["_scene"](body, replace(BOARD, restitution=restitution)) as scene:
        turn = turn_down(body.vertices[0])
        scene.release(np.array([0.0, 0.0, 9.0]), turn, np.zeros(3), np.zeros(3))
        scene.advance(int(5.0 / bullet["STEP"]), None)
        energy = scene.state()[1] - 1.0
    assert energy == pytest.approx(8.0 * restitution**2, rel=0.02, abs=1e-3)


@compiled_only
@pytest.mark.usefixtures("bullet")
def test_frequencies() -> None:
    """Contact laws make little difference to a box."""
    body, _ = rigid_body_with_rests(box(1.0, 1.15, 1.3))
    ours = simulate(body, BOARD, 2000, 1).counts
    theirs = simulate(body, BOARD, 150, 2, engine="bullet")
    assert theirs.unresolved == 0
    # Opposite sides are merged.
    assert alike(ours.reshape(3, 2).sum(axis=1), theirs.counts.reshape(3, 2).sum(axis=1)) > 1e-3
