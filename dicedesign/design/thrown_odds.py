"""Odds of thrown dice as a differentiable function of their vertices."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.differentiable import RestEvaluation
from dicedesign.design.inertia import hull_inertia
from dicedesign.geometry.mass import solid_inertia
from dicedesign.throws.momentum import MomentumModel, landing_odds, momentum_model
from dicedesign.throws.passes import Passes, features

__all__ = ["ThrownOdds"]

Floats = NDArray[np.float64]

_TORCH: Final[ModuleType] = torch


@dataclass(frozen=True)
class ThrownOdds:
    """The momentum model of a table, for hulls.

    Attributes
    ----------
    model: the model in NumPy and in torch, or None for a table without momentum.
    """

    model: tuple[MomentumModel, MomentumModel] | None

    @classmethod
    def on(cls, table: str) -> ThrownOdds:
        """That of a table by its name or file; raises as `momentum_model`."""
        model = momentum_model(table)
        return cls(None if model is None else (model, model.converted(torch.as_tensor)))

    def odds(self, rests: RestEvaluation) -> Floats:
        """(k,) odds of the rests, in the order of `rests.paths.rests`."""
        if self.model is None or len(rests.odds) == 1:
            return rests.odds
        hull, passes = rests.hull, Passes.of(rests.hull, rests.paths)
        inertia = solid_inertia(hull.vertices, hull.triangles)
        center = rests.equilibria.center_of_mass
        seen = features(passes, hull.vertices, center, inertia, rests.odds, np)
        found: Floats = landing_odds(seen, passes, self.model[0], np)
        return found

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """The same, with gradients."""
        return self._of(rests, rests.vertices, rests.probabilities, rests.given_center)

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the hull's vertices, with which the center of mass of a uniform
        solid moves."""
        vertices = torch.from_numpy(rests.hull.vertices).requires_grad_()
        resting = torch.from_numpy(rests.odds).requires_grad_()
        given = rests.given_center
        thrown = self._of(rests, vertices, resting, None if given is None else given.detach())
        rows, by_odds = torch.autograd.grad(
            thrown,
            (vertices, resting),
            torch.eye(len(thrown), dtype=torch.float64),
            is_grads_batched=True,
            allow_unused=True,
            materialize_grads=True,
        )
        found: Floats = rows.reshape(len(thrown), -1).numpy()
        return found + by_odds.numpy() @ _resting_jacobian(rests)

    def _of(
        self, rests: RestEvaluation, vertices: Tensor, resting: Tensor, given: Tensor | None
    ) -> Tensor:
        if self.model is None or len(resting) == 1:
            return resting + 0.0
        center, inertia = hull_inertia(vertices, rests.hull)
        if given is not None:
            center = given
        passes = Passes.of(rests.hull, rests.paths)
        seen = features(passes, vertices, center, inertia, resting, _TORCH)
        found: Tensor = landing_odds(seen, passes, self.model[1], _TORCH)
        return found


def _resting_jacobian(rests: RestEvaluation) -> Floats:
    """(k, 3 n) that of the odds without momentum."""
    jacobian = rests.jacobian
    if jacobian is not None:
        return jacobian
    rows = [
        torch.autograd.grad(value, rests.vertices, retain_graph=True)[0].numpy().ravel()
        for value in rests.probabilities
    ]
    return np.stack(rows)
