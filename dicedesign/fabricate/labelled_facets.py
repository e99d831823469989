"""Where the labels of a convex die lie, and the core that its edges are rounded from."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dicedesign.errors import EngravingError
from dicedesign.fabricate.die import Solid
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.runtime.arrays import Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.fabricate.label_reading import Reading
    from dicedesign.geometry.hulls.hull import ConvexHull

__all__ = ["core_of", "place_on_facets", "require_rests"]


def core_of(solid: Solid, edges: EdgeOptions | None) -> ConvexHull:
    """The shape inside the rounded edges of a convex die, its facets numbered as those of the die.

    Raises EngravingError where the radius is larger than the circle of a facet to rest on.
    """
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.hulls.polygons import facet_inradius

    hull = solid.poses.hull
    if edges is None:
        return hull
    core = convex_hull(core_scale(edges, hull.diameter) * hull.vertices)
    for facet in solid.poses.facets.tolist():
        room = facet_inradius(core, facet)
        if edges.radius_mm > room:
            raise EngravingError(
                f"edges.radius_mm: expected at most the radius of the circle that is left flat on "
                f"facet {facet}, {room:.3g} mm, got {edges.radius_mm:g}; lower it, or take a "
                "larger size_mm"
            )
    return core


def place_on_facets(
    solid: Solid, hull: ConvexHull, labels: Sequence[str], options: EngravingOptions
) -> tuple[Reading, list[Placement]]:
    """How a die is read, and where its labels lie on the facets of its hull, or of its core
    (`core_of`), in the order of the places of that reading.

    Raises EngravingError where an outcome has no facet to rest on, the die cannot be read as the
    options say, or a label does not fit.
    """
    from dicedesign.fabricate.engraving import require_fields
    from dicedesign.fabricate.label_layout import edge_margins, place_labels
    from dicedesign.fabricate.label_reading import die_readings

    main = solid.outcomes.main
    require_rests(labels, main, "a facet")
    *better, last = die_readings(hull, solid.poses.facets[main], labels, options.read)

    def placed(reading: Reading) -> list[Placement]:
        places, whole = reading.places, reading.way != "corner"
        return place_labels(
            [place.text for place in places],
            [place.region for place in places],
            [place.normal for place in places],
            [place.facet for place in places],
            # Around a corner labels stand upright toward it.
            options if whole else replace(options, upright="edge"),
            solid.poses.hull.diameter,
            [edge_margins(hull, place.facet, options) for place in places] if whole else None,
        )

    for reading in better:
        with suppress(EngravingError):
            placements = placed(reading)
            require_fields(hull, placements, options)
            return reading, placements
    return last, placed(last)


def require_rests(labels: Sequence[str], main: Integers, what: str) -> None:
    """Raise EngravingError where an outcome, by the number (k,) of its own rest or -1, has none.

    what: it is to have, in words.
    """
    if (main < 0).any():
        raise EngravingError(
            f"label {labels[int(main.argmin())]!r}: expected {what} to rest on for each label, got "
            "none for this one; finish the design first"
        )
