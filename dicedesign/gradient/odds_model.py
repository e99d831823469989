"""Odds other than those of a body let go without momentum and with any side down alike: of a thrown
body, or under a prior.

Odds under a prior are those of the forward model. As a basin changes, only what its border sweeps
over counts: the density there times the speed of the border. Its points are functions of the
vertices that torch knows (`separatrix_points`), and what flows over the arcs between them are
integrals along these alone, for every density."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Borders
from dicedesign.rest.morse import separatrix_points
from dicedesign.rest.prior import DensityPrior, Prior, prior_of
from dicedesign.runtime.arrays import Floats


class OddsModel(Protocol):
    """Odds of the rests of a hull, in the order of `RestEvaluation.paths.rests`, as numbers, with
    gradients, and with the derivatives of all at once."""

    def odds(self, rests: RestEvaluation) -> Floats:
        """(k,) summing to 1."""

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """(k,) the same, with gradients."""

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the hull's vertices, with which the center of mass of a uniform
        solid moves."""


def odds_model(table: str | None, prior: Prior | str | None) -> OddsModel | None:
    """The model of the odds of a body that is thrown onto a table, or let go under a prior; None
    for neither. Raises InputError for both."""
    if table is not None and prior is not None:
        raise InputError(
            "prior: expected none with a table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    if prior is not None:
        return OddsUnderPrior.of(prior)
    return None if table is None else ThrownOdds.on(table)


@dataclass(frozen=True)
class OddsUnderPrior:
    """The odds under a prior that has a density, for hulls."""

    prior: DensityPrior

    @classmethod
    def of(cls, prior: Prior | str) -> OddsUnderPrior:
        """Those under a prior or what its text names. Raises InputError where it has no density."""
        found = prior_of(prior)
        if not isinstance(found, DensityPrior):
            raise InputError(
                f"prior: expected one with a density, which has derivatives, got "
                f"{type(found).__name__}, whose odds jump; take VonMisesFisher.fitted of the "
                "directions, or a function of your own (DensityFunction)"
            )
        return cls(found)

    def odds(self, rests: RestEvaluation) -> Floats:
        """See `OddsModel`."""
        return self.prior.odds(_basins(rests)).odds

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """See `OddsModel`; only first derivatives are known, second ones are NaN."""

        def formula(vertices: Tensor, center: Tensor) -> Tensor:
            return self._formula(rests, vertices, center)

        def gradient(slopes: Floats) -> tuple[Floats, Floats]:
            by_vertices, by_center = self._pulled_back(rests, slopes[None])
            return by_vertices[0].reshape(-1, 3), by_center[0]

        return rests.function(self.odds(rests), gradient, formula)

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """See `OddsModel`."""
        rows = self._pulled_back(rests, np.eye(len(rests.paths.rests)))
        return rests.rows_with_center(*rows)

    def _pulled_back(self, rests: RestEvaluation, weights: Floats) -> tuple[Floats, Floats]:
        """Gradients (r, 3 n) and (r, 3) of weighted sums (r, k) of the odds in the vertices and in
        the center of mass."""
        hull, paths = rests.hull, rests.paths
        shape = len(weights), 3 * len(hull.vertices)
        if len(paths.saddles) == 0:
            return np.zeros(shape), np.zeros((len(weights), 3))
        vertices = torch.from_numpy(hull.vertices).requires_grad_()
        center = torch.from_numpy(rests.equilibria.center_of_mass).requires_grad_()
        with torch.enable_grad():
            points = separatrix_points(paths, vertices, center, torch)
        slopes = self._point_slopes(rests, points)
        across = weights[:, paths.basins[:, 0]] - weights[:, paths.basins[:, 1]]
        # The other branch of a saddle has the first basin to its right.
        of_branch = np.stack([across, -across], axis=2).reshape(len(weights), -1)
        by_points = torch.from_numpy(of_branch[:, :, None, None] * slopes)
        rows, by_center = torch.autograd.grad(
            points, (vertices, center), by_points, is_grads_batched=True
        )
        return rows.reshape(shape).numpy(), by_center.numpy()

    def _point_slopes(self, rests: RestEvaluation, points: Tensor) -> Floats:
        """(2 s, depth + 2, 3) see `Borders.point_slopes`."""
        borders = Borders.of(rests.paths, points.detach().numpy())
        return borders.point_slopes(self.prior.fluxes(borders.arcs))

    def _formula(self, rests: RestEvaluation, vertices: Tensor, center: Tensor) -> Tensor:
        """(k,) odds whose derivatives are taken by torch."""
        odds, paths = torch.from_numpy(self.odds(rests)), rests.paths
        if len(paths.saddles) == 0:
            return odds + 0.0 * (vertices.sum() + center.sum())
        points = separatrix_points(paths, vertices, center, torch)
        slopes = torch.from_numpy(self._point_slopes(rests, points))
        flow: Tensor = _Flow.apply(points, slopes)
        across = flow[::2] - flow[1::2]
        basins = torch.from_numpy(paths.basins)
        gained = torch.zeros_like(odds).index_add(0, basins[:, 0], across)
        return odds + gained.index_add(0, basins[:, 1], -across)


def _basins(rests: RestEvaluation) -> Basins:
    """The basins of a body."""
    if rests.basins is not None:
        return rests.basins
    return Basins(rests.equilibria, rests.paths, 4.0 * np.pi * rests.odds)


class _Flow(torch.autograd.Function):
    """What flows over branches (b,), none, from their points (b, d, 3), with derivatives
    `slopes`."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, slopes: Tensor) -> Tensor:
        ctx.save_for_backward(points, slopes)
        return points.new_zeros(len(points))

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        points, slopes = ctx.saved_tensors
        return gradient[:, None, None] * (slopes + _Unknown.apply(points)), None


class _Unknown(torch.autograd.Function):
    """Zeros that are functions of points, with derivatives that nobody knows."""

    @staticmethod
    def forward(ctx: Any, points: Tensor) -> Tensor:
        return torch.zeros_like(points)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        # No error: forward mode comes by here too, and leaves it.
        return torch.full_like(gradient, torch.nan)
