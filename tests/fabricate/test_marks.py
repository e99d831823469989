from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh

from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.marks import engrave_marks, relief
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.triangles import Surface

OPTIONS = EngravingOptions()
DOWNS = np.array([(0, 0, -1), (0, 0, 1), (1, 0, 0), (-0.3, -1, 0.2)], dtype=float)


def sphere(diameter: float):
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.5 * diameter)
    return Surface(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))


def ellipsoid(x: float, y: float, z: float):
    unit = sphere(1.0)
    return unit.with_points(unit.points * (x, y, z))


def torus(outer: float, tube: float):
    mesh = trimesh.creation.torus(0.5 * outer - 0.5 * tube, 0.5 * tube, 96, 40)
    return Surface(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))


def test_marks_of_a_ring_are_visible_and_have_the_given_depth():
    body = torus(45.0, 15.0)
    die, marks = engrave_marks(body, DOWNS, list("1269"), OPTIONS)
    ring = solid(body)
    for mark, down in zip(marks, DOWNS, strict=True):
        up = -down / np.linalg.norm(down)
        assert mark.frame[:3, 2] == pytest.approx(up, abs=1e-12)
        assert mark.frame[:3, :3].T @ mark.frame[:3, :3] == pytest.approx(np.eye(3), abs=1e-12)
        start = mark.frame[:3, 3] + 1e-3 * mark.frame[:3, 2]
        assert not ring.ray_cast(start, start + 100.0 * mark.frame[:3, 2])
    expected = sum(mark.art.section.area() * mark.height**2 * OPTIONS.depth_mm for mark in marks)
    assert body.volume - die.volume == pytest.approx(expected, rel=1e-4)
    mesh = trimesh.load(io.BytesIO(stl_bytes(die)), file_type="stl")
    assert mesh.is_watertight
    assert (mesh.body_count, mesh.euler_number) == (1, 0)


def test_an_l_is_cut_straight_down_by_the_depth_upright_and_not_mirrored():
    body = ellipsoid(40.0, 25.0, 16.0)
    die, (mark,) = engrave_marks(body, DOWNS[:1], ["L"], OPTIONS)
    to_mark = np.linalg.inv(mark.frame)
    cut = relief(solid(die).transform(to_mark[:3]))
    plain = relief(solid(body).transform(to_mark[:3]))
    inside = np.argwhere(np.isfinite(plain.height))
    fall = plain.height[tuple(inside.T)] - cut.height[tuple(inside.T)]
    is_cut = fall > 0.5 * OPTIONS.depth_mm
    assert fall[is_cut] == pytest.approx(OPTIONS.depth_mm, abs=1e-9)
    assert fall[~is_cut] == pytest.approx(0.0, abs=1e-9)
    x, y = (cut.corner + cut.spacing * inside[is_cut]).T
    # The stem is on the left and the foot below: its right half is only at the bottom.
    assert np.ptp(y) > np.ptp(x)
    assert y[x > x.mean() + 0.25 * np.ptp(x)].max() < y.mean()
    assert y[x < x.min() + 0.2 * np.ptp(x)].max() == y.max()


def test_pips_with_wide_strokes_are_cut_as_on_flat_faces():
    options = EngravingOptions(content="pips", stroke_mm=2.0)
    body = ellipsoid(40.0, 38.0, 36.0)
    die, marks = engrave_marks(body, DOWNS[:2], ["5", "9"], options)
    assert [len(mark.art.section.decompose()) for mark in marks] == [5, 9]
    assert marks[1].growth > 0.0
    expected = sum(mark.section().area() for mark in marks)
    removed = solid(body).volume() - solid(die).volume()
    assert removed == pytest.approx(expected * options.depth_mm, rel=1e-4)


def test_marks_are_on_the_visible_surface():
    # A lid over one half of a block: there is room on top of the lid and on the uncovered half.
    block = trimesh.creation.box((30, 30, 10))
    post = trimesh.creation.box((4, 30, 20), trimesh.transformations.translation_matrix((13, 0, 5)))
    lid = trimesh.creation.box((18, 30, 4), trimesh.transformations.translation_matrix((6, 0, 13)))
    pieces = [solid(Surface(m.vertices, m.faces)) for m in (block, post, lid)]
    whole = mesh_of(pieces[0] + pieces[1] + pieces[2])
    _, marks = engrave_marks(whole, np.tile(DOWNS[:1], (3, 1)), list("123"), OPTIONS)
    for mark in marks:
        x, _, z = mark.frame[:3, 3]
        assert z == pytest.approx(15.0 if x > -3.0 else 5.0)
    # Marks of one direction lie beside each other.
    places = np.array([mark.frame[:3, 3] for mark in marks])
    apart = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(3, 1)]
    assert apart.min() > max(mark.height for mark in marks)


def test_a_small_body_is_refused_with_a_sufficient_size():
    body = torus(12.0, 4.0)
    with pytest.raises(LabelRoomError, match=r"label '16': .* min_height_mm = 2.5, got") as caught:
        engrave_marks(body, DOWNS[2:], ["7", "16"], OPTIONS)
    assert f"use size_mm = {caught.value.size_mm:.1f} or more" in str(caught.value)
    grown = body.with_points(body.points * caught.value.size_mm / 12.0)
    _, marks = engrave_marks(grown, DOWNS[2:], ["7", "16"], OPTIONS)
    assert len(marks) == 2


def test_a_sheet_too_thin_to_cut_is_refused():
    with pytest.raises(EngravingError, match=r"mark '1': .* solid to 1.2 mm, got none"):
        engrave_marks(ellipsoid(20.0, 20.0, 1.0), DOWNS[:1], ["1"], OPTIONS)
