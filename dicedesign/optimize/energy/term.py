"""Terms of the energy that a descent lowers, and the weights that a recipe gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Number, Numbers, Registry

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests
    from dicedesign.runtime.arrays import Floats


LARGEST_SQUARED_DISTANCE: Final = 4.0
"""Between two unit vectors: what a cluster without a rest is charged."""

SMALLEST_MEAN: Final = 1e-3
"""Length of the sum of a region's maxima below which it is no longer stretched to length 1: maxima
that cancel have no mean direction, and near there the gradient would grow without bound."""


@dataclass(frozen=True, kw_only=True)
class TermOption(Number):
    """A number besides its weight that a term takes from a recipe."""


@dataclass(frozen=True, kw_only=True)
class Term(Extension):
    """One term of the energy.

    Attributes
    ----------
    evaluate: the term without its weight, a scalar tensor that autograd can differentiate in the
        vertices, of the current shape and of all weights and options, such as
        `weights.neighbor_radius`.
    weight: default of its weight in a recipe; None for a term that is always there with weight 1.
    options: what else a recipe may say of it, with names of their own among those of all terms.
    single_rests: whether a step is refused that gives an outcome a second rest.
    kernel: its place among the terms that the compiled kernels evaluate together, or None; those
        without are evaluated in torch and added.
    value_and_slopes: for a term of the facets' depths (`RestEvaluation.depths`) or the rests' unit
        normals alone: its value, and its derivative (m,) in each depth or (r, 3) in each normal, as
        numbers, to which kernels take the rest of the chain.
    slopes_in: which of the two.
    """

    evaluate: Callable[[ClusteredRests, EnergyWeights], Tensor]
    weight: float | None = 0.0
    options: tuple[TermOption, ...] = ()
    single_rests: bool = False
    kernel: int | None = None
    value_and_slopes: Callable[[ClusteredRests, EnergyWeights], tuple[float, Floats]] | None = None
    slopes_in: Literal["depths", "normals"] = "depths"


TERMS: Final = Registry(
    "energy term",
    Term,
    builtin=(
        "dicedesign.optimize.energy.built_in:DICE",
        "dicedesign.optimize.energy.built_in:COPLANAR",
        "dicedesign.optimize.energy.built_in:BARYCENTER",
        "dicedesign.optimize.energy.built_in:NEIGHBOR",
        "dicedesign.optimize.energy.built_in:STABILITY",
        "dicedesign.optimize.energy.built_in:APART",
    ),
    group="dicedesign.terms",
)


class EnergyWeights(Numbers):
    """Weights of the terms of eq. 16 and of those beside it, and the terms' other options; see
    `TERMS`. A term of weight 0 is not evaluated.

    Raises InputError for a number out of range.
    """

    __slots__ = ("_active",)

    prefix = "weights."

    @classmethod
    def declared(cls) -> Mapping[str, Number]:
        """Weight and options of each term but those that are always there."""
        declared: dict[str, Number] = {}
        for term in TERMS:
            numbers: list[Number] = list(term.options)
            if term.weight is not None:
                weight = Number(
                    name=term.name,
                    default=term.weight,
                    line=term.line,
                    expected="a number not below 0",
                    remedy="0 leaves the term out",
                    allows=lambda value: 0.0 <= value < np.inf,
                )
                numbers.insert(0, weight)
            for number in numbers:
                if number.name in declared:
                    raise InputError(
                        f"energy term {term.name!r}: expected names of its own for its weight and "
                        f"its options, got {number.name!r}, which is taken; choose another"
                    )
                declared[number.name] = number
        return declared

    @property
    def active(self) -> tuple[tuple[Term, float], ...]:
        """Terms that have a weight, with it, in their order."""
        terms = tuple(TERMS)
        known = getattr(self, "_active", None)
        if known is None or known[0] != terms:
            pairs = (
                (term, 1.0 if term.weight is None else getattr(self, term.name)) for term in terms
            )
            known = terms, tuple((term, weight) for term, weight in pairs if weight > 0.0)
            self._active: tuple[tuple[Term, ...], tuple[tuple[Term, float], ...]] = known
        return known[1]

    @property
    def of_terms(self) -> dict[str, float]:
        """The weights of these by name."""
        return {term.name: weight for term, weight in self.active}

    @property
    def single_rests(self) -> bool:
        """True where a term with a weight wants one rest for each outcome and no other."""
        return any(term.single_rests for term, _ in self.active)

    def times(self, factor: float) -> EnergyWeights:
        """The same with the weights of all terms but those that are always there times a factor."""
        weights = {
            name: factor * weight
            for name, weight in self.of_terms.items()
            if TERMS[name].weight is not None
        }
        return self.changed(**weights)
