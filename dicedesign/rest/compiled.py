"""The compiled kernels of the rest model, called with a classified hull.

Each returns None where there are no kernels or where rounding could change the answer; the caller
then finds it in NumPy, in exact arithmetic where it has to.
"""

from __future__ import annotations

from typing import Any

from dicedesign.kernels import ops as kernels
from dicedesign.rest.equilibria import Equilibria
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import CLOSURE_TOLERANCE, ROUNDING

__all__ = ["basin_areas", "destinations", "separatrices", "slides"]


def separatrices(equilibria: Equilibria) -> tuple[Integers, ...] | None:
    """The arrays of `dicedesign.rest.morse.Separatrices`, in order. The signs found on the way
    become those of the equilibria.

    Raises Tie where ties are looked for and the body is tied.
    """
    if kernels.compiled is None:
        return None
    found = _settled(equilibria, kernels.compiled.separatrices(*_arguments(equilibria)))
    if found is None:
        return None
    *arrays, growth_sign, side_sign = found
    equilibria.remember(growth_sign, side_sign)
    return tuple(arrays)


def destinations(equilibria: Equilibria, facets: Integers) -> Integers | None:
    """Stable facet (k,) on which a body comes to rest that is let go on facets (k,).

    Raises Tie where ties are looked for and the body is tied.
    """
    if kernels.compiled is None:
        return None
    found = kernels.compiled.destinations(*_arguments(equilibria), facets)
    reached: Integers | None = _settled(equilibria, found)
    return reached


def slides(
    equilibria: Equilibria, vertices: Integers, directions: Floats, errors: Floats
) -> tuple[Integers, Booleans] | None:
    """As `dicedesign.rest.tracing.slide`. Raises Tie where ties are looked for and an element of
    the hull is tied."""
    if kernels.compiled is None:
        return None
    found = kernels.compiled.slides(*_arguments(equilibria), vertices, directions, errors)
    found = _settled(equilibria, found)
    if found is None:
        return None
    facets, certain = found
    return facets, certain > 0


def basin_areas(equilibria: Equilibria, arrays: tuple[Integers, ...]) -> Floats | None:
    """Areas (k,) of the basins between separatrices, whose arrays but that of the saddles come in
    the order of `dicedesign.rest.morse.Separatrices`."""
    if kernels.compiled is None:
        return None
    hull = equilibria.hull
    areas: Floats | None = kernels.compiled.basin_areas(
        *arrays, hull.vertices, equilibria.center_of_mass, hull.normals, CLOSURE_TOLERANCE
    )
    return areas


def _settled(equilibria: Equilibria, found: Any) -> Any:
    """What a kernel found; raises Tie where it says by False that the body is tied."""
    equilibria.settle(found is not False)
    return found


def _arguments(equilibria: Equilibria) -> tuple[Any, ...]:
    hull = equilibria.hull
    return (
        hull.vertices,
        hull.facet_start,
        hull.tail,
        hull.head,
        hull.twin,
        hull.facet,
        hull.next,
        hull.previous,
        *hull.outgoing,
        hull.normals,
        hull.areas,
        equilibria.center_of_mass,
        ROUNDING,
        equilibria.tie_distance,
    )
