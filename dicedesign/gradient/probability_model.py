"""Probabilities other than those of a body let go without momentum and with uniform start
orientations: of a thrown body, or under a prior.

Probabilities under a prior are those of the forward model. As a basin changes, only what its border
sweeps over counts: the density there times the speed of the border. Its points are functions of the
vertices that torch knows (`separatrix_points`), and what flows over the arcs between them are
integrals along these alone, for every density.

Probabilities of thrown dice, and how they change from table to table: values and derivatives come
    from
compiled kernels, or where there are none from the formulas of `dicedesign.throws` in NumPy and
torch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Protocol

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.geometry.triangles import solid_inertia
from dicedesign.gradient.body_function import adjoint_function
from dicedesign.gradient.rest_probabilities import RestEvaluation, hull_inertia
from dicedesign.kernels import ops as kernels
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Borders
from dicedesign.rest.morse import separatrix_points
from dicedesign.rest.prior import DensityPrior, Prior, prior_of
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumModel, momentum_model
from dicedesign.throws.momentum_probabilities import hull_probabilities, landing_probabilities
from dicedesign.throws.tables import Table
from dicedesign.throws.transition_features import Transitions, body_features


@dataclass(frozen=True)
class ThrowProbabilities:
    """The momentum model of a table, for hulls.

    Attributes
    ----------
    model: the model in NumPy and in torch, or None for a table without momentum.
    """

    model: tuple[MomentumModel, MomentumModel] | None

    @classmethod
    def on(cls, table: str) -> ThrowProbabilities:
        """Model of a table by its name or file; raises as `momentum_model`."""
        return cls._of(momentum_model(table))

    @classmethod
    def _of(cls, model: MomentumModel | None) -> ThrowProbabilities:
        return cls(None if model is None else (model, model.convert(torch.as_tensor)))

    def onto(self, table: Table) -> ThrowProbabilities:
        """Model of another table, or of the nearest one in range."""
        return self._of(None if self.model is None else self.model[0].near(table))

    def probabilities(self, rests: RestEvaluation) -> Floats:
        """(k,) probabilities of the rests, in the order of `rests.paths.rests`."""
        if self.model is None or len(rests.probability_values) == 1:
            return rests.probability_values
        hull, center = rests.hull, rests.equilibria.center_of_mass
        inertia = kernels.solid_inertia(hull)
        if inertia is kernels.UNDECIDED:
            inertia = solid_inertia(hull.vertices, hull.triangles)
        return hull_probabilities(
            hull, rests.paths, center, inertia, rests.probability_values, self.model[0]
        )

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """The same, with gradients."""
        given, resting = rests.given_center, rests.probabilities
        if self.model is None or len(resting) == 1:
            return resting + 0.0

        def adjoint(slopes: Floats) -> tuple[Floats, ...] | None:
            gradients = self._gradients(rests, slopes[None])
            if gradients is kernels.UNDECIDED:
                return None
            by_vertices, by_center, by_probabilities = (rows[0] for rows in gradients)
            by_vertices = rests.with_center(by_vertices.reshape(-1, 3), by_center)
            return (
                (by_vertices, by_probabilities)
                if given is None
                else (by_vertices, by_probabilities, by_center)
            )

        def formula(vertices: Tensor, resting: Tensor, given: Tensor | None = None) -> Tensor:
            return self._formula(rests, vertices, resting, given)

        inputs = (rests.vertices, resting) if given is None else (rests.vertices, resting, given)
        return adjoint_function(self.probabilities(rests), adjoint, formula, *inputs)

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the hull's vertices, with which the center of mass of a uniform
        solid moves."""
        resting = rests.jacobian
        if self.model is None or len(resting) == 1:
            return resting
        gradients = self._gradients(rests, np.eye(len(resting)))
        if gradients is kernels.UNDECIDED:
            return rests.jacobian_of(self.tensor)
        rows, by_center, by_probabilities = gradients
        return rests.rows_with_center(rows, by_center) + by_probabilities @ resting

    def _gradients(
        self, rests: RestEvaluation, weights: Floats
    ) -> tuple[Floats, Floats, Floats] | None:
        """Gradients (r, 3 n), (r, 3), (r, k) of weighted sums (r, k) of the probabilities in the
        vertices, in the center of mass and in the probabilities without momentum; None without
        kernels."""
        assert self.model is not None
        body = rests.hull, rests.paths, self.model[0], rests.equilibria.center_of_mass
        return kernels.thrown_gradients(*body, rests.probability_values, weights)

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
        probabilities: Tensor = landing_probabilities(features, transitions, self.model[1], torch)
        return probabilities


USUAL_SWING: Final = 0.021
"""Root of the summed squares of the probabilities' changes on another table, of an ordinary die:
the mean over the tables."""


@dataclass(frozen=True)
class TableSensitivity:
    """Wanted probabilities of a die on other tables, and corrections of the model there.

    Attributes
    ----------
    thrown: the model of the table itself.
    tables: the others, n of them.
    wanted: (k,) probabilities of the outcomes, on all tables.
    bias: (n, k) logarithm of the probabilities on the others over those of the model; None for 0.
    """

    thrown: ThrowProbabilities
    tables: tuple[Table, ...]
    wanted: Floats
    bias: Floats | None = None

    @property
    def is_known(self) -> bool:
        """Whether the model knows of any change."""
        return self.thrown.model is not None and len(self.tables) > 0

    @cached_property
    def others(self) -> list[ThrowProbabilities]:
        """The models of the other tables."""
        return [self.thrown.onto(table) for table in self.tables]

    def residuals(self, rests: RestEvaluation, facets: Integers) -> Tensor:
        """(n k,) how far the probabilities on the other tables, less their bias, are from those
        wanted.

        facets: (k,) of the outcomes.
        """
        of_outcomes = np.searchsorted(rests.paths.rests, facets)
        bias = np.zeros((len(self.tables), len(facets))) if self.bias is None else self.bias
        parts = []
        for thrown, of_table in zip(self.others, bias, strict=True):
            probabilities = thrown.tensor(rests)[of_outcomes] * torch.as_tensor(np.exp(of_table))
            parts.append(probabilities / probabilities.sum() - torch.as_tensor(self.wanted))
        return torch.cat(parts) / (USUAL_SWING * len(parts) ** 0.5)


class ProbabilityModel(Protocol):
    """Probabilities of the rests of a hull, in the order of `RestEvaluation.paths.rests`, as
    numbers, with gradients, and with the derivatives of all at once."""

    def probabilities(self, rests: RestEvaluation) -> Floats:
        """(k,) summing to 1."""

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """(k,) the same, with gradients."""

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the hull's vertices, with which the center of mass of a uniform
        solid moves."""


def probability_model(table: str | None, prior: Prior | str | None) -> ProbabilityModel | None:
    """The model of the probabilities of a body that is thrown onto a table, or let go under a
    prior; None for neither. Raises InputError for both."""
    if table is not None and prior is not None:
        raise InputError(
            "prior: expected none with a table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    if prior is not None:
        return ProbabilitiesUnderPrior.of(prior)
    return None if table is None else ThrowProbabilities.on(table)


@dataclass(frozen=True)
class ProbabilitiesUnderPrior:
    """The probabilities under a prior that has a density, for hulls."""

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
        return self.prior.probabilities(
            rests.basins or Basins(rests.equilibria, rests.paths, areas)
        ).probabilities

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """See `ProbabilityModel`; only first derivatives are known, second ones are NaN."""

        def formula(vertices: Tensor, center: Tensor) -> Tensor:
            return self._formula(rests, vertices, center)

        def gradient(slopes: Floats) -> tuple[Floats, Floats]:
            by_vertices, by_center = self._pull_back(rests, slopes[None])
            return by_vertices[0].reshape(-1, 3), by_center[0]

        return rests.function(self.probabilities(rests), gradient, formula)

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """See `ProbabilityModel`."""
        rows = self._pull_back(rests, np.eye(len(rests.paths.rests)))
        return rests.rows_with_center(*rows)

    def _pull_back(self, rests: RestEvaluation, weights: Floats) -> tuple[Floats, Floats]:
        """Gradients (r, 3 n) and (r, 3) of weighted sums (r, k) of the probabilities in the
        vertices and in the center of mass."""
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
        """(k,) probabilities whose derivatives are taken by torch."""
        probabilities, paths = torch.from_numpy(self.probabilities(rests)), rests.paths
        if len(paths.saddles) == 0:
            return probabilities + 0.0 * (vertices.sum() + center.sum())
        points = separatrix_points(paths, vertices, center, torch)
        slopes = torch.from_numpy(self._point_slopes(rests, points))
        flow: Tensor = _Flow.apply(points, slopes)
        across = flow[::2] - flow[1::2]
        basins = torch.from_numpy(paths.basins)
        gained = torch.zeros_like(probabilities).index_add(0, basins[:, 0], across)
        return probabilities + gained.index_add(0, basins[:, 1], -across)


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
