"""A die as designed, as a solid in millimeters, and as assessed from its file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.targets import Target
from dicedesign.rest.outcomes import (
    OutcomeProbabilities,
    asymmetry,
    border_margins,
    outcome_margins,
    outcome_probabilities,
)
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.results.parts import Numbers, RoundOfThrows, Status
from dicedesign.results.result import FacetOfDie, HullCounts, Result, Step
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import FILE_PROBABILITIES, LEAST_MARGIN, SAME_REST_ANGLE

if TYPE_CHECKING:
    from dicedesign.concave.result import ConcaveDie
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.fabricate.label_reading import Reading
    from dicedesign.geometry.surfaces.quality import SurfaceQuality
    from dicedesign.geometry.surfaces.repair import RepairedMesh
    from dicedesign.throws.simulation import ThrownDie


@dataclass(frozen=True, eq=False)
class Design:
    """Result of every design method. Lengths are in the design's own unit.

    Attributes
    ----------
    status: why the method stopped.
    hull: the designed convex hull.
    directions: (f, 3) down on the labeled faces, in the order of the target.
    error: largest |p - q| of the method's own probabilities.
    steps: accepted ones, the first being the start.
    center_of_mass: (3,) if given, or None for the uniform solid.
    terms: of the energy at the end, by name.
    starts: number of starting shapes; evaluations: of dice; hulls: computed for them.
    rounds: of throws and new designs.
    reshaped: surfaces before and after of a concave die, else None.
    prior: of start orientations, or None for the uniform one.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    within: largest angle in radians from a face's own rest to others that count for its outcome.
    symmetry: name of its point group, or None.
    throw_bias: (f,) logarithms of thrown probabilities of the faces over those in the momentum
        model, or None if they are not known.
    """

    status: Status
    hull: ConvexHull
    directions: Floats
    error: float
    steps: tuple[Step, ...]
    center_of_mass: Floats | None = None
    terms: Mapping[str, float] | None = None
    starts: int | None = None
    evaluations: int | None = None
    hulls: HullCounts | None = None
    rounds: tuple[RoundOfThrows, ...] = ()
    reshaped: ConcaveDie | None = None
    prior: Prior | None = None
    outcome_of: Integers | None = None
    within: float = SAME_REST_ANGLE
    symmetry: str | None = None
    throw_bias: Floats | None = None

    def reorder(self, order: Integers) -> Design:
        """Design whose face i is face `order[i]` of this one, (f,). Rounds of throws that counted
        outcomes of several faces stay."""

        def permute(values: Numbers) -> Numbers:
            is_by_face = len(values) == len(order)
            return tuple(np.array(values)[order].tolist()) if is_by_face else values

        rounds = tuple(
            replace(each, requested=permute(each.requested), frequencies=permute(each.frequencies))
            for each in self.rounds
        )
        bias = None if self.throw_bias is None else self.throw_bias[order]
        return replace(self, directions=self.directions[order], rounds=rounds, throw_bias=bias)


MARKED_PROBABILITY = 0.05
"""Probability from which on a rest gets a label of its own, where outcomes have several."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """Rests and outcomes of a file that was read back.

    Attributes
    ----------
    body: the solid in mm.
    poses: its rests.
    outcomes: of the rests.
    target: wanted probabilities.
    """

    body: Body
    poses: RestPoses
    outcomes: OutcomeProbabilities
    target: Target

    @property
    def max_abs_error(self) -> float:
        """Largest |p - q|: of the outcomes, and of their faces if the target keeps their shares."""
        error = self.outcomes.max_abs_error(self.target.probabilities)
        if not (self.target.keeps_shares and self.target.has_repeated_labels):
            return error
        main = self.outcomes.main
        by_face = np.where(main >= 0, self.poses.probabilities[main], 0.0)
        return max(error, float(np.abs(by_face - self.target.face_probabilities).max()))

    @cached_property
    def margins(self) -> Floats:
        """(k,) least angle in radians by which the die must be tipped to leave each outcome."""
        return outcome_margins(self.poses, self.outcomes)

    @cached_property
    def asymmetry(self) -> float:
        """rho of eq. 20 and 21."""
        return asymmetry(self.poses)

    def flaws(self, tolerance: float | None) -> Iterator[Status]:
        """Yield the flaws of the die, the worst first.

        tolerance: largest |p - q| and probability elsewhere; None for a thrown die, whose
            probabilities without momentum differ from the target.
        """
        if tolerance is not None:
            most = max(tolerance, FILE_PROBABILITIES)
            if self.max_abs_error > most:
                yield Status.OFF_TARGET
            if self.outcomes.elsewhere > most:
                yield Status.STRAY
        if self.outcomes.least_angle < SAME_REST_ANGLE:
            yield Status.CROWDED
        if self.margins.min() < LEAST_MARGIN:
            yield Status.UNSTEADY

    def shown_faces(self, least: float) -> Integers:
        """(m,) faces whose own rests have at least a probability, and the most probable of each
        outcome; all faces if there is one for each outcome."""
        if not self.target.has_repeated_labels:
            return np.arange(len(self.outcomes.main))
        main, outcome_of = self.outcomes.main, self.target.outcome_of_face
        shares = np.where(main >= 0, self.poses.probabilities[main], 0.0)
        best = [
            np.flatnonzero(outcome_of == k)[shares[outcome_of == k].argmax()]
            for k in range(len(self.target.labels))
        ]
        return np.union1d(np.flatnonzero(shares >= least), best)

    @cached_property
    def facets(self) -> tuple[FacetOfDie, ...]:
        """Facets that the die can rest on, the most probable first, with the label of each outcome
        on its main facet."""
        labels, of_faces = self.target.labels, self.target.face_labels
        poses, of_rest = self.poses, self.outcomes.outcome_of_rest.tolist()
        own = {int(rest): of_faces[k] for k, rest in enumerate(self.outcomes.main) if rest >= 0}
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

    def as_fields(self) -> dict[str, Any]:
        """Probabilities, those elsewhere, and error, as fields of `Result` and `Engraved`."""
        return {
            "probabilities": tuple(self.outcomes.probabilities.tolist()),
            "elsewhere": self.outcomes.elsewhere,
            "max_abs_error": self.max_abs_error,
        }


@dataclass(frozen=True, eq=False)
class Solid(Surface):
    """Die in mm, plain or with labels and rounded edges, with its center of mass at the origin,
    before its coordinates are rounded for a file.

    Attributes
    ----------
    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside.
    poses: rests of the plain solid; outcomes: of the rests.
    center_of_mass: (3,) zeros if it was given, or None for the uniform solid.
    hull_points: (v, 3) corners of the designed hull.
    changes: made for printing, one sentence each.
    is_printable: whether the surface could be cleaned for printing.
    assessment: of the file of a finished die; None if the center of mass was given, as its shift by
        labels and edges is unknown.
    placements: of labels on facets.
    inlay: bodies of another color that fill the labels, or None.
    core: hull of a convex die inside its rounded edges, with the flat facets of the die.
    marks: (t,) whether a triangle of a concave die belongs to a label; None for a convex die.
    """

    poses: RestPoses
    outcomes: OutcomeProbabilities
    center_of_mass: Floats | None
    hull_points: Floats
    changes: tuple[str, ...] = ()
    is_printable: bool = True
    assessment: Assessment | None = None
    placements: tuple[Placement, ...] = ()
    inlay: Surface | None = None
    core: ConvexHull | None = None
    marks: Booleans | None = None

    def mark_facets(self, facets: Sequence[FacetOfDie], upward: float) -> tuple[FacetOfDie, ...]:
        """Facets of the plain die with the upright directions of the labels that are read at rest.

        upward: 1 if labels are read on top, -1 if underneath.
        """
        marked = []
        for facet in facets:
            own = [label for label in self.placements if label.text == facet.outcome]
            side = -upward * np.array(facet.normal)
            read = max(own, key=lambda label: float(label.frame[:3, 2] @ side), default=None)
            upright = None if read is None else tuple(read.frame[:3, 1].tolist())
            marked.append(replace(facet, upright=upright))
        return tuple(marked)


@dataclass(frozen=True, eq=False)
class FinishedDie:
    """Data of a finished run for figures and reports.

    Attributes
    ----------
    result: content of result.json.
    plain: assessment of die_plain.stl; engraved: the solid of die.stl, or None.
    tolerance: largest allowed |p - q|.
    upward: (3,) up direction in pictures.
    reshaped: surfaces before and after of a concave die; quality: of the surface after.
    repaired: the mesh that was repaired to the surface before, if any.
    thrown: results of a thrown die on its table.
    reading: way to read a die with labels; its places are in the order of `engraved.placements`.
    candidates: hulls of `result.candidates`, in their order.
    """

    result: Result
    plain: Assessment
    engraved: Solid | None
    tolerance: float
    upward: Floats
    reshaped: ConcaveDie | None = None
    quality: SurfaceQuality | None = None
    repaired: RepairedMesh | None = None
    thrown: ThrownDie | None = None
    reading: Reading | None = None
    candidates: tuple[ConvexHull, ...] = ()

    @property
    def printed(self) -> Surface:
        """Solid of die.stl, else of die_plain.stl."""
        return self.engraved or self.plain.body.surface

    @property
    def final(self) -> Assessment:
        """Assessment of die.stl if its probabilities are known, else of die_plain.stl."""
        return (self.engraved and self.engraved.assessment) or self.plain


def make_solid(die: Design, size_mm: float) -> Solid:
    """Make the plain solid of a convex die.

    size_mm: largest distance between two of its points, above 0.
    """
    given = die.center_of_mass
    center = die.hull.centroid if given is None else given
    hull = convex_hull((die.hull.vertices - center) * (size_mm / die.hull.diameter))
    place = (hull.centroid, "uniform solid") if given is None else (np.zeros(3), "given")
    poses = analyze(hull, *place).under(die.prior)
    return Solid(
        points=hull.vertices,
        triangles=hull.triangles,
        poses=poses,
        outcomes=outcome_probabilities(poses, die.directions, die.outcome_of),
        center_of_mass=None if given is None else np.zeros(3),
        hull_points=hull.vertices,
    )


def assess_file(
    data: bytes,
    directions: Floats,
    target: Target,
    center_of_mass: Floats | None = None,
    prior: Prior | None = None,
    within: float = SAME_REST_ANGLE,
) -> Assessment:
    """Read a file back and compute its rests and outcomes.

    Parameters
    ----------
    data: content of the STL file.
    directions: (f, 3) unit, down on the labeled faces, in the order of the target.
    target: wanted probabilities.
    center_of_mass: (3,) in the file's coordinates, or None for the uniform solid.
    prior: of start orientations in the file's coordinates, or None for the uniform one.
    within: see `Design`.

    Raises
    ------
    DegenerateBodyError, OutsideHullError: as `rest_poses`.
    """
    body = read_stl(data)
    poses = rest_poses(body, center_of_mass).under(prior)
    outcomes = outcome_probabilities(poses, directions, target.outcome_of_face, within)
    return Assessment(body, poses, outcomes, target)
