"""Printability of dice with known measures: walls, thin parts, and orientations on the bed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from common.made_up_die import SIDES, box, run_to_check
from manifold3d import CrossSection
from scipy.spatial import cKDTree

from dicedesign.errors import InputError
from dicedesign.fabricate.printability import (
    PrintedSolid,
    beds,
    check_file,
    narrowest_stroke,
    thin_parts,
)
from dicedesign.fabricate.printers import MATERIALS, PRINTERS, Printer, PrintErrors, PrintOptions
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.results.print_parts import Printability
from tests.reference.solids import PLATONIC


def test_options_are_checked_with_their_printer_and_abbreviated_in_recipes() -> None:
    for entries, named in (
        ({"printer": "cnc"}, "printer: .*sls.*cnc"),
        ({"printer": "sla", "nozzle_mm": 0.2}, "nozzle"),
        ({"material": "pa12"}, "petg.*pa12"),
        ({"infill": 1.5}, "infill"),
    ):
        with pytest.raises(InputError, match=named):
            PrintOptions(**entries)
    assert PrintOptions(material="abs").density == MATERIALS["abs"].density_g_cm3
    assert PrintOptions(material="abs", density_g_cm3=1.5).density == 1.5
    options: dict[str, Any] = {"printer": "sls", "oriented": True, "infill": 0.2}
    errors = {"dimensional_mm": 0.05}
    for entries, expected in (
        ("sla", PrintOptions(printer="sla")),
        ({**options, "errors": errors}, PrintOptions(**options, errors=PrintErrors(**errors))),
        (False, None),
    ):
        recipe = parse_recipe({"name": "d4", "target": {"fair": 4}, "print": entries})
        assert recipe.print == parse_recipe(recipe.as_dict()).print == expected


def assess_box(
    points: np.ndarray, directions: np.ndarray, target: object = None, **entries: object
) -> Work:
    given = {"engrave": True, "size_mm": 30.0, **entries}
    work = run_to_check(points, directions, target=target, entries=given)
    run_stages(work, after="check", last="printing")
    return work


def measures_of(work: Work) -> Printability:
    measured = work.result().printability
    assert measured is not None
    return measured


SIDE = 30.0 / np.sqrt(3.0)


def test_walls_equal_those_of_dense_samples() -> None:
    """The least distance in the engraved file between points on two pockets, or on a floor and on a
    facet that faces the other way."""
    deep = 0.9
    options = {"depth_mm": deep, "max_height_mm": 15.0}
    work = assess_box(box(1.0, 1.0, 0.2), SIDES[[2, 5]], engrave=options)
    assert work.engraved is not None
    mesh = trimesh.Trimesh(work.engraved.points, work.engraved.triangles, process=False)
    frames = [placement.frame for placement in work.engraved.placements]
    depths = [-(mesh.triangles - frame[:3, 3]) @ frame[:3, 2] for frame in frames]
    inside = [
        (d.max(axis=1) > 1e-4) & (d.max(axis=1) < deep + 1e-4) & (d.min(axis=1) > -1e-4)
        for d in depths
    ]
    floor = inside[0] & (depths[0].min(axis=1) > deep - 1e-4)
    beneath = ~(inside[0] | inside[1]) & (mesh.face_normals @ frames[0][:3, 2] < -0.01)
    samples = [
        trimesh.sample.sample_surface(
            mesh.submesh([np.flatnonzero(part)], append=True), 20000, seed=1
        )[0]
        for part in (inside[0], inside[1], floor, beneath)
    ]
    nearest = min(
        cKDTree(samples[other]).query(samples[part])[0].min() for part, other in ((0, 1), (2, 3))
    )
    assert nearest - 0.1 < measures_of(work).labels[0].wall_mm < nearest + 1e-6


def test_a_cube_with_labels_on_the_bed() -> None:
    """It has a diagonal of 30 mm, needs no supports, and weighs its volume."""
    engrave = {"depth_mm": 0.75, "balance": "none"}
    cube = assess_box(box(1.0, 1.0, 1.0), SIDES, engrave=engrave, print={"oriented": True})
    measured = measures_of(cube)
    mesh, laid = (
        trimesh.load(trimesh.util.wrap_as_stream(cube.files[name]), file_type="stl", process=False)
        for name in ("die.stl", "die_oriented.stl")
    )
    assert measured.file.is_solid
    assert measured.file.volume_mm3 == pytest.approx(mesh.volume, rel=1e-6)
    assert measured.weight_g == pytest.approx(1.24e-3 * mesh.volume, rel=1e-6)
    np.testing.assert_allclose(measured.bounding_box_mm, mesh.extents, rtol=1e-6)
    assert measured.smallest_facet.area_mm2 == pytest.approx(SIDE**2)
    assert measured.smallest_facet.inradius_mm == pytest.approx(SIDE / 2.0)
    assert len(measured.poses) == 6
    for pose in (*measured.poses, measured.best):
        assert pose.overhang_mm2 == 0.0
        assert pose.height_mm == pytest.approx(SIDE, rel=1e-6)
        assert 5.0 < SIDE**2 - pose.contact_mm2 < 60.0
        assert pose.spoiled == (pose.label,)
    assert measured.warnings == ()
    placement = np.array(measured.placement)
    moved = mesh.triangles @ placement[:3, :3].T + placement[:3, 3]
    np.testing.assert_allclose(laid.triangles, moved, atol=1e-5)
    assert laid.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    on_bed = (laid.triangles[:, :, 2] < 1e-4).all(axis=1)
    assert laid.area_faces[on_bed].sum() == pytest.approx(measured.best.contact_mm2, rel=1e-5)


def test_bare_facets_come_first() -> None:
    """A box without labels on its ends."""
    measured = measures_of(assess_box(box(1.0, 1.1, 1.2), SIDES[[0, 1, 3, 4]]))
    assert measured.best.label is None
    assert abs(measured.best.normal[2]) == pytest.approx(1.0)
    assert measured.best.spoiled == ()
    assert {pose.label for pose in measured.poses} >= {"1", "2", "3", "4"}


@pytest.mark.parametrize(
    ("entries", "part"),
    [
        ({"print": {"nozzle_mm": 2.0}}, "strokes"),
        ({"print": "sls", "engrave": {"depth_mm": 0.3, "style": "raised"}}, "0.3 mm deep"),
        ({"engrave": {"depth_mm": 1.2, "margin_mm": 0.3, "max_height_mm": 20.0}}, "walls"),
    ],
)
def test_warnings_have_remedies(entries: dict, part: str) -> None:
    work = assess_box(box(1.0, 1.0, 1.0), SIDES, **entries)
    warnings = measures_of(work).warnings
    assert any(part in warning and ":" in warning for warning in warnings)
    assert tuple(work.notes[-len(warnings) :]) == warnings
    are_raised = "sls" in entries.values()
    assert all((label.wall_mm is None) == are_raised for label in measures_of(work).labels)


def test_flaws_of_a_file_are_counted() -> None:
    hull = convex_hull(box(2.0, 2.0, 2.0))
    corners, triangles = hull.vertices, hull.triangles
    whole = check_file(corners, triangles)
    assert (whole.is_solid, whole.pieces) == (True, 1)
    open_box = check_file(corners, triangles[1:])
    assert (open_box.open_edges, open_box.is_solid) == (3, False)
    inward = check_file(corners, triangles[:, ::-1])
    assert inward.volume_mm3 == pytest.approx(-8.0)
    assert (inward.pieces, inward.cavities) == (0, 1)
    assert not inward.is_solid
    twice = np.concatenate([triangles, triangles + 8])
    crossed = check_file(np.concatenate([corners, corners + 1.0]), twice)
    assert crossed.pieces == 2
    assert crossed.self_intersections > 0
    two = check_file(np.concatenate([corners, corners + 3.0]), twice)
    assert (two.pieces, two.self_intersections, two.is_solid) == (2, 0, False)
    nested = np.concatenate([triangles, triangles[:, ::-1] + 8])
    hollow = check_file(np.concatenate([corners, 0.5 * corners]), nested)
    assert (hollow.pieces, hollow.cavities, hollow.is_solid) == (1, 1, True)
    assert hollow.volume_mm3 == pytest.approx(7.0)


@pytest.mark.parametrize(("printer", "is_trapped"), [("fdm", False), ("sls", True)])
def test_a_hollow_full_of_powder_is_reported(printer: str, is_trapped: bool) -> None:
    corners = PLATONIC["tetrahedron"] * (1.0, 1.1, 1.3)
    entries = {"print": printer, "engrave": {"balance": "opposite"}}
    measured = measures_of(assess_box(corners, convex_hull(corners).normals, **entries))
    assert measured.file.cavities == 1
    assert any("hollow" in warning for warning in measured.warnings) is is_trapped


# Parts that are too thin to print.


def ring(radius: float, corners: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(corners) / corners
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def widths(section: CrossSection) -> tuple[float | None, float | None]:
    """Narrowest stroke and narrowest gap between strokes."""
    return narrowest_stroke(section), narrowest_stroke(section, 1.0)


def test_bars_are_as_wide_as_their_shorter_sides_and_a_triangle_has_no_strokes() -> None:
    bars = CrossSection.square((0.5, 2.0))
    assert widths(bars) == (0.5, None)
    bars += CrossSection.square((0.375, 2.0)).translate((0.75, 0.0))
    assert widths(bars) == pytest.approx((0.375, 0.25), rel=1e-12)
    assert widths(CrossSection([[(0.0, 0.0), (1.0, 0.0), (0.5, 0.9)]]))[0] is None
    assert narrowest_stroke(CrossSection()) is None


def test_a_ring_is_as_wide_as_its_radii_differ() -> None:
    """The width between two regular polygons is the difference of the radii of their inscribed
    circles, in the single precision of sections."""
    inscribed = np.cos(np.pi / 40)
    expected = (0.6 * inscribed, 2.8 * inscribed)
    section = CrossSection([ring(2.0, 40), ring(1.4, 40)[::-1]])
    assert widths(section) == pytest.approx(expected, rel=2e-7)


SPREAD = 0.01
"""Five standard deviations of a share estimated from some ten thousand samples."""


def test_a_tube_is_as_thin_as_its_wall() -> None:
    outer, inner, height = 10.0, 9.4, 20.0
    section = [(inner, 0.0), (outer, 0.0), (outer, height), (inner, height), (inner, 0.0)]
    mesh = trimesh.creation.revolve(np.array(section), sections=64)
    tube = Surface(np.array(mesh.vertices), np.array(mesh.faces))
    thin = thin_parts(tube, 0.8)
    assert thin is not None
    assert thin.least_mm == pytest.approx(outer - inner, rel=3e-3)
    sides = 2.0 * np.pi * (outer + inner) * height
    rims = 2.0 * np.pi * (outer**2 - inner**2)
    assert thin.share == pytest.approx(sides / (sides + rims), abs=SPREAD)
    assert np.hypot(*thin.place[:2]) == pytest.approx((outer + inner) / 2.0, rel=2e-2)
    assert thin_parts(tube, 0.55) is None


@pytest.mark.parametrize(("degrees", "is_thin"), [(60.0, False), (25.0, True)])
def test_only_sharp_edges_are_thin_walls(degrees: float, is_thin: bool) -> None:
    """A prism whose section is a triangle with an angle in degrees."""
    rise = 20.0 * np.tan(np.radians(degrees / 2.0))
    section = np.array([(0.0, 0.0), (20.0, rise), (20.0, -rise)])
    points = np.array([(x, y, z) for x, y in section for z in (0.0, 30.0)])
    thin = thin_parts(convex_hull(points).surface, 0.8)
    assert (thin is not None) == is_thin
    if thin is not None:
        # A ray at a distance s along the side is s tan(angle) long.
        assert thin.place[0] < 0.8 / np.tan(np.radians(degrees))
        reach = 0.8 / np.tan(np.radians(degrees)) * 30.0
        side = np.hypot(20.0, rise) * 30.0
        area = 2.0 * side + 2.0 * rise * 30.0 + 2.0 * 20.0 * rise
        assert thin.share == pytest.approx(2.0 * reach / area, rel=0.1)


def test_thick_bodies_have_no_thin_parts_and_sheets_are_refused() -> None:
    cube = convex_hull(box(20.0, 20.0, 20.0)).surface
    assert thin_parts(cube, 0.8) is None
    with pytest.raises(InputError, match="solid"):
        thin_parts(Surface(cube.points, cube.triangles[:-1]), 0.8)


# Orientations on the print bed.


def printer_with(degrees: float) -> Printer:
    """Printer that needs supports up to an angle from level."""
    return replace(PRINTERS["fdm"], overhang_deg=degrees)


def icosahedron(edge: float) -> ConvexHull:
    return convex_hull(0.5 * edge * PLATONIC["icosahedron"])


def plain(hull: ConvexHull) -> PrintedSolid:
    return PrintedSolid(hull.vertices, hull.triangles, hull, (), np.zeros((0, 3)))


def test_an_icosahedron_has_three_overhanging_faces() -> None:
    """Its neighbors rise at 41.8 degrees: filament cannot, resin can."""
    hull, face = icosahedron(10.0), math.sqrt(3.0) / 4.0 * 100.0
    solid = plain(hull)
    for pose in solid.poses(hull.normals, printer_with(45.0)):
        assert pose.contact_mm2 == pytest.approx(face)
        assert pose.overhang_mm2 == pytest.approx(3.0 * face)
        # The prism beneath a face that rises from an edge on the bed: its mean height is a third
        # of the tip's, its base the face's shadow.
        rise = math.acos(math.sqrt(5.0) / 3.0)
        tip = math.sqrt(3.0) / 2.0 * 10.0 * math.sin(rise)
        beneath = 3.0 * face * math.cos(rise) * tip / 3.0
        assert pose.support_mm3 == pytest.approx(beneath)
    for limit in (0.0, 19.0, 41.8):
        poses = solid.poses(hull.normals, printer_with(limit))
        assert [pose.overhang_mm2 for pose in poses] == [0.0] * 20


def test_labels_on_supports_are_spoiled() -> None:
    """Each facet of an icosahedron has a number: its own and its neighbors' are spoiled where
    filament needs supports, and with resin its own."""
    hull = icosahedron(10.0)
    labels = tuple(str(n) for n in range(1, 21))
    solid = PrintedSolid(hull.vertices, hull.triangles, hull, labels, hull.normals)
    for limit, count in ((45.0, 4), (19.0, 1), (0.0, 1)):
        for n, pose in enumerate(solid.poses(hull.normals, printer_with(limit))):
            assert pose.label == labels[n]
            assert len(pose.spoiled) == count
            assert pose.label in pose.spoiled


def test_dice_stand_on_their_large_rests() -> None:
    """Tall prisms and slabs on wide sides, a round die on any."""
    prism = np.array([(x, y, z) for x in (0, 4) for y in (0, 4) for z in (0, 30)], dtype=float)
    assert sorted(np.abs(beds(rest_poses(prism))[:, 2]).round(9).tolist()) == [0.0] * 4
    slab = beds(rest_poses(prism * (1.0, 0.05, 1.0)))
    assert np.abs(slab @ (0.0, 1.0, 0.0)).min() == pytest.approx(1.0)
    points = np.random.default_rng(2).normal(size=(400, 3))
    ball = rest_poses(points / np.linalg.norm(points, axis=1, keepdims=True))
    np.testing.assert_array_equal(beds(ball), ball.normals)
