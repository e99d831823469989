"""Printed copies of a die of any surface, judged by the rest model.

On a flat facet an error moves the whole plane, and first derivatives suffice (`print_tolerances`).
A surface of any shape rests on single corners, and a facet of its hull that is no rest in the file
may be one of a print. So copies are made, with a smooth error of the surface, roughness of each
point, steps of layers, other lengths along the axes of the printer, and a center of mass moved by
added material, by drift of the density and by a bubble. All share their random numbers, so that a
small change of a body or an error is a small change of its copies. Lengths are in millimeters.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.fabricate.print_tolerances import (
    HALVINGS,
    NOTICED,
    ROLLS,
    variation_of_prints,
)
from dicedesign.fabricate.printers import Printer, PrintErrors
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors, second_moments
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.rest.prior import Prior
from dicedesign.results.result import PrintTolerances
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index
from dicedesign.throws.goodness_of_fit import chances_noticed
from dicedesign.tolerances import COPLANAR_TOLERANCE_FLOAT32

COPIES: Final = 64
"""Number of copies: their mean is known to an eighth of their spread."""

WAVES: Final = 256
"""Number of plane waves whose sum is a smooth error."""

REACH: Final = 6.0
"""Depth below the hull from which points may come to lie on it, in standard deviations."""


@dataclass(frozen=True, eq=False)
class CopiedBody:
    """Body with the random numbers of its copies.

    Attributes
    ----------
    poses: its rests. outward: (n, 3) unit normals at its points. depths: (n,) below the hull.
    points: (n, 3).
    smooth: (n, c) smooth errors of c copies with a standard deviation of 1.
    moved: (c, 3) shift of the center of mass by the material that they add.
    inside: (3, 3) mean over the body of the products of two coordinates, about the center of mass.
    volume: of the body.
    axes: (3, 3) axes of the printer in the body's coordinates, one per row, the last up.
    """

    poses: RestPoses
    points: Floats
    outward: Floats
    depths: Floats
    smooth: Floats
    moved: Floats
    inside: Floats
    volume: float
    axes: Floats

    @classmethod
    def of(
        cls,
        body: Body,
        poses: RestPoses,
        axes: Floats,
        correlation_mm: float,
        copies: int = COPIES,
    ) -> CopiedBody:
        """Draw the copies of a body with a closed surface.

        poses: its rests. axes: as above. correlation_mm: length over which smooth errors are alike.
        """
        points, triangles = body.points, body.triangles
        assert triangles is not None
        radii = points - poses.center_of_mass
        doubled = doubled_area_vectors(points, triangles)
        # A third of the area and of the moment of each triangle belongs to each of its corners.
        moments = norms(doubled)[:, None] * radii[triangles].mean(axis=1) / 6.0
        thrice = np.repeat(np.hstack([doubled, moments]), 3, axis=0)
        normals, shares = np.hsplit(sums_by_index(triangles.ravel(), thrice, len(points)), 2)
        squares, volume = second_moments(radii, triangles, np)
        random = np.random.default_rng(0)
        phases = radii @ (random.normal(size=(3, WAVES)) / correlation_mm)
        waves = np.concatenate([np.cos(phases), np.sin(phases)], axis=1) / np.sqrt(WAVES)
        smooth = waves @ random.normal(size=(2 * WAVES, copies))
        return cls(
            poses=poses,
            points=points,
            outward=normals / np.maximum(norms(normals), np.finfo(np.float64).tiny)[:, None],
            depths=poses.hull.least_depths(points),
            smooth=smooth,
            moved=smooth.T @ shares / volume,
            inside=np.asarray(squares / volume),
            volume=float(volume),
            axes=axes,
        )

    def probabilities(
        self,
        errors: PrintErrors,
        layer_mm: float,
        directions: Floats,
        outcome_of: Integers | None = None,
        prior: Prior | None = None,
    ) -> Floats:
        """Probabilities of the copies, (c, k + 1): of the k outcomes, and elsewhere, where copies
        that are no body fall too.

        errors: standard deviations. layer_mm: height of layers; 0 for none. directions: (f, 3) down
        on the faces. outcome_of: (f,) outcome of each face; None for one each. prior: of the
        orientations at first.
        """
        deviation = np.hypot(errors.dimensional_mm, errors.roughness_mm)
        rounding = COPLANAR_TOLERANCE_FLOAT32 * self.poses.hull.diameter
        near = np.flatnonzero(self.depths <= REACH * float(deviation) + layer_mm + rounding)
        points, outward, up = self.points[near], self.outward[near], self.axes[2]
        drift = self.inside @ up / np.ptp(self.points @ up)
        bubble = np.linalg.cholesky(self.inside) * (errors.bubble_mm3 / self.volume)
        count = len(directions) if outcome_of is None else int(outcome_of.max()) + 1
        results = np.zeros((len(self.moved), count + 1))
        for copy, result in enumerate(results):
            random = np.random.default_rng([copy])
            lengths, density, place = random.normal(size=3), random.normal(), random.normal(size=3)
            start, rough = random.uniform(), random.normal(size=len(self.points))[near]
            off = errors.dimensional_mm * self.smooth[near, copy] + errors.roughness_mm * rough
            places = points + off[:, None] * outward
            if layer_mm > 0.0:
                heights = places @ up / layer_mm + start
                places += (layer_mm * (np.round(heights) - heights))[:, None] * up
            stretch = (self.axes.T * (1.0 + errors.shrinkage * lengths)) @ self.axes
            center = self.poses.center_of_mass + errors.dimensional_mm * self.moved[copy]
            center = center + errors.density_gradient * density * drift - bubble @ place
            result[-1] = 1.0
            with suppress(DiceError):
                poses = analyze(convex_hull(places @ stretch), center @ stretch).under(prior)
                found = outcome_probabilities(poses, directions, outcome_of)
                result[:] = *found.probabilities, found.elsewhere
        return results


Faces: TypeAlias = tuple[Floats, Integers | None, Prior | None]
"""Directions (f, 3) down on the faces of a die, their outcomes (f,) or None for one each, and the
prior of the orientations at first, if any."""

ALONE: Final = ("dimensional_mm", "roughness_mm", "shrinkage", "density_gradient", "bubble_mm3")
"""Errors of copies, each also without the others."""


def copied_tolerances(
    copied: CopiedBody,
    target: Floats,
    errors: PrintErrors,
    printer: Printer,
    faces: Faces,
) -> PrintTolerances:
    """Effect of print errors on the probabilities of a die of any surface, by copies of it.

    target: (k,) wanted probabilities. errors: their standard deviations. printer: its name and
    layers.
    """

    def prints(layer_mm: float = 0.0, **some: float) -> Floats:
        none = dict.fromkeys(ALONE, 0.0)
        return copied.probabilities(replace(errors, **none | some), layer_mm, *faces)

    def share_noticed(offset: float) -> float:
        biases = prints(dimensional_mm=offset)[:, :-1] - target
        return float(chances_noticed(target, ROLLS, biases).mean())

    every = copied.probabilities(errors, printer.layer_mm, *faces)
    alone = {name: prints(**{name: getattr(errors, name)}) for name in ALONE}
    alone["layers"] = prints(printer.layer_mm)
    least, most = 0.0, errors.dimensional_mm
    if share_noticed(most) > NOTICED:
        for _ in range(HALVINGS):
            middle = (least + most) / 2.0
            least, most = (middle, most) if share_noticed(middle) < NOTICED else (least, middle)
    facts = variation_of_prints(target, every[:, :-1], float(every[:, -1].mean()))
    *shares, other = (f"{100.0 * share:.2g}" for share in every.mean(axis=0))
    return PrintTolerances(
        answer=(
            f"Printed on an ordinary printer ({printer.name}), the outcomes come up "
            f"{', '.join(shares)} % of the time, and {other} % of throws end on other sides. Nine "
            f"in ten prints are off by at most {100.0 * facts['nine_in_ten']:.2g} % in total."
        ),
        method="copies",
        rolls=ROLLS,
        allowed_mm=most,
        noticed=float(chances_noticed(target, ROLLS, every[:, :-1] - target).mean()),
        assumed=asdict(errors),
        deviations=tuple(every[:, :-1].std(axis=0).tolist()),
        by_error={name: tuple(each[:, :-1].std(axis=0).tolist()) for name, each in alone.items()},
        **facts,
    )
