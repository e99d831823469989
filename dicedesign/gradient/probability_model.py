"""Models of the probabilities with which a body comes to rest: let go without momentum, thrown onto
a table, or let go under a prior.

Probabilities of thrown dice and their derivatives come from compiled kernels, or without these from
the formulas of `dicedesign.throws` in NumPy and torch.

Probabilities under a prior are those of the forward model. As a basin changes, only what its border
sweeps over counts: the density there times the speed of the border. Torch differentiates the points
of the border in the vertices (`separatrix_points`); integrals along the arcs between these points
give the rest for every density.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.gradient.rest_probabilities import RestEvaluation, hull_inertia
from dicedesign.kernels import ops as kernels
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Borders
from dicedesign.rest.morse import separatrix_points
from dicedesign.rest.prior import DensityPrior, Prior, prior_of
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum_model import MomentumMixture, momentum_model
from dicedesign.throws.momentum_probabilities import landing_probabilities, mixture_probabilities
from dicedesign.throws.transition_features import Transitions, body_features


class ProbabilityModel(Protocol):
    """Probabilities of the rests of a hull, in the order of `RestEvaluation.facets`."""

    def probabilities(self, rests: RestEvaluation) -> Floats:
        """(k,) probabilities, which sum to 1."""

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """(k,) probabilities as a tensor with gradients."""

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the vertices; the center of mass of a uniform solid moves with
        these."""


@dataclass(frozen=True)
class ThrowProbabilities:
    """Probabilities of thrown hulls, by the momentum model of a table or a mixture of tables.

    Attributes
    ----------
    mixture: the momentum models, or None for a table without momentum.
    """

    mixture: MomentumMixture | None

    @classmethod
    def on(cls, table: str) -> ThrowProbabilities:
        """Model of a table by its name or file; raises as `momentum_model`."""
        return cls(momentum_model(table))

    def probabilities(self, rests: RestEvaluation) -> Floats:
        """See `ProbabilityModel`."""
        resting = rests.probability_values
        if self.mixture is None or len(resting) == 1:
            return resting
        hull, center = rests.hull, rests.equilibria.center_of_mass
        inertia = kernels.solid_inertia(hull)
        if inertia is kernels.UNDECIDED:
            inertia = hull.surface.inertia
        return mixture_probabilities(hull, rests.paths, center, inertia, resting, self.mixture)

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """See `ProbabilityModel`."""
        resting = rests.probabilities
        if self.mixture is None or len(resting) == 1:
            return resting

        def gradient(slopes: Floats) -> tuple[Floats, ...] | None:
            gradients = self._gradients(rests, slopes[None])
            if gradients is None:
                return None
            by_vertices, *others = (rows[0] for rows in gradients)
            return by_vertices.reshape(-1, 3), *others

        formula = partial(self._formula, rests)
        return rests.function(self.probabilities(rests), gradient, formula, resting)

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """See `ProbabilityModel`."""
        resting = rests.jacobian
        if self.mixture is None or len(resting) == 1:
            return resting
        gradients = self._gradients(rests, np.eye(len(resting)))
        if gradients is None:
            return rests.jacobian_of(self.tensor)
        rows, by_center, by_probabilities = gradients
        return rests.rows_with_center(rows, by_center) + by_probabilities @ resting

    def _gradients(self, rests: RestEvaluation, weights: Floats) -> tuple[Floats, ...] | None:
        """Gradients (r, 3 n), (r, 3), (r, k) of weighted sums (r, k) of the probabilities in the
        vertices, the center of mass and the probabilities without momentum; None without
        kernels."""
        assert self.mixture is not None
        center, resting = rests.equilibria.center_of_mass, rests.probability_values
        gradients = [
            kernels.thrown_gradients(rests.hull, rests.paths, model, center, resting, weights)
            for model in self.mixture.models
        ]
        if gradients[0] is kernels.UNDECIDED:
            return None
        return tuple(
            np.tensordot(self.mixture.weights, np.array(of_models), axes=1)
            for of_models in zip(*gradients, strict=True)
        )

    def _formula(
        self, rests: RestEvaluation, vertices: Tensor, center: Tensor, resting: Tensor
    ) -> Tensor:
        """(k,) probabilities by operations of torch, from those without momentum (k,)."""
        assert self.mixture is not None
        inertia = hull_inertia(vertices, rests.hull)
        transitions = Transitions.of(rests.hull, rests.paths)
        features = body_features(transitions, vertices, center, inertia, resting, torch)
        models = (model.convert(torch.as_tensor) for model in self.mixture.models)
        thrown = [landing_probabilities(features, transitions, model, torch) for model in models]
        return torch.as_tensor(self.mixture.weights) @ torch.stack(thrown)


RESTING = ThrowProbabilities(None)
"""Model of bodies that are let go without momentum, with uniform start orientations."""


def probability_model(table: str | None, prior: Prior | str | None) -> ProbabilityModel:
    """Model of a body that is thrown onto a table, let go under a prior, or neither. Raises
    InputError for both."""
    if table is not None and prior is not None:
        raise InputError(
            "prior: expected none with a table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    if prior is not None:
        return ProbabilitiesUnderPrior.of(prior)
    return RESTING if table is None else ThrowProbabilities.on(table)


@dataclass(frozen=True)
class ProbabilitiesUnderPrior:
    """Probabilities of hulls under a prior that has a density."""

    prior: DensityPrior

    @classmethod
    def of(cls, prior: Prior | str) -> ProbabilitiesUnderPrior:
        """Model of a prior, or of its text. Raises InputError if it has no density."""
        known_prior = prior_of(prior)
        if not isinstance(known_prior, DensityPrior):
            raise InputError(
                f"prior: expected one with a density, which has derivatives, got "
                f"{type(known_prior).__name__}, whose probabilities jump; take "
                "VonMisesFisher.fitted of the directions, or your own function (DensityFunction)"
            )
        return cls(known_prior)

    def probabilities(self, rests: RestEvaluation) -> Floats:
        """See `ProbabilityModel`."""
        areas = 4.0 * np.pi * rests.probability_values
        basins = rests.basins or Basins(rests.equilibria, rests.paths, areas)
        return self.prior.probabilities(basins).probabilities

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """See `ProbabilityModel`. Second derivatives are unknown and NaN."""
        if len(rests.facets) == 1:
            return rests.probabilities

        def gradient(slopes: Floats) -> tuple[Floats, Floats]:
            by_vertices, by_center = self._pull_back(rests, slopes[None])
            return by_vertices[0].reshape(-1, 3), by_center[0]

        return rests.function(self.probabilities(rests), gradient, partial(self._formula, rests))

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """See `ProbabilityModel`."""
        count = len(rests.facets)
        if count == 1:
            return rests.jacobian
        return rests.rows_with_center(*self._pull_back(rests, np.eye(count)))

    def _pull_back(self, rests: RestEvaluation, weights: Floats) -> tuple[Floats, Floats]:
        """Gradients (r, 3 n) and (r, 3) of weighted sums (r, k) of the probabilities in the
        vertices and the center of mass."""
        paths = rests.paths
        vertices = torch.from_numpy(rests.hull.vertices).requires_grad_()
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
        return rows.flatten(1).numpy(), by_center.numpy()

    def _point_slopes(self, rests: RestEvaluation, points: Tensor) -> Floats:
        """(2 s, depth + 2, 3) see `Borders.point_slopes`."""
        borders = Borders.of(rests.paths, points.detach().numpy())
        return borders.point_slopes(self.prior.fluxes(borders.arcs))

    def _formula(self, rests: RestEvaluation, vertices: Tensor, center: Tensor) -> Tensor:
        """(k,) probabilities, differentiable by torch."""
        probabilities, basins = torch.from_numpy(self.probabilities(rests)), rests.paths.basins
        points = separatrix_points(rests.paths, vertices, center, torch)
        flow: Tensor = _Flow.apply(points, torch.from_numpy(self._point_slopes(rests, points)))
        across = flow[::2] - flow[1::2]
        first, second = torch.from_numpy(basins.T.copy())
        gained = torch.zeros_like(probabilities).index_add(0, first, across)
        return probabilities + gained.index_add(0, second, -across)


class _Flow(torch.autograd.Function):
    """Zeros for branches (b,) as functions of their points (b, d, 3), with given derivatives in
    these."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, slopes: Tensor) -> Tensor:
        ctx.save_for_backward(points, slopes)
        return points.new_zeros(len(points))

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        points, slopes = ctx.saved_tensors
        # Zero, with a derivative that is NaN: the second derivatives are unknown. An error would
        # also end forward mode, which does not use them.
        unknown = (points - points.detach()).square().sqrt()
        return gradient[:, None, None] * (slopes + unknown), None
