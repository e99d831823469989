"""Labels of given designs, and sizes at which they fit."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_design

from dicedesign.errors import EngravingError
from dicedesign.fabricate.die import make_solid
from dicedesign.fabricate.engraving import LEAST_SHARE, even_depths, place_on_facets
from dicedesign.fabricate.engraving import engrave as cut_labels
from dicedesign.fabricate.label_art import text_section
from dicedesign.fabricate.printability import narrowest_stroke, walls_under
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.manifold import solid
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.solid import place_at_size
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from tests.reference import solids


def engrave_box(
    size_mm: float = 25.0, center_of_mass: Floats | None = None, read: str = "auto"
) -> Work:
    """Run up to the stage "engrave" of a box that is not fair."""
    work = run_to_design(
        box(4.0, 5.0, 6.0),
        SIDES,
        Status.NO_PROGRESS,
        {"fair": 6, "labels": list("abcdef")},
        {"engrave": {"read": read, "balance": "none"}, "size_mm": size_mm},
        center_of_mass=center_of_mass,
    )
    run_stages(work, after="design", last="engrave")
    return work


def frustum(top: float) -> Floats:
    """Corners of a frustum 4 wide and 2.5 high."""
    corners = box(4.0, 4.0, 2.5)
    corners[corners[:, 2] > 0.0] *= [top, top, 1.0]
    return corners


BASE_AND_TOP = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])


def engrave_given(
    points: Floats, directions: Floats, labels: list[str], engrave: Any, **entries: Any
) -> Work:
    """Run up to the stage "engrave" of a given body that is not fair."""
    target = {"fair": len(labels), "labels": labels}
    given = {"engrave": engrave, **entries}
    work = run_to_design(points, directions, Status.NO_PROGRESS, target, given)
    run_stages(work, after="design", last="engrave")
    return work


@pytest.mark.parametrize("depth_mm", [0.3, 3.0])
def test_large_changes_by_labels_are_noted(depth_mm: float) -> None:
    """A deep label in the base of a frustum changes the small probability of its top a lot."""
    options = {"depth_mm": depth_mm, "max_height_mm": 20.0, "min_height_mm": 1.0, "read": "down"}
    work = engrave_given(frustum(0.3), BASE_AND_TOP, ["■", "1"], options)
    after = work.engraved.assessment.outcomes.probabilities
    changes = np.abs(after / work.plain.outcomes.probabilities - 1.0)
    notes = [re.search(r"probabilities of (\S+) by (\d+)%", note) for note in work.notes]
    named = [(match[1], int(match[2])) for match in notes]
    largest = ("■", "1")[int(changes.argmax())], round(100.0 * changes.max())
    assert named == ([largest] if depth_mm > 1.0 else [])
    assert (changes.max() > 0.05) == (depth_mm > 1.0)


@pytest.mark.parametrize(("read", "sign"), [("down", 1.0), ("auto", -1.0)])
def test_the_file_has_each_label_where_it_is_read(read: str, sign: float) -> None:
    """Each label takes its volume from the facet on top, or from the one that is down."""
    work = engrave_box(read=read)
    surface = read_stl(work.files["die.stl"]).surface
    engraved_solid, depth = solid(surface), 0.6
    # The hull is the box, as labels are pockets.
    hull = convex_hull(surface.points, single_precision=True)
    plain = solid(hull.surface)
    for label, side, placement in zip("abcdef", SIDES, work.engraved.placements, strict=True):
        assert placement.text == label
        outward = sign * side
        height = float((surface.points @ outward).max()) - 1.01 * depth
        taken = (
            plain.trim_by_plane(outward.tolist(), height).volume()
            - engraved_solid.trim_by_plane(outward.tolist(), height).volume()
        )
        assert taken == pytest.approx(placement.section().area() * depth, rel=1e-3)
    # Labels that are exchanged would be noticed.
    areas = [text_section(label).area() for label in "abcdef"]
    assert np.diff(np.sort(areas)).min() > 2e-3 * max(areas)
    # With a given center of mass the die is not assessed.
    assert work.engraved.assessment is not None
    given = engrave_box(read=read, center_of_mass=np.zeros(3))
    assert given.engraved.assessment is given.result().engraved.probabilities is None


def test_labels_without_room_or_rest_are_an_error_on_good_dice_only() -> None:
    fair = run_to_design(box(1.0, 1.0, 1.0), entries={"engrave": True, "size_mm": 3.0})
    with pytest.raises(EngravingError):
        run_stages(fair, after="design", last="engrave")
    directions = SIDES.copy()
    directions[5] = [0.8, 0.6, 0.0]
    lacking = engrave_given(box(4.0, 5.0, 6.0), directions, list("abcdef"), True)
    assert (lacking.plain.outcomes.main < 0).sum() == 1
    for work, label in ((engrave_box(size_mm=3.0), ""), (lacking, "label 'f'")):
        assert work.engraved is None
        assert label in work.remarks[-1]
        assert "die.stl" not in work.files


@pytest.mark.parametrize(
    ("size_mm", "read", "way"),
    [(100.0, "auto", "up"), (30.0, "auto", "down"), (30.0, "up", None), (8.0, "auto", None)],
)
def test_labels_without_room_on_top_are_read_from_below(
    size_mm: float, read: str, way: str | None
) -> None:
    """The short label fits on the small top of a frustum, the long one only on its base."""
    options = {"read": read}
    work = engrave_given(frustum(0.2), BASE_AND_TOP, ["1200", "1"], options, size_mm=size_mm)
    assert (None if work.engraved is None else work.reading.way) == way


# Depths that keep the center of mass.


GROUPS = {"tetrahedron": "Td", "cube": "Oh", "octahedron": "Oh", "dodecahedron": "Ih"}


def design_of(name: str, **entries: Any) -> Work:
    """Run up to the stage "design" with a platonic solid as its result."""
    hull = convex_hull(solids.PLATONIC[name])
    target = {"fair": len(hull.normals)}
    work = run_to_design(hull.vertices, hull.normals, target=target, symmetry=GROUPS[name])
    work.recipe = parse_recipe({"name": "die", "target": target, **entries})
    return work


@pytest.mark.parametrize("name", ["tetrahedron", "octahedron", "dodecahedron"])
def test_depths_of_pockets_keep_the_center_of_mass(name: str) -> None:
    work = design_of(name)
    placements = place_at_size(work, work.die, 30.0)
    die, options = make_solid(work.die, 30.0), work.recipe.engrave
    center = die.poses.hull.centroid
    even = even_depths(placements, options.depth_mm, center)
    assert even is not None
    shares = [placement.depth_share for placement in even]
    assert LEAST_SHARE <= min(shares) < max(shares) == pytest.approx(1.0)
    plain = Surface(die.points, die.triangles)
    assert norms(cut_labels(plain, placements, options).centroid - center) > 1e-4
    assert norms(cut_labels(plain, even, options).centroid - center) < 1e-12
    assert even_depths(placements[:1], options.depth_mm, center) is None


@pytest.mark.parametrize(("printer", "is_kept"), [("fdm", True), ("sls", False)])
def test_a_symmetry_is_kept_if_the_printer_shows_the_labels(printer: str, is_kept: bool) -> None:
    """By depths of pockets; otherwise facets move."""
    work = design_of("dodecahedron", print=printer)
    run_stages(work, after="design", last="engrave")
    assert work.status is Status.CONVERGED
    assert (work.balance.moved_mm < 1e-9) == is_kept
    before, after = (convex_hull(each.points) for each in (work.solid, work.engraved))
    assert np.allclose(np.sort(before.areas), np.sort(after.areas), rtol=1e-6) == is_kept
    # The center of mass is the origin, and the labels are on the facets.
    assert norms(read_stl(work.files["die.stl"]).surface.centroid) < 1e-5
    for placement in work.engraved.placements:
        facet = np.argmax(after.normals @ placement.normal)
        height = after.vertices[after.tail[after.facet_start[facet]]] @ after.normals[facet]
        assert placement.frame[:3, 3] @ after.normals[facet] == pytest.approx(height, abs=1e-5)


def test_a_rounded_die_keeps_its_symmetry_where_moved_facets_would_split_corners() -> None:
    work = design_of("octahedron", edges=True, numbering="standard")
    run_stages(work, after="design", last="engrave")
    assert work.engraved is not None
    assert work.engraved.assessment is not None
    np.testing.assert_allclose(work.engraved.assessment.outcomes.probabilities, 0.125, atol=1e-9)
    assert work.balance is not None
    assert work.balance.moved_mm < 1e-9


# Sizes.


def sized_work(
    size_mm: float, engrave: bool = True, enlarge: bool = True, label: str = "6", thin: float = 4.0
) -> Work:
    """Run up to the stage "size" of a box with a label on a facet with its smallest side."""
    entries = {"engrave": engrave, "size_mm": size_mm, "numbering": "given"}
    target = {"fair": 6, "labels": ["1", "2", "3", "4", "5", label]}
    work = run_to_design(box(thin, 5.0, 6.0), target=target, entries=entries)
    work.enlarge = enlarge
    run_stages(work, after="design", last="size")
    return work


def fits(work: Work, size_mm: float) -> bool:
    solid = make_solid(work.die, size_mm)
    try:
        place_on_facets(solid, solid.poses.hull, work.target.labels, work.recipe.engrave)
    except EngravingError:
        return False
    return True


def test_the_size_is_the_smallest_whole_number_of_millimeters() -> None:
    work = sized_work(5.0)
    size = work.recipe.size_mm
    assert size == int(size) > 5.0
    assert fits(work, size)
    assert not fits(work, size - 1.0)
    (note,) = work.notes
    assert f"{size:g}" in note


MONTHS = "January February March April May June July August September October November December"


def test_long_words_are_finer_before_a_die_is_larger() -> None:
    """Narrow capitals in several lines; all strokes and ridges suit the printer."""
    work = design_of("dodecahedron", print="fdm")
    entries = {"name": "die", "target": {"fair": 12, "labels": MONTHS.split()}}
    work.recipe, work.enlarge = parse_recipe(entries), True
    work.target = work.recipe.target.target()
    run_stages(work, after="design", last="size")
    assert work.recipe.size_mm <= 33.0
    assert "Jan, Feb, Mar, ... would fit at 30 mm" in work.notes[-1]
    for placement in place_at_size(work, work.die, work.recipe.size_mm):
        widths = [narrowest_stroke(placement.section(), side) for side in (-1.0, 1.0)]
        assert min(width for width in widths if width) >= 0.4
        assert len(placement.text) > 1 or placement.height >= 2.5


@pytest.mark.parametrize(
    ("name", "is_wider"), [("tetrahedron", True), ("cube", False), ("dodecahedron", False)]
)
def test_walls_suit_the_printer(name: str, is_wider: bool) -> None:
    """Without a size; margins are wider where pockets of neighboring facets come close."""
    work = design_of(name, print="fdm")
    work.enlarge = True
    run_stages(work, after="design", last="size")
    engrave, printing = work.recipe.engrave, work.recipe.print
    assert engrave is not None
    assert printing is not None
    least = printing.selected_printer.wall_mm
    assert (engrave.margin_mm >= least) == is_wider
    solid = make_solid(work.die, work.recipe.size_mm)
    placements = place_at_size(work, work.die, work.recipe.size_mm)
    assert min(walls_under(placements, engrave.depth_mm, solid.poses.hull)) >= least


@pytest.mark.parametrize(
    "options",
    [
        {"size_mm": 30.0},
        {"engrave": False},
        {"enlarge": False},
        # More than the largest size would be needed.
        {"size_mm": 30.0, "label": "not so short", "thin": 0.02},
    ],
    ids=str,
)
def test_a_size_that_suffices_or_would_not_help_is_kept(options: dict[str, Any]) -> None:
    work = sized_work(**{"size_mm": 5.0, **options})
    assert (work.recipe.size_mm, work.notes) == (options.get("size_mm", 5.0), [])
