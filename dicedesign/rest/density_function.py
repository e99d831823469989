"""A density of directions that is given as a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Arcs, Borders
from dicedesign.rest.morse import basin_references, signed_areas, wraps
from dicedesign.rest.prior import DensityPrior, PriorOdds
from dicedesign.rest.quadrature import integrals, triangle_integrals
from dicedesign.runtime.arrays import Floats, Integers

TOLERANCE: Final = 1e-13
"""Of all integrals together, over that of the sphere; rough densities end with a larger error,
which is told."""


@dataclass(frozen=True, eq=False)
class DensityFunction(DensityPrior):
    """Any density of directions, by adaptive cubature over the basins. A peak far narrower than a
    degree may be missed, as by all that looks at some directions only.

    Attributes
    ----------
    function: from unit directions (n, 3), down in the body's frame, to densities (n,), at least 0,
        finite and not 0 everywhere, in any unit: they are divided by their integral.
    """

    function: Callable[[Floats], Floats]

    def _values(self, directions: Floats) -> Floats:
        """(n,) values of the function. Raises InputError where they are no densities."""
        values = np.asarray(self.function(directions), dtype=np.float64)
        if values.shape != (len(directions),):
            raise InputError(
                f"prior: expected a density for each of {len(directions)} directions, got an array "
                f"of shape {values.shape}; let the function take (n, 3) and return (n,)"
            )
        wrong = np.flatnonzero(~((values >= 0.0) & (values < np.inf)))
        if len(wrong):
            where = ", ".join(f"{x:.4g}" for x in directions[wrong[0]])
            raise InputError(
                f"prior: expected finite densities from 0 on, got {values[wrong[0]]:g} at "
                f"({where}); correct the function"
            )
        return values

    @cached_property
    def _whole(self) -> tuple[float, float]:
        """Integral over the sphere, and its error."""
        octants = []
        for signs in product((1.0, -1.0), repeat=3):
            corners = np.diag(signs)
            octants.append(corners if np.prod(signs) > 0.0 else corners[::-1])
        values, errors = triangle_integrals(self._values, np.stack(octants), TOLERANCE)
        whole = float(values.sum())
        if not 0.0 < whole < np.inf:
            raise InputError(
                f"prior: expected a density with a finite integral above 0, got {whole:g}; correct "
                "the function"
            )
        return whole, float(errors.sum())

    def density(self, directions: Floats) -> Floats:
        """(n,) density per steradian in unit directions (n, 3)."""
        return self._values(directions) / self._whole[0]

    def odds(self, basins: Basins) -> PriorOdds:
        """Odds of the rests: sums over triangles with a side on the border, as areas are, with the
        density in them."""
        (whole, whole_error), paths = self._whole, basins.paths
        if len(paths.rests) == 1:
            return PriorOdds(np.ones(1), np.zeros(1))
        borders = Borders.of_basins(basins)
        normals = basins.equilibria.hull.normals[paths.rests]
        references = basin_references(paths, basins.points, normals)
        masses, errors = np.zeros(len(normals)), np.zeros(len(normals))
        arcs = borders.arcs
        end = arcs.at(np.arange(len(arcs.length)), arcs.length[:, None])[:, 0]
        branch = np.nonzero(borders.moving)[0]
        for column in (0, 1):
            basin = paths.basins[branch // 2, column]
            sign = np.where(branch % 2 == column, 1.0, -1.0)
            triangles = np.stack([references[basin], arcs.start, end], axis=1)
            found, error = triangle_integrals(self._values, triangles, TOLERANCE * whole)
            np.add.at(masses, basin, sign * found)
            np.add.at(errors, basin, error)
        masses += whole * wraps(signed_areas(paths, basins.points, references))
        masses = np.maximum(masses, 0.0)
        total = float(masses.sum())
        if total == 0.0:
            raise InputError(
                "prior: expected a density that is above 0 on more than a speck of the sphere, got "
                "one that is found on none of the basins; take VonMisesFisher or SphericalCap"
            )
        odds = masses / total
        # What one of the two sums has missed.
        apart = abs(total - whole) / max(total, whole)
        errors = (errors + odds * whole_error) / max(total, whole) + apart
        return PriorOdds(odds, np.minimum(errors, 1.0))

    def fluxes(self, arcs: Arcs) -> Floats:
        """See `DensityPrior`."""

        def along(rows: Integers, distance: Floats) -> Floats:
            directions = arcs.at(rows, distance).reshape(-1, 3)
            density = self.density(directions).reshape(distance.shape)
            return density[..., None] * arcs.speeds(rows, distance)

        edges = np.stack([np.zeros(len(arcs.length)), arcs.length], axis=1)
        return integrals(along, edges, TOLERANCE)[0]
