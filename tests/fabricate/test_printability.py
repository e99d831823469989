"""Printability of dice with known measures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from common.made_up_die import SIDES, box, run_to_check
from scipy.spatial import cKDTree

from dicedesign.errors import InputError
from dicedesign.fabricate.printability import check_file
from dicedesign.fabricate.printers import MATERIALS, PrintErrors, PrintOptions
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.parts import Printability
from tests.reference.solids import PLATONIC

RECIPE = {"name": "d4", "target": {"fair": 4}}


def test_options_are_checked_with_their_printer_and_abbreviated_in_recipes() -> None:
    for entries, named in (
        ({"printer": "cnc"}, "printer: expected fdm, sla, sls, got 'cnc'"),
        ({"printer": "sla", "nozzle_mm": 0.2}, "expected a printer with a nozzle"),
        ({"material": "pa12"}, "expected pla, petg, abs, asa, pc for fdm, got 'pa12"),
        ({"infill": 1.5}, "infill"),
    ):
        with pytest.raises(InputError, match=named):
            PrintOptions(**entries)
    assert PrintOptions(material="abs").density == MATERIALS["abs"].density_g_cm3
    assert PrintOptions(material="abs", density_g_cm3=1.5).density == 1.5
    assert parse_recipe(RECIPE).print == PrintOptions()
    assert parse_recipe({**RECIPE, "print": "sla"}).print == PrintOptions(printer="sla")
    options: dict[str, Any] = {"printer": "sls", "oriented": True, "infill": 0.2, "walls_mm": 0.8}
    given = parse_recipe({**RECIPE, "print": {**options, "errors": {"dimensional_mm": 0.05}}})
    assert given.print == PrintOptions(**options, errors=PrintErrors(dimensional_mm=0.05))
    without = parse_recipe({**RECIPE, "print": False})
    assert without.print is None
    for recipe in (given, without):
        assert parse_recipe(recipe.as_dict()) == recipe


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
    floors = [d.min(axis=1) > deep - 1e-4 for d in depths]
    skin = ~np.any(inside, axis=0)

    def sampled(chosen: np.ndarray) -> np.ndarray:
        part = mesh.submesh([np.flatnonzero(chosen)], append=True)
        return trimesh.sample.sample_surface(part, 20000, seed=1)[0]

    for n, label in enumerate(measures_of(work).labels[:1]):
        beneath = skin & (mesh.face_normals @ frames[n][:3, 2] < -0.01)
        others = sampled(np.any(inside[:n] + inside[n + 1 :], axis=0))
        distances = [cKDTree(others).query(sampled(inside[n]))[0].min()]
        if beneath.any():
            floor = sampled(inside[n] & floors[n])
            distances.append(cKDTree(sampled(beneath)).query(floor)[0].min())
        assert min(distances) - 0.1 < label.wall_mm < min(distances) + 1e-6


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
    assert measured.smallest_facet is not None
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
    assert any(part in note and ":" in note for note in work.notes)
    assert tuple(work.notes[-len(measures_of(work).warnings) :]) == measures_of(work).warnings
    is_raised = entries.get("engrave", {}).get("style") == "raised"
    assert all((label.wall_mm is None) == is_raised for label in measures_of(work).labels)


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
