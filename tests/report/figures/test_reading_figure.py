"""The picture of how a die is read."""

from __future__ import annotations

import numpy as np
import pytest
from common.made_up_die import SIDES, box, designed

from dicedesign.fabricate.label_layout import Placement
from dicedesign.fabricate.label_reading import LabelPlace
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.recipe.pipeline import run_stages
from dicedesign.recipe.report import finished_die
from dicedesign.recipe.work import Work
from dicedesign.report.charts.palette import ACCENT, rgb
from dicedesign.report.figures.figure import FIGURES
from dicedesign.report.figures.reading import painted, reading_figure
from dicedesign.report.render.renderer import Surface
from dicedesign.runtime.arrays import Floats
from tests.reference.solids import PLATONIC


def engraved(points: Floats, directions: Floats, read: str, style: str = "engraved") -> Work:
    target = {"fair": len(directions)}
    entries = {"engrave": {"read": read, "style": style, "border_mm": 0.3}, "size_mm": 36.0}
    work = designed(points, directions, target=target, entries=entries)
    run_stages(work, after="design", last="engrave")
    assert work.engraved is not None
    return work


def labels_of(work: Work, outcome: int) -> list[tuple[LabelPlace, Placement]]:
    assert work.engraved is not None
    assert work.reading is not None
    pairs = zip(work.reading.places, work.engraved.placements, strict=True)
    return [(place, placement) for place, placement in pairs if place.outcome == outcome]


def area_of_color(surface: Surface, color: Floats) -> float:
    """Area of the triangles of a color; a triangle's corners are of one."""
    assert surface.colors is not None
    colors = surface.colors[surface.triangles]
    assert (colors == colors[:, :1]).all()
    chosen = (colors[:, 0] == color).all(axis=1)
    areas = doubled_area_vectors(surface.points, surface.triangles[chosen])
    return 0.5 * float(np.linalg.norm(areas, axis=1).sum())


@pytest.mark.parametrize(
    ("points", "read", "places", "style"),
    [
        (box(1.0, 1.0, 1.0), "up", 1, "engraved"),
        (box(1.0, 1.0, 1.0), "down", 1, "engraved"),
        (PLATONIC["tetrahedron"], "up", 3, "engraved"),
        (PLATONIC["tetrahedron"], "up", 3, "raised"),
    ],
)
def test_what_is_in_colour_is_the_label_that_is_read(
    points: Floats, read: str, places: int, style: str
) -> None:
    """Its floor, or its top where it stands with others in a field."""
    work = engraved(points, convex_hull(points).normals, read, style)
    assert work.engraved is not None
    for outcome in range(len(work.target.labels)):
        mine = labels_of(work, outcome)
        assert len(mine) == places
        surface = painted(work.engraved.points, work.engraved.triangles, mine)
        area = sum(placement.section().area() for _, placement in mine)
        label_color, facet_color = rgb([ACCENT, "#f2dd6e"])
        assert area_of_color(surface, label_color) == pytest.approx(area, rel=1e-3)
        if places == 1:
            facet = work.solid.poses.hull.areas[mine[0][0].facet]
            assert area_of_color(surface, facet_color) == pytest.approx(facet - area, rel=0.01)


def test_the_straight_view_shows_the_label() -> None:
    """As large a part of the picture of the facet is in its colour as of the facet itself."""
    work = engraved(box(1.0, 1.0, 1.0), SIDES, "up")
    assert work.engraved is not None
    mine = labels_of(work, 2)
    ((place, placement),) = mine
    surface = painted(work.engraved.points, work.engraved.triangles, mine)
    paper = reading_figure(
        surface,
        SIDES[2],
        placement.frame[:3, 1],
        [("from above", -SIDES[2], placement.frame[:3, 1])],
        "Read it.",
    )
    assert paper.texts == ["as it lies", "from above", "Read it."]
    picture = paper.pictures[1].astype(np.int64)
    red, green, blue = np.moveaxis(picture, -1, 0)
    seen = (picture < 255).any(axis=-1)
    part = (seen & (red > 2 * green)).sum() / seen.sum()
    area = placement.section().area()
    assert part == pytest.approx(area / work.solid.poses.hull.areas[place.facet], rel=0.1)
    assert (blue[seen] < red[seen]).all()


@pytest.mark.parametrize("read", ["up", "down"])
def test_an_engraved_die_has_the_picture(read: str) -> None:
    work = engraved(box(1.0, 1.0, 1.0), SIDES, read)
    die = finished_die(work)
    assert FIGURES["reading"].wanted(die)
    assert FIGURES["reading"].draw(die).startswith(b"\x89PNG")
