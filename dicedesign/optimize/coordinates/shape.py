"""Parameters of a design: vertices, as in the paper, or facets, which stay flat by construction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from dicedesign.geometry.hulls.hull import HullMaker, convex_hull
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["Coordinates", "Shape"]


@dataclass(frozen=True)
class Shape:
    """Points whose hull is a shape, as a function of p parameters.

    Attributes
    ----------
    points: (n, 3).
    pulled_back: from gradients (r, n, 3) in the points to those (r, p) in the parameters.
    """

    points: Floats
    pulled_back: Callable[[Floats], Floats]

    def in_parameters(self, rows: Floats, source: Integers) -> Floats:
        """Gradients (r, p) in the parameters for those (r, 3 v) in some of the points, (v,) by
        number."""
        gradients = np.zeros((len(rows), *self.points.shape))
        gradients[:, source] = rows.reshape(len(rows), len(source), 3)
        return self.pulled_back(gradients)


class Coordinates(Protocol):
    """Parameters of a convex shape, as a flat array."""

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """The shape; `hull_of` makes the hulls that are needed on the way."""

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """The points of the shape as a function of a tensor, for autograd and `torch.func`, of
        parameters (p,) as float32 or float64."""

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """The parameters without what the shape no longer uses."""
