"""The verdict on a die: the file that was written, read back and analysed by the forward model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.formats import parsed_stl
from dicedesign.optimize.targets import Target
from dicedesign.rest.asymmetry import border_margins
from dicedesign.rest.outcomes import OutcomeOdds, outcome_margins, outcome_odds
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.results.record import FacetOfDie
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_ODDS, LEAST_MARGIN, SAME_REST_ANGLE

__all__ = ["Verdict", "judged"]


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a die does, by its file.

    Attributes
    ----------
    body: the solid in mm as it was read back.
    poses: its rests.
    outcomes: what they count for.
    target: what is wanted.
    """

    body: Body
    poses: RestPoses
    outcomes: OutcomeOdds
    target: Target

    @property
    def max_abs_error(self) -> float:
        """Largest |p - q|."""
        return self.outcomes.max_abs_error(self.target.probabilities)

    @cached_property
    def margins(self) -> Floats:
        """(k,) least angle in radians by which the die must be tipped to leave each outcome."""
        return outcome_margins(self.poses, self.outcomes)

    def flaws(self, tolerance: float | None) -> Iterator[Status]:
        """What is wrong with the die, the worst first.

        tolerance: largest |p - q| and odds elsewhere; None for a die whose odds without momentum
            are not meant to be the target.
        """
        if tolerance is not None:
            most = max(tolerance, FILE_ODDS)
            if self.max_abs_error > most:
                yield Status.OFF_TARGET
            if self.outcomes.elsewhere > most:
                yield Status.STRAY
        if self.outcomes.least_angle < SAME_REST_ANGLE:
            yield Status.CROWDED
        if self.margins.min() < LEAST_MARGIN:
            yield Status.UNSTEADY

    @cached_property
    def facets(self) -> tuple[FacetOfDie, ...]:
        """Each facet that the die can rest on, the most probable first; an outcome's own bears its
        label."""
        labels = self.target.labels
        poses, of_rest = self.poses, self.outcomes.outcome_of_rest.tolist()
        own = {int(rest): labels[k] for k, rest in enumerate(self.outcomes.main) if rest >= 0}
        margins, borders = np.degrees(poses.margins), np.degrees(border_margins(poses))
        return tuple(
            FacetOfDie(
                label=own.get(rest),
                outcome=None if outcome < 0 else labels[outcome],
                normal=tuple(poses.normals[rest].tolist()),
                probability=float(poses.probabilities[rest]),
                polygon_area_mm2=float(poses.areas[rest]),
                inradius_mm=facet_inradius(poses.hull, int(poses.facets[rest])),
                margin_deg=float(margins[rest]),
                border_deg=float(borders[rest]),
            )
            for rest, outcome in enumerate(of_rest)
        )

    def odds(self, prefix: str = "") -> dict[str, Any]:
        """Probabilities, odds elsewhere and error as keys of result.json."""
        return {
            f"{prefix}probabilities": tuple(self.outcomes.odds.tolist()),
            f"{prefix}elsewhere": self.outcomes.elsewhere,
            f"{prefix}max_abs_error": self.max_abs_error,
        }


def judged(
    data: bytes,
    directions: Floats,
    target: Target,
    center_of_mass: Floats | None = None,
    prior: Prior | None = None,
) -> Verdict:
    """The verdict on a file.

    Parameters
    ----------
    data: content of the STL file.
    directions: (k, 3) unit, down in the outcomes, in the order of the target.
    target: what is wanted.
    center_of_mass: (3,) in the file's coordinates, or None for that of the uniform solid.
    prior: that its odds are under, in the file's coordinates, or None where any side is down alike
        at first.

    Raises
    ------
    DegenerateBodyError, OutsideHullError: as `rest_poses`.
    """
    points, triangles = parsed_stl(data, Path("die.stl"))
    # The coordinates are those of the file, float32.
    body = make_body(points, triangles, "die.stl", single_precision=True)
    poses = rest_poses(body, center_of_mass).under(prior)
    return Verdict(body, poses, outcome_odds(poses, directions), target)
