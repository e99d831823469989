"""3MF as slicers write it: each build item in millimeters, without what prints nothing."""

from __future__ import annotations

import csv
import json
import zipfile
from pathlib import Path

import lib3mf
import numpy as np
import pytest
from common.paths import public_data

from dicedesign.cli.main import main
from dicedesign.errors import MeshFileError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.robots.bodies import list_bodies
from dicedesign.geometry.triangles import is_closed, solid_properties

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONS = "http://schemas.openxmlformats.org/package/2006"
FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
ROOT = "3D/3dmodel.model"


def mesh(*sizes: float) -> str:
    """Mesh of a corner of a box of each size, a tetrahedron."""
    vertices = triangles = ""
    for k, size in enumerate(sizes):
        for corner in ((0, 0, 0), (size, 0, 0), (0, 2 * size, 0), (0, 0, 3 * size)):
            vertices += '<vertex x="{!r}" y="{!r}" z="{!r}"/>'.format(*corner)
        for face in FACES:
            triangles += '<triangle v1="{}" v2="{}" v3="{}"/>'.format(*(4 * k + i for i in face))
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def components(*parts: str) -> str:
    return f"<components>{''.join(f'<component {part}/>' for part in parts)}</components>"


def model(objects: dict[str, str], *items: str, given: str = "") -> str:
    """Model of objects, by their attributes, and build items."""
    resources = "".join(f"<object {name}>{content}</object>" for name, content in objects.items())
    build = "".join(f"<item {item}/>" for item in items)
    return (
        f'<model xmlns="{CORE}" xmlns:p="{PRODUCTION}" {given}><resources>{resources}</resources>'
        f"<build>{build}</build></model>"
    )


def write(folder: Path, root: str, **others: str) -> Path:
    """Write an archive of parts, with the endings and relations that lib3mf asks for."""
    path = folder / "parts.3mf"
    kind = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
    related = "".join(
        f'<Relationship Target="/{name}" Id="r{k}" Type="{kind}"/>'
        for k, name in enumerate(others)
        if name.endswith("model")
    )
    relations = f'<Relationships xmlns="{RELATIONS}/relationships">%s</Relationships>'
    first = f'<Relationship Target="/{ROOT}" Id="r" Type="{kind}"/>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in {
            "[Content_Types].xml": f'<Types xmlns="{RELATIONS}/content-types">'
            '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.'
            'relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-'
            'package.3dmanufacturing-3dmodel+xml"/></Types>',
            "_rels/.rels": relations % first,
            "3D/_rels/3dmodel.model.rels": relations % related,
            ROOT: root,
            **others,
        }.items():
            archive.writestr(name, text)
    return path


def volume(path: Path) -> float:
    body = read_body(path)
    assert body.triangles is not None
    assert is_closed(body.triangles)
    return solid_properties(body.points, body.triangles)[0]


@pytest.mark.parametrize(
    ("name", "reference", "note"),
    [
        ("02_production_same_ids", "02_reference", "joined 2 parts"),
        ("02b_bambu_two_parts_one_file", "02_reference", "joined 2 parts"),
        ("03_production_item_path", "03_reference", ""),
        ("04_support_object", "03_reference", "left out 1 support object"),
        ("05_prusa_modifier", "03_reference", "left out 1 modifier"),
    ],
)
def test_cases_are_their_references(name: str, reference: str, note: str) -> None:
    body = read_body(public_data(f"cases/{name}.3mf"))
    expected = read_body(public_data(f"cases/{reference}.stl"))
    np.testing.assert_array_equal(
        np.unique(body.points, axis=0), np.unique(expected.points, axis=0)
    )
    assert len(body.triangles) == len(expected.triangles)
    assert any(note in each for each in body.notes) or not note


def test_transforms_compose_as_in_lib3mf(tmp_path: Path) -> None:
    """Nested components, also of other files with the same numbers, one of them mirrored."""
    turn, mirror = "0 1 0 -1 0 0 0 0 1 5 6 7", "-2 0 0 0 1 0 0 0 1 1 2 3"
    uuid = [f'p:UUID="{k:08}-0000-4000-8000-000000000000"' for k in range(10)]
    root = model(
        {
            f'id="1" {uuid[0]}': mesh(1.25),
            f'id="2" {uuid[1]}': components(
                f'objectid="1" {uuid[2]} transform="{turn}"',
                f'objectid="2" p:path="/3D/other.model" {uuid[3]} transform="{mirror}"',
            ),
        },
        f'objectid="2" {uuid[4]} transform="{turn}"',
        given='unit="centimeter" requiredextensions="p"',
    )
    other = model(
        {
            f'id="1" {uuid[5]}': mesh(2.5),
            f'id="2" {uuid[6]}': components(
                f'objectid="1" {uuid[7]} transform="{mirror}"', f'objectid="1" {uuid[8]}'
            ),
        },
        given='unit="centimeter"',
    )
    root, other = (text.replace("<build>", f"<build {uuid[9]}>") for text in (root, other))
    path = write(tmp_path, root, **{"3D/other.model": other})
    body = read_body(path)
    peer = lib3mf.Wrapper().CreateModel()
    peer.QueryReader("3mf").ReadFromFile(str(path))
    low, high = peer.GetOutbox().MinCoordinate, peer.GetOutbox().MaxCoordinate
    np.testing.assert_allclose(body.points.min(axis=0), 10 * np.array(list(low)), rtol=1e-6)
    np.testing.assert_allclose(body.points.max(axis=0), 10 * np.array(list(high)), rtol=1e-6)
    # Each part has 1/6 of its box, and a mirror doubles it.
    assert volume(path) == pytest.approx(1000 * (1.25**3 + 2.5**3 * (4 + 2)))
    assert "joined 3 parts of the file" in body.notes


def test_lengths_are_in_millimeters(tmp_path: Path) -> None:
    lengths = {"micron": 1e-3, "millimeter": 1, "centimeter": 10, "inch": 25.4, "foot": 304.8}
    for unit, length in {**lengths, "meter": 1000}.items():
        given = f'unit="{unit}"'
        path = write(tmp_path, model({'id="1"': mesh(0.5)}, 'objectid="1"', given=given))
        assert volume(path) == pytest.approx((0.5 * length) ** 3)
    path = write(tmp_path, model({'id="1"': mesh(0.1)}, 'objectid="1"'))
    assert read_body(path).points.max() == 3 * 0.1  # no digit is lost


@pytest.mark.parametrize(
    ("prusa", "bambu", "word"),
    [
        ("ModelPart", "normal_part", ""),
        ("ParameterModifier", "modifier_part", "modifier"),
        ("NegativeVolume", "negative_part", "negative volume"),
        ("SupportBlocker", "support_blocker", "support blocker"),
        ("SupportEnforcer", "support_enforcer", "support enforcer"),
    ],
)
def test_volumes_that_print_nothing_are_left_out(
    tmp_path: Path, prusa: str, bambu: str, word: str
) -> None:
    ranges = (
        '<config><object id="1"><volume firstid="0" lastid="3"/><volume firstid="4" lastid="7">'
        f'<metadata key="volume_type" value="{prusa}"/></volume></object></config>'
    )
    root = model({'id="1"': mesh(1, 2)}, 'objectid="1"')
    by_range = write(tmp_path, root, **{"Metadata/Slic3r_PE_model.config": ranges})
    expected = 1 if word else 1 + 2**3
    assert volume(by_range) == pytest.approx(expected)
    assert any(f"left out 1 {word}" in note for note in read_body(by_range).notes) == bool(word)
    # Two parts of the same number, in two files.
    parts = (
        '<config><object id="3"><part id="1" subtype="normal_part"/>'
        f'<part id="1" subtype="{bambu}"/></object></config>'
    )
    refer = components('objectid="1"', 'objectid="1" p:path="/3D/other.model"')
    by_part = write(
        tmp_path,
        model({'id="1"': mesh(1), 'id="3"': refer}, 'objectid="3"'),
        **{
            "3D/other.model": model({'id="1"': mesh(2)}),
            "Metadata/model_settings.config": parts,
            "Metadata/Slic3r_PE_model.config": ranges,
        },
    )
    assert volume(by_part) == pytest.approx(expected)


def test_each_build_item_is_a_body(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    support = {f'id="{k}" type="{kind}"': mesh(9) for k, kind in enumerate(("support", "other"), 8)}
    objects = {'id="1" name="gear"': mesh(1), 'id="2"': mesh(2), **support}
    items = ['objectid="8"', 'objectid="1"', 'objectid="2" transform="1 0 0 0 1 0 0 0 1 9 0 0"']
    path = write(tmp_path, model(objects, *items))
    assert [body.read().points.max() for body in list_bodies(path)] == [3.0, 11.0]
    assert read_body(path, 2).points.max() == 11.0
    for item in (0, 3):
        with pytest.raises(MeshFileError, match=f"item from 1 to 2, got {item}"):
            read_body(path, item)
    assert main(["drop", str(path), "--down", "0,0,1"]) == 2
    assert "got 2 build items: 1 'gear', 2 'object 2'; choose" in capsys.readouterr().err
    assert main(["drop", str(path), "--down", "0,0,1", "--item", "2"]) == 0
    capsys.readouterr()
    assert main(["rest", str(path), "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    assert [each["body"] for each in results] == ["item 1", "item 2"]
    assert [each["center_of_mass"][0] for each in results] == [0.25, 9.5]
    table = tmp_path / "table.csv"
    for _ in range(2):
        assert main(["rest", str(tmp_path), "--out", str(table), "--jobs", "1"]) == 0
        with table.open() as file:
            names = {(row["file"], row["body"]) for row in csv.DictReader(file)}
        assert names == {("parts.3mf", "item 1"), ("parts.3mf", "item 2")}
    assert "1 files were already in" in capsys.readouterr().err


def chain(count: int, *, times: int = 1, first: str = mesh(1)) -> dict[str, str]:
    """Objects 0 to count, each of which holds the one before so many times."""
    inner = {f'id="{k}"': components(*[f'objectid="{k - 1}"'] * times) for k in range(1, count + 1)}
    return {'id="0"': first, **inner}


@pytest.mark.parametrize(
    ("root", "message"),
    [
        (model(chain(60, times=2), 'objectid="60"'), "at most 5000000 vertices, triangles and"),
        (model(chain(200), 'objectid="200"'), "at most 100 objects within one another"),
        (
            model(chain(2, first=components('objectid="2"')), 'objectid="1"'),
            "objects that do not contain themselves, got object '1'",
        ),
        (model({'id="1"': " " * (34 << 20)}), "at most 32 MiB of unpacked parts, got more"),
        ("<a>" * 200, "at most 100 elements within one another"),
        (f'<!DOCTYPE a [<!ENTITY b "c">]>{model({})}', "no document type"),
        (model({'id="1"': mesh(1)}, 'objectid="2"'), "an object '2' in 3d/3dmodel.model"),
        (model({'id="1"': mesh(1)}), "got none with triangles of type model"),
        (model({'id="1"': mesh(1)}, 'objectid="1" p:path="/no"'), "expected a part no"),
        (model({'id="1"': mesh(1)}, 'objectid="1"', given='unit="ell"'), "got ell"),
        (model({'id="1"': mesh(1).replace('"3"', '"4"')}, 'objectid="1"'), "vertices 0 to 3"),
        (model({'id="1"': mesh(1).replace('"1"', '"1,5"')}, 'objectid="1"'), '<vertex x="1,5"'),
        (
            model({}, given='xmlns:b="urn:beams" requiredextensions="p b"'),
            "required extensions that leave meshes as they are, got urn:beams",
        ),
        ("<model", "an archive of XML, got ExpatError"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, root: str, message: str) -> None:
    path = write(tmp_path, root)
    assert path.stat().st_size < 1 << 16
    with pytest.raises(MeshFileError) as caught:
        read_body(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: expected ")
    assert message in text
    assert text.isprintable()
