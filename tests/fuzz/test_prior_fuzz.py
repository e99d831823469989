"""Random bodies under priors: what is true of every body, however it balances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import KINDS

import dicedesign as dd
from dicedesign.errors import DegenerateBodyError, OutsideHullError
from dicedesign.runtime.arrays import Floats
from tests.reference.problem import Problem

FUZZ = settings.get_profile("fuzz")

CLOSE = 1e-11
"""Areas of basins, by which these probabilities are measured, close to 1e-11 or so for the worst
bodies."""


def by_facet(poses: dd.RestPoses) -> Floats:
    probabilities = np.zeros(len(poses.hull.normals))
    probabilities[poses.facets] = poses.probabilities
    return probabilities


@pytest.mark.parametrize("kind", KINDS)
def test_laws_of_priors(kind: str) -> None:
    @FUZZ
    @given(
        KINDS[kind],
        st.integers(0, 10**6),
        st.sampled_from([0.3, 4.0, 300.0, 1e6]),
        st.sampled_from([1.0, 30.0, 90.0, 140.0]),
    )
    def check(problem: Problem, seed: int, concentration: float, angle: float) -> None:
        try:
            poses = dd.rest_poses(
                problem.points,
                "hull" if problem.center is None else problem.center,
                coplanar_tolerance=problem.coplanar_tolerance,
            )
        except (DegenerateBodyError, OutsideHullError):
            return
        axis = np.random.default_rng(seed).normal(size=3)
        # A cap and what it leaves out make up the sphere.
        inside = np.sin(np.radians(angle) / 2.0) ** 2
        cap = by_facet(poses.under(dd.SphericalCap(axis, angle)))
        rest = by_facet(poses.under(dd.SphericalCap(-axis, 180.0 - angle)))
        np.testing.assert_allclose(
            inside * cap + (1.0 - inside) * rest, by_facet(poses), atol=CLOSE
        )
        narrow = poses.under(dd.VonMisesFisher(axis, concentration))
        assert narrow.errors is not None
        assert narrow.errors.max() < CLOSE
        total = max(CLOSE, narrow.errors.sum())
        assert narrow.probabilities.sum() == pytest.approx(1.0, abs=total)
        # All of a body's rests together, however many, have what a direction has.
        np.testing.assert_allclose(
            by_facet(poses.under(dd.VonMisesFisher(axis, 0.0))), by_facet(poses), atol=1e-13
        )

    check()
