"""Every face flat and true to scale."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from dicedesign.errors import InputError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import place_labels
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.polygons import signed_area
from dicedesign.report.charts.palette import DARK
from dicedesign.report.figures.faces import Face, faces_figure, faces_of

BOX = np.array([(x, y, z) for x in (-9, 9) for y in (-6, 6) for z in (-4, 4)], dtype=float)


def labelled(texts: list[str], facets: list[int]):
    hull = convex_hull(BOX)
    placements = place_labels(
        texts,
        [hull.polygon(facet) for facet in facets],
        hull.normals[facets],
        facets,
        EngravingOptions(),
        hull.diameter,
    )
    return hull, placements


def test_faces_are_those_of_the_hull_with_the_areas_of_their_labels() -> None:
    hull, placements = labelled(["8", "16"], [3, 1])
    faces = faces_of(hull, placements, {3: "8: 50 %"})
    assert [face.title for face in faces] == ["8: 50 %", "", "", "", "", ""]
    areas = sorted(signed_area(face.outline) for face in faces)
    np.testing.assert_allclose(areas, sorted(hull.areas), rtol=1e-9)
    for face, placement in zip(faces, placements, strict=False):
        cut = sum(signed_area(contour) for contour in face.cuts)
        assert cut == pytest.approx(placement.section().area(), rel=1e-5)
        assert signed_area(face.outline) == pytest.approx(hull.areas[placement.facet])
        inside = np.concatenate(face.cuts)
        assert (inside >= face.outline.min(axis=0)).all()
        assert (inside <= face.outline.max(axis=0)).all()
    assert all(len(face.cuts) == 0 for face in faces[2:])


def test_labels_of_one_facet_share_its_picture() -> None:
    hull, placements = labelled(["1", "2"], [2, 2])
    (face, *others) = faces_of(hull, placements, {})
    assert len(others) == 5
    areas = sum(placement.section().area() for placement in placements)
    assert sum(map(signed_area, face.cuts)) == pytest.approx(areas, rel=1e-5)


def test_of_many_faces_only_those_with_labels_are_drawn() -> None:
    points = np.random.default_rng(0).normal(size=(60, 3))
    hull = convex_hull(40.0 * points / np.linalg.norm(points, axis=1, keepdims=True))
    facet = int(hull.areas.argmax())
    options = EngravingOptions(min_height_mm=0.1)
    placements = place_labels(
        ["1"], [hull.polygon(facet)], [hull.normals[facet]], [facet], options, hull.diameter
    )
    assert len(hull.normals) > 60
    (face,) = faces_of(hull, placements, {facet: "1"})
    assert face.title == "1"


def test_ink_is_true_to_scale() -> None:
    """Dark pixels against the area of a square hole in a square, beside a larger face."""
    small = 10.0 * np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    hole = small[::-1] * 0.5 + 2.5
    faces = [
        Face(2.0 * small, (), ""),
        Face(small * 1.5, (small, hole), "7"),
    ]
    figure = faces_figure(faces)
    assert figure.texts == ["7", "20 mm"]
    dark = np.array([int(DARK[k : k + 2], 16) for k in (1, 3, 5)])
    pixels = np.asarray(Image.open(io.BytesIO(figure.png())).convert("RGB")).astype(int)
    right = pixels[: figure.height - 60, figure.width // 2 :]
    found = (abs(right - dark).max(axis=2) < 60).sum()
    scale = 210.0 / 20.0  # pixels of the larger face
    letters = 60.0
    assert found == pytest.approx(75.0 * scale**2, rel=0.03, abs=letters)


def test_no_faces_are_refused() -> None:
    with pytest.raises(InputError, match="faces: expected at least one"):
        faces_figure([])
