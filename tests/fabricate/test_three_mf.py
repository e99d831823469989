"""3MF files, read by lib3mf, the consortium's own library, and by trimesh."""

from __future__ import annotations

import io
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh

from dicedesign.fabricate.file_formats import BODY_COLOR, FILE_FORMATS, LABEL_COLOR, joined
from dicedesign.geometry.solid import solid_properties

THREE_MF = FILE_FORMATS["3mf"]


def read(data: bytes, path: Path):
    """The model of a file that has nothing to warn of."""
    path.write_bytes(data)
    model = lib3mf.Wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    return model


def objects(model) -> list:
    found, step = [], model.GetMeshObjects()
    while step.MoveNext():
        found.append(step.GetCurrentMeshObject())
    return found


def facts(model) -> dict[str, str]:
    group = model.GetMetaDataGroup()
    entries = [group.GetMetaData(k) for k in range(group.GetMetaDataCount())]
    return {entry.GetName(): entry.GetValue() for entry in entries}


def materials(model) -> dict[tuple[int, int], tuple[str, str]]:
    """Name and colour by the numbers of list and entry."""
    found, step = {}, model.GetBaseMaterialGroups()
    while step.MoveNext():
        group = step.GetCurrentBaseMaterialGroup()
        for entry in group.GetAllPropertyIDs():
            color = group.GetDisplayColor(entry)
            shown = f"#{color.Red:02x}{color.Green:02x}{color.Blue:02x}"
            found[group.GetResourceID(), entry] = group.GetName(entry), shown
    return found


def test_names_units_and_facts_are_read(contents, tmp_path: Path) -> None:
    model = read(THREE_MF.write(contents), tmp_path / "box.3mf")
    assert facts(model) == {"Title": "box & co", **contents.facts}
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    (thing,) = objects(model)
    assert thing.GetName() == "die"
    assert thing.IsManifoldAndOriented()


def test_labels_have_a_colour_of_their_own(contents, tmp_path: Path) -> None:
    model = read(THREE_MF.write(contents), tmp_path / "box.3mf")
    (thing,), known, (part,) = objects(model), materials(model), contents.parts
    assert sorted(known.values()) == [("die", BODY_COLOR), ("labels", LABEL_COLOR)]
    vertices = np.array([vertex.Coordinates for vertex in thing.GetVertices()])
    middles = {True: [], False: []}
    for triangle, paint in zip(
        thing.GetTriangleIndices(), thing.GetAllTriangleProperties(), strict=True
    ):
        colors = {known[paint.ResourceID, entry] for entry in paint.PropertyIDs}
        assert len(colors) == 1
        name, _ = colors.pop()
        middles[name == "labels"].append(vertices[list(triangle.Indices)].mean(axis=0))
    expected = part.points[part.triangles].mean(axis=1)
    for are_labels, places in middles.items():
        np.testing.assert_allclose(places, expected[part.labels == are_labels], atol=1e-5)


def test_parts_are_one_thing_to_print(inlaid, tmp_path: Path) -> None:
    data = THREE_MF.write(inlaid)
    model = read(data, tmp_path / "inlaid.3mf")
    assert [thing.GetName() for thing in objects(model)] == ["die", "inlay"]
    assert sorted(materials(model).values()) == [("die", BODY_COLOR), ("inlay", LABEL_COLOR)]
    items = model.GetBuildItems()
    assert items.MoveNext()
    assert items.GetCurrent().GetObjectResource().GetName() == "inlaid"
    assert not items.MoveNext()

    scene = trimesh.load(io.BytesIO(data), file_type="3mf", force="scene")
    assert scene.units == "millimeter"
    volumes = sorted(mesh.volume for mesh in scene.dump())
    assert volumes == pytest.approx([64.0, 936.0])
    points, triangles = THREE_MF.read_back(tmp_path / "inlaid.3mf")
    expected, _ = joined(inlaid.parts)
    np.testing.assert_array_equal(np.unique(points, axis=0), np.unique(expected, axis=0))
    volume, center = solid_properties(points, triangles)
    assert volume == pytest.approx(1000.0)
    np.testing.assert_allclose(center, 0.0, atol=1e-12)
