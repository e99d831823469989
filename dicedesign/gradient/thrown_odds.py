"""Odds of thrown dice as a differentiable function of their vertices, and how they change from
table to table.

Values and derivatives come from compiled kernels, or where there are none from the formulas of
`dicedesign.throws` in NumPy and torch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.geometry.solid import solid_inertia
from dicedesign.gradient.body_function import adjoint_function
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.gradient.solid_moments import hull_inertia
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumModel, momentum_model
from dicedesign.throws.momentum_odds import hull_odds, landing_odds
from dicedesign.throws.tables import Table
from dicedesign.throws.transition_features import Transitions, body_features


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
        return cls._of(momentum_model(table))

    @classmethod
    def _of(cls, model: MomentumModel | None) -> ThrownOdds:
        return cls(None if model is None else (model, model.converted(torch.as_tensor)))

    def onto(self, table: Table) -> ThrownOdds:
        """That of another table, or of the nearest one that the model knows."""
        return self._of(None if self.model is None else self.model[0].near(table))

    def odds(self, rests: RestEvaluation) -> Floats:
        """(k,) odds of the rests, in the order of `rests.paths.rests`."""
        if self.model is None or len(rests.odds) == 1:
            return rests.odds
        hull, center = rests.hull, rests.equilibria.center_of_mass
        inertia = kernels.solid_inertia(hull)
        if inertia is kernels.UNDECIDED:
            inertia = solid_inertia(hull.vertices, hull.triangles)
        return hull_odds(hull, rests.paths, center, inertia, rests.odds, self.model[0])

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """The same, with gradients."""
        given, resting = rests.given_center, rests.probabilities
        if self.model is None or len(resting) == 1:
            return resting + 0.0

        def adjoint(slopes: Floats) -> tuple[Floats, ...] | None:
            gradients = self._gradients(rests, slopes[None])
            if gradients is kernels.UNDECIDED:
                return None
            by_vertices, by_center, by_odds = (rows[0] for rows in gradients)
            by_vertices = rests.with_center(by_vertices.reshape(-1, 3), by_center)
            return (by_vertices, by_odds) if given is None else (by_vertices, by_odds, by_center)

        def formula(vertices: Tensor, resting: Tensor, given: Tensor | None = None) -> Tensor:
            return self._formula(rests, vertices, resting, given)

        inputs = (rests.vertices, resting) if given is None else (rests.vertices, resting, given)
        return adjoint_function(self.odds(rests), adjoint, formula, *inputs)

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the hull's vertices, with which the center of mass of a uniform
        solid moves."""
        resting = rests.jacobian
        if self.model is None or len(resting) == 1:
            return resting
        gradients = self._gradients(rests, np.eye(len(resting)))
        if gradients is kernels.UNDECIDED:
            rows, by_odds = self._formula_rows(rests)
            return rows + by_odds @ resting
        rows, by_center, by_odds = gradients
        return rests.rows_with_center(rows, by_center) + by_odds @ resting

    def _gradients(
        self, rests: RestEvaluation, weights: Floats
    ) -> tuple[Floats, Floats, Floats] | None:
        """Gradients (r, 3 n), (r, 3), (r, k) of weighted sums (r, k) of the odds in the vertices,
        in the center of mass and in the odds without momentum; None without kernels."""
        assert self.model is not None
        body = rests.hull, rests.paths, self.model[0], rests.equilibria.center_of_mass
        return kernels.thrown_gradients(*body, rests.odds, weights)

    def _formula_rows(self, rests: RestEvaluation) -> tuple[Floats, Floats]:
        """Derivatives (k, 3 n) in the vertices and (k, k) in the odds without momentum."""
        vertices = torch.from_numpy(rests.hull.vertices).requires_grad_()
        resting = torch.from_numpy(rests.odds).requires_grad_()
        given = rests.given_center
        thrown = self._formula(rests, vertices, resting, None if given is None else given.detach())
        rows, by_odds = torch.autograd.grad(
            thrown,
            (vertices, resting),
            torch.eye(len(thrown), dtype=torch.float64),
            is_grads_batched=True,
            allow_unused=True,
            materialize_grads=True,
        )
        return rows.reshape(len(thrown), -1).numpy(), by_odds.numpy()

    def _formula(
        self, rests: RestEvaluation, vertices: Tensor, resting: Tensor, given: Tensor | None
    ) -> Tensor:
        assert self.model is not None
        center, inertia = hull_inertia(vertices, rests.hull)
        if given is not None:
            center = given
        elif rests.offset is not None:
            center = center + torch.as_tensor(rests.offset)
        transitions = Transitions.of(rests.hull, rests.paths)
        features = body_features(transitions, vertices, center, inertia, resting, torch)
        odds: Tensor = landing_odds(features, transitions, self.model[1], torch)
        return odds


USUAL_SWING: Final = 0.021
"""Root of the summed squares of the odds' changes on another table, of an ordinary die: the mean
over the tables."""


@dataclass(frozen=True)
class TableSensitivity:
    """What the odds of a die shall be on other tables, and what is known of them.

    Attributes
    ----------
    thrown: the model of the table itself.
    tables: the others, n of them.
    wanted: (k,) odds of the outcomes, on all tables.
    bias: (n, k) logarithm of the odds on the others over those of the model; None for 0.
    """

    thrown: ThrownOdds
    tables: tuple[Table, ...]
    wanted: Floats
    bias: Floats | None = None

    @property
    def is_known(self) -> bool:
        """Whether the model knows of any change."""
        return self.thrown.model is not None and len(self.tables) > 0

    @cached_property
    def others(self) -> list[ThrownOdds]:
        """The models of the other tables."""
        return [self.thrown.onto(table) for table in self.tables]

    def residuals(self, rests: RestEvaluation, facets: Integers) -> Tensor:
        """(n k,) how far the odds on the other tables, less their bias, are from those wanted.

        facets: (k,) of the outcomes.
        """
        of_outcomes = np.searchsorted(rests.paths.rests, facets)
        bias = np.zeros((len(self.tables), len(facets))) if self.bias is None else self.bias
        parts = []
        for thrown, of_table in zip(self.others, bias, strict=True):
            odds = thrown.tensor(rests)[of_outcomes] * torch.as_tensor(np.exp(of_table))
            parts.append(odds / odds.sum() - torch.as_tensor(self.wanted))
        return torch.cat(parts) / (USUAL_SWING * len(parts) ** 0.5)
