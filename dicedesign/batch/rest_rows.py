"""Values in tables of rests: of each facet that a body rests on, and of the body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.robots.links import NamedBody
from dicedesign.geometry.sphere import quaternions
from dicedesign.geometry.triangles import principal_axes
from dicedesign.rest.poses import RestPoses, mass_properties

Center = tuple[float, float, float] | Literal["hull"] | None
"""Center of mass, as in `rest_poses`."""


class GivenMass(NamedTuple):
    """Center of mass, in the unit of a file, and density in g/cm^3 of its bodies, if known."""

    center_of_mass: tuple[float, float, float] | None
    density: float | None


@dataclass(frozen=True)
class RestOptions:
    """Options of an analysis.

    Attributes
    ----------
    center_of_mass, coplanar_tolerance: see `rest_poses`.
    density: of bodies without a mass, in g/cm^3.
    all_facets: whether unstable facets have rows too.
    masses: what is known of single files, which counts first.
    """

    center_of_mass: Center = None
    coplanar_tolerance: float | None = None
    density: float | None = None
    all_facets: bool = False
    masses: Mapping[str, GivenMass] = field(default_factory=dict)

    def of_file(self, file: str) -> tuple[Center, float | None]:
        """Center of mass and density of a file."""
        center, density = self.masses.get(file, (None, None))
        return center or self.center_of_mass, density or self.density


def facet_columns(poses: RestPoses, all_facets: bool) -> dict[str, Any]:
    """Columns about the facets that a body rests on, the most probable first, and then perhaps
    about all other facets of the hull.

    rest: number from 1, or None for an unstable facet; facet: number in the hull, from 0.
    rolls_to: number of the rest that the body rolls to.
    margin_deg: see `RestPoses.margins`, or None.
    depth: of the foot of the center of mass in the facet, negative outside; height: of the center.
    transform: (4, 4) motion that stands the body on the facet.
    """
    hull, facets, count = poses.hull, poses.facets, len(poses.facets)
    rolls_to = np.arange(1, count + 1)
    if all_facets:
        others = np.setdiff1d(np.arange(len(hull.normals)), facets)
        # Of facets that are shown as one, the first counts.
        first = np.unique(poses.morse.facet, return_index=True)[1][others]
        rolls_to = np.append(rolls_to, poses.morse.basin_of_facet[first] + 1)
        facets = np.append(facets, others)
    unstable = len(facets) - count
    return {
        "rest": [*range(1, count + 1), *[None] * unstable],
        "facet": facets,
        "rolls_to": rolls_to,
        "probability": np.append(poses.probabilities, np.zeros(unstable)),
        "normal": hull.normals[facets],
        "area": hull.areas[facets],
        "margin_deg": [*np.degrees(poses.margins).tolist(), *[None] * unstable],
        "depth": hull.foot_depths(poses.center_of_mass)[facets],
        "height": hull.heights(poses.center_of_mass)[facets],
        "transform": poses.stand_on(facets),
    }


MASS_NAMES = (
    "volume_mm3",
    "mass_g",
    *(f"inertia_{k}_g_mm2" for k in (1, 2, 3)),
    *(f"inertia_q{part}" for part in "wxyz"),
)
"""Names of `mass_values`."""


def mass_values(
    source: NamedBody, body: Body, poses: RestPoses, density: float | None
) -> dict[str, float | None]:
    """Volume, mass, principal moments of inertia about the center of mass, ascending, and the
    quaternion that turns the axes of coordinates to the principal axes.

    Of a uniform solid, the moments are those about its own centroid. What is not known is None: the
    mass of a mesh without density. density: in g/cm^3.
    """
    values: dict[str, float | None] = dict.fromkeys(MASS_NAMES)
    try:
        properties = mass_properties(body, poses)
    except DegenerateBodyError:
        return values
    length = 1000.0 if source.unit == "m" else 1.0
    values["volume_mm3"] = properties.volume * length**3
    if source.has_mass and properties is body.mass_properties:
        mass = 1000.0 * properties.mass
    elif density is not None:
        mass = 1e-3 * density * properties.mass * length**3
    else:
        return values
    moments, axes = principal_axes(properties.inertia)
    numbers = [mass, *(mass * length**2 * moments).tolist(), *quaternions(axes).tolist()]
    return values | dict(zip(MASS_NAMES[1:], numbers, strict=True))
