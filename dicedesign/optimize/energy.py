"""Energy of a shape, the weighted sum of terms (eq. 16), with its gradient, and both as functions
of the parameters of a design."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DiceError, InputError
from dicedesign.gradient.body_function import uncompiled
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.kernels import ops as kernels
from dicedesign.optimize.clusters import ClusteredRests, Clusters
from dicedesign.optimize.coordinates import Coordinates, Shape, ShapeEvaluator
from dicedesign.optimize.terms import LARGEST_SQUARED_DISTANCE, SMALLEST_MEAN, EnergyWeights, Term
from dicedesign.runtime.arrays import Floats, Integers


@uncompiled
def energy_terms(state: ClusteredRests, weights: EnergyWeights) -> dict[str, Tensor]:
    """Weighted terms by name, by operations of torch, without the terms of weight 0.

    Raises InputError if a term is not a scalar tensor.
    """
    return {term.name: _tensor(term, weight, state, weights) for term, weight in weights.active}


def _tensor(term: Term, weight: float, state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    value = term.evaluate(state, weights)
    if not isinstance(value, Tensor) or value.ndim > 0:
        raise InputError(
            f"energy term {term.name!r}: expected a tensor of torch with one number and no "
            f"dimension, got {type(value).__name__} of shape {tuple(np.shape(value))}; sum it up, "
            "by operations of torch"
        )
    return weight * value


COMPILED = ("dice", "coplanar", "barycenter", "neighbor")
"""Terms that the kernels evaluate together, in the order of the kernels."""


@dataclass(frozen=True)
class Energy:
    """Energy of a shape as numbers, by compiled kernels for the terms that have any, else by torch.

    Attributes
    ----------
    state: the shape; weights: weights of the terms.
    """

    state: ClusteredRests
    weights: EnergyWeights

    @cached_property
    def terms(self) -> dict[str, float]:
        """Weighted terms by name, as in `energy_terms`."""
        return {name: value for name, (value, _) in self._parts.items()}

    @property
    def gradient(self) -> Floats:
        """(n, 3) gradient of the sum of terms in the vertices; the center of mass of a uniform
        solid moves with these."""
        rests, gradients = self.state.rests, []
        parts = [part for _, part in self._parts.values()]
        if self._compiled is not None:
            by_vertices, by_center = self._compiled.gradient(self._compiled_weights)
            for slopes in parts:
                if not isinstance(slopes, np.ndarray):
                    continue
                if slopes.ndim == 1:
                    walls = kernels.depth_gradient(
                        rests.hull, rests.equilibria.center_of_mass, slopes
                    )
                    assert walls is not None, "kernels that have the energies have these"
                    by_vertices, by_center = by_vertices + walls[0], by_center + walls[1]
                else:
                    turning = kernels.normal_gradient(rests.hull, rests.paths.rests, slopes)
                    assert turning is not None, "kernels that have the energies have these"
                    by_vertices = by_vertices + turning
            gradients.append(rests.with_center(by_vertices, by_center))
        varying = [part for part in parts if isinstance(part, Tensor) and part.requires_grad]
        if varying:
            (gradient,) = torch.autograd.grad(varying, rests.vertices, retain_graph=True)
            gradients.append(gradient.numpy())
        if not gradients:
            return np.zeros_like(rests.hull.vertices)
        return sum(gradients[1:], gradients[0])

    @cached_property
    def _parts(self) -> dict[str, tuple[float, Tensor | Floats | None]]:
        """Value of each weighted term by name, and the source of its gradient: a tensor,
        derivatives in depths or normals (`Term.value_and_slopes`), or None for the kernels."""
        together = None if self._compiled is None else self._compiled.values()
        parts: dict[str, tuple[float, Tensor | Floats | None]] = {}
        for term, weight in self._active:
            if together is not None and term.name in COMPILED:
                value = together[COMPILED.index(term.name)]
                if term.name == "dice" and self.state.outcome_of is not None:
                    value = float(self.state.misses @ self.state.misses)
                parts[term.name] = weight * value, None
            elif together is not None and term.value_and_slopes is not None:
                value, slopes = term.value_and_slopes(self.state, self.weights)
                parts[term.name] = weight * value, weight * slopes
            else:
                tensor = _tensor(term, weight, self.state, self.weights)
                parts[term.name] = tensor.item(), tensor
        return parts

    @cached_property
    def _active(self) -> tuple[tuple[Term, float], ...]:
        return self.weights.active

    @cached_property
    def _compiled_weights(self) -> list[float]:
        weights = {term.name: weight for term, weight in self._active}
        return [weights.get(name, 0.0) for name in COMPILED]

    @cached_property
    def _compiled(self) -> kernels.Energies | None:
        """Terms that the kernels evaluate together, with their gradient; None without kernels."""
        rests, clusters = self.state.rests, self.state.clusters
        return kernels.energies(
            rests.hull,
            rests.paths,
            rests.equilibria.center_of_mass,
            probabilities=rests.probability_values,
            of_rest=clusters.of_rest,
            directions=clusters.directions,
            target=self.state.face_target,
            neighbor_radius=self.weights.neighbor_radius,
            smallest_mean=SMALLEST_MEAN,
            no_rest=LARGEST_SQUARED_DISTANCE,
            wanted=[weight > 0.0 for weight in self._compiled_weights],
        )


SHAKE = 1e-6
"""Least standard deviation of the noise on a start that balances exactly, as its basins are
undefined."""


@dataclass(frozen=True)
class Objective:
    """Energy (eq. 16) as a function of coordinates.

    Attributes
    ----------
    coordinates: how parameters make a shape.
    target: (k,) target probabilities.
    weights: weights of the terms.
    evaluator: evaluates shapes and counts evaluations.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    coordinates: Coordinates
    target: Floats
    weights: EnergyWeights
    evaluator: ShapeEvaluator
    outcome_of: Integers | None = None

    def evaluate(self, parameters: Floats, directions: Floats) -> Evaluation:
        """Hull, rests and energy at flat parameters, for directions (f, 3) of the faces.

        Raises DiceError if the parameters make no solid with the center of mass inside.
        """
        shape, rests = self.evaluator.evaluate(self.coordinates, parameters)
        return Evaluation(self, parameters, shape, rests, directions)

    def attempt(self, parameters: Floats, directions: Floats) -> Evaluation | None:
        """Evaluation, or None if it or its probabilities fail."""
        try:
            evaluation = self.evaluate(parameters, directions)
            return evaluation if np.isfinite(evaluation.error) else None
        except (DiceError, np.linalg.LinAlgError):
            return None

    def first(
        self, parameters: Floats, directions: Floats, perturbation: float, seed: int
    ) -> Evaluation:
        """First evaluation of a descent, at parameters (n,) with normal noise.

        perturbation: standard deviation of the noise. It is halved if the noise leaves no solid
        with the center of mass inside, and at least `SHAKE` if probabilities are undefined without
        noise. Raises as `evaluate`.
        """
        noise = np.random.default_rng(seed).normal(size=parameters.shape)
        sizes = [perturbation]
        while sizes[-1] > 4.0 * SHAKE:
            sizes.append(sizes[-1] / 2.0)
        for size in sizes:
            shaken = self.attempt(parameters + size * noise, directions)
            if shaken is not None and np.isfinite(shaken.value):
                return shaken.refresh()
        least = max(sizes[-1] / 2.0, SHAKE)
        return self.evaluate(parameters + least * noise, directions).refresh()


@dataclass(frozen=True)
class Evaluation:
    """One evaluation of an objective. Everything is computed on first use."""

    objective: Objective
    parameters: Floats
    shape: Shape
    rests: RestEvaluation
    directions: Floats

    @cached_property
    def state(self) -> ClusteredRests:
        """Rests, outcomes and target."""
        objective = self.objective
        return ClusteredRests.of(
            self.rests, self.directions, objective.target, objective.outcome_of
        )

    @property
    def clusters(self) -> Clusters:
        """Face for which each rest counts."""
        return self.state.clusters

    @cached_property
    def energy(self) -> Energy:
        """Terms of the energy, and its gradient in the vertices."""
        return Energy(self.state, self.objective.weights)

    @cached_property
    def value(self) -> float:
        """The energy."""
        return sum(self.energy.terms.values())

    @cached_property
    def gradient(self) -> Floats:
        """Gradient of the energy with respect to the flat parameters."""
        rows = self.energy.gradient.reshape(1, -1)
        return self.shape.in_parameters(rows, self.rests.hull.source)[0]

    @cached_property
    def error(self) -> float:
        """Largest |p - q| over the outcomes."""
        return float(np.abs(self.state.misses).max())

    @cached_property
    def flaws(self) -> int:
        """Number of faces without a rest."""
        return self.clusters.empty

    def weighted(self, weights: EnergyWeights) -> Evaluation:
        """Evaluation of the same shape with other weights."""
        return replace(self, objective=replace(self.objective, weights=weights))

    def refresh(self) -> Evaluation:
        """Evaluation with the direction of each outcome moved to the mean normal of its rests."""
        normals = self.rests.hull.normals[self.rests.facets]
        return replace(self, directions=self.clusters.means(normals)[0])
