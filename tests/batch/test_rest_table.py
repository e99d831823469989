"""Table of a folder, as CSV and Parquet, against the rests of each file."""

from __future__ import annotations

import csv
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
import trimesh
from pyarrow import parquet
from reference.roller import come_to_rest
from scipy.spatial.transform import Rotation

from dicedesign.batch import rest_table
from dicedesign.batch.batch import analyze_files, list_folder
from dicedesign.batch.rest_rows import GivenMass, RestOptions
from dicedesign.batch.rest_table import (
    COLUMNS,
    STAMPED,
    Entry,
    RestTable,
    Stamp,
    broken_entry,
    make_stamp,
    table_format,
)
from dicedesign.errors import InputError, OutputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.robots import bodies
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.checkpoint import INTERVAL

FILES = ["a.stl", "b.xyz", "b/box.obj", "b/hull.PLY", "c.off", "open, as it is.obj"]

TYPES: dict[str, Any] = {"text": str, "whole": int, "real": float}


def analyze(folder: Path) -> dict[str, Entry]:
    stamps = {file: Stamp(*state) for file, state in list_folder(folder).meshes.items()}
    return analyze_files(str(folder), stamps, RestOptions())


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Rows of any format, with None for missing numbers."""
    if path.suffix == ".parquet":
        return parquet.read_table(path).to_pylist()
    if path.suffix == ".json":
        return json.loads(path.read_text())
    with path.open(newline="") as file:
        return [
            {
                name: TYPES[COLUMNS[name]](text) if text or COLUMNS[name] == "text" else None
                for name, text in row.items()
            }
            for row in csv.DictReader(file)
        ]


def test_which_files_are_meshes(meshes: Path) -> None:
    listing = list_folder(meshes)
    assert list(listing.meshes) == FILES
    assert listing.others == 1
    status = (meshes / "a.stl").stat()
    assert listing.meshes["a.stl"] == (status.st_size, status.st_mtime_ns)


def test_rows_are_the_rests_of_each_file(meshes: Path, tmp_path: Path) -> None:
    entries = analyze(meshes)
    for name in ("t.csv", "t.parquet", "t.json"):
        RestTable(tmp_path / name, entries)
        assert RestTable.read(tmp_path / name) == entries
    rows = rows_of(tmp_path / "t.csv")
    assert rows == rows_of(tmp_path / "t.parquet") == rows_of(tmp_path / "t.json")
    assert list(rows[0]) == list(COLUMNS)
    assert list(dict.fromkeys(row["file"] for row in rows)) == FILES
    for file in FILES:
        poses = rest_poses(read_body(meshes / file))
        own = [row for row in rows if row["file"] == file]
        count = len(poses.normals)
        for name, expected in (
            ("rest", np.arange(1, count + 1)),
            ("probability", poses.probabilities),
            ("normal_x", poses.normals[:, 0]),
            ("normal_y", poses.normals[:, 1]),
            ("normal_z", poses.normals[:, 2]),
            ("area", poses.areas),
            ("margin_deg", np.degrees(poses.margins)),
        ):
            assert [row[name] for row in own] == expected.tolist(), name
        for row in own:
            center = [row[f"center_of_mass_{axis}"] for axis in "xyz"]
            assert center == poses.center_of_mass.tolist()
            assert (row["rests"], row["center_of_mass_source"], row["hull_vertices"]) == (
                count,
                poses.center_of_mass_source,
                len(poses.hull.vertices),
            )
            assert (row["notes"], row["error"]) == (" | ".join(poses.notes), "")
            assert 0.0 < row["seconds"] < 60.0
    assert any(row["notes"] for row in rows)
    types = {"text": pyarrow.string(), "whole": pyarrow.int64(), "real": pyarrow.float64()}
    expected = pyarrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    assert parquet.read_schema(tmp_path / "t.parquet").remove_metadata() == expected


def test_center_and_tolerance_are_used(meshes: Path) -> None:
    entries = analyze_files(str(meshes), {"a.stl": Stamp(1, 1)}, RestOptions((0.1, 0.2, 0.3), 1e-3))
    (values, *_) = csv.reader(entries["a.stl"].text.splitlines())
    row = dict(zip(COLUMNS, values, strict=True))
    expected = rest_poses(read_body(meshes / "a.stl"), (0.1, 0.2, 0.3), coplanar_tolerance=1e-3)
    assert float(row["probability"]) == expected.probabilities[0]
    assert row["center_of_mass_source"] == "given"


def one_table(folder: Path, options: RestOptions, files: list[str]) -> list[dict[str, Any]]:
    stamps = {file: make_stamp(file, (1, 1), options) for file in files}
    RestTable(folder / "one.json", analyze_files(str(folder), stamps, options))
    assert len(RestTable.read(folder / "one.json")) == len(files)
    return rows_of(folder / "one.json")


def test_transforms_and_all_facets(meshes: Path) -> None:
    """The motion stands the body on the facet; unstable ones lead to a rest."""
    rows = one_table(meshes, RestOptions(all_facets=True), FILES)
    for file in FILES:
        poses, own = rest_poses(read_body(meshes / file)), [r for r in rows if r["file"] == file]
        assert [row["facet"] for row in own[: len(poses.facets)]] == poses.facets.tolist()
        assert sorted(row["facet"] for row in own) == list(range(len(poses.hull.normals)))
        for row in own:
            turn = Rotation.from_quat([row[f"q{x}"] for x in "xyzw"])
            shift = [row[x] for x in "xyz"]
            polygon = turn.apply(poses.hull.polygon(row["facet"])) + shift
            np.testing.assert_allclose(polygon[:, 2], 0.0, atol=1e-9)
            assert (turn.apply(poses.hull.vertices) + shift)[:, 2].min() > -1e-9
            center = turn.apply(poses.center_of_mass) + shift
            np.testing.assert_allclose(center, [0.0, 0.0, row["height"]], atol=1e-12)
            # The foot is at the origin.
            corners, ends = polygon[:, :2], np.roll(polygon[:, :2], -1, axis=0)
            edges = ends - corners
            sides = (edges[:, 0] * corners[:, 1] - edges[:, 1] * corners[:, 0]) / np.hypot(*edges.T)
            assert row["depth"] == pytest.approx(sides.min(), abs=1e-9)
            assert (row["depth"] > 0.0) == (row["rest"] is not None)
            assert (row["probability"] > 0.0) == (row["rest"] is not None)
            down = np.array([row[f"normal_{x}"] for x in "xyz"])
            last = come_to_rest(poses.hull.vertices - poses.center_of_mass, down)
            rest = own[row["rolls_to"] - 1]
            np.testing.assert_allclose(last, [rest[f"normal_{x}"] for x in "xyz"], atol=1e-6)
    assert any(row["rest"] is None for row in rows)


def test_facets_that_rounding_bent_roll_to_a_rest(meshes: Path) -> None:
    leaning = trimesh.creation.box((1.0, 1.2, 3.0))
    leaning.vertices += leaning.vertices[:, 2:] * [0.7, 0.3, 0.0]
    leaning.vertices @= Rotation.random(random_state=1).as_matrix()
    leaning.export(meshes / "a.stl")
    body = read_body(meshes / "a.stl")
    assert rest_poses(body).hull.finer is not None
    rows = one_table(meshes, RestOptions(all_facets=True), ["a.stl"])
    assert len(rows) == 6 > rows[0]["rests"]
    normals = np.array([[row[f"normal_{x}"] for x in "xyz"] for row in rows])
    for row, normal in zip(rows, normals, strict=True):
        last = come_to_rest(body.points - rest_poses(body).center_of_mass, normal)
        assert row["rolls_to"] == 1 + np.argmax(normals @ last)


def test_volume_mass_and_inertia(meshes: Path) -> None:
    """Against the formulas of a box and trimesh; a file's own center and density count first."""
    masses = {"b/box.obj": GivenMass((0.1, 0.2, 0.3), 7.8), "c.off": GivenMass(None, 2.0)}
    options = RestOptions("hull", density=1.25, masses=masses)
    firsts = {row["file"]: row for row in one_table(meshes, options, FILES)}
    row = firsts["b/box.obj"]
    assert [row[f"center_of_mass_{x}"] for x in "xyz"] == [0.1, 0.2, 0.3]
    squares, mass = np.array([3.0, 4.0, 4.5]) ** 2, 7.8e-3 * 54.0
    assert (row["volume_mm3"], row["mass_g"]) == (pytest.approx(54.0), pytest.approx(mass))
    inertia = sorted(mass * (squares.sum() - squares) / 12.0)
    np.testing.assert_allclose([row[f"inertia_{k}_g_mm2"] for k in (1, 2, 3)], inertia)
    assert firsts["c.off"]["mass_g"] == pytest.approx(2e-3)
    row, mesh = firsts["b/hull.PLY"], trimesh.load(meshes / "b" / "hull.PLY")
    mesh.density = 1.25e-3
    assert row["mass_g"] == pytest.approx(mesh.mass)
    axes = Rotation.from_quat([row[f"inertia_q{x}"] for x in "xyzw"]).as_matrix()
    tensor = (axes * [row[f"inertia_{k}_g_mm2"] for k in (1, 2, 3)]) @ axes.T
    np.testing.assert_allclose(tensor, mesh.moment_inertia, rtol=1e-5, atol=1e-9)
    (row, *_) = one_table(meshes, RestOptions(), ["a.stl"])
    assert row["volume_mm3"] == pytest.approx(6.0)
    assert (row["mass_g"], row["inertia_1_g_mm2"], row["unit"]) == (None, None, "mm")


BOX = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'

WEIGHED = '<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.025"/></inertial>'


def test_masses_of_links_in_meters(tmp_path: Path) -> None:
    """The density is for links without a mass of their own, and for hulls in their place."""
    links = f'<link name="plain">{BOX}</link><link name="weighed">{WEIGHED}{BOX}</link>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}</robot>')
    for center, weighed, first in ((None, 2000.0, 1e7), ("hull", 7500.0, 7500.0 * 5e4 / 12.0)):
        rows = one_table(tmp_path, RestOptions(center, density=1.25), ["r.urdf"])
        masses = {row["body"]: row["mass_g"] for row in rows}
        assert masses == pytest.approx({"plain": 7500.0, "weighed": weighed})
        smallest = {row["body"]: row["inertia_1_g_mm2"] for row in rows}
        assert smallest == pytest.approx({"plain": 7500.0 * 5e4 / 12.0, "weighed": first})
        np.testing.assert_allclose([row["volume_mm3"] for row in rows], 6e6)


@pytest.mark.parametrize("ending", ["csv", "parquet", "json"])
def test_broken_files_and_odd_names_have_rows(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    box = (meshes / "b" / "box.obj").read_bytes()
    for name, content in (
        ("empty.obj", b""),
        ('wrong, and\n"quoted"\r.obj', b"v 1\n"),
        ("noise.glb", bytes(range(256))),
        ("größe.obj", box),
        (os.fsdecode(b"caf\xe9.obj"), box),
        ("ours.obj", box),
    ):
        (meshes / name).write_bytes(content)
    (meshes / "far.stl").symlink_to(meshes / "gone.stl")

    def read(path: Path, *_: object, **__: object) -> Body:
        return read_body(path) if path.name != "ours.obj" else 1 // 0

    monkeypatch.setattr(bodies, "read_body", read)
    entries = analyze(meshes)
    path = tmp_path / f"t.{ending}"
    RestTable(path, entries)
    # A name with bytes that are not UTF-8 is read back as an escape.
    entries[r"caf\udce9.obj"] = entries.pop(os.fsdecode(b"caf\xe9.obj"))
    assert RestTable.read(path) == entries
    assert len(entries) == 13
    rows = rows_of(path)
    assert {r"caf\udce9.obj", "größe.obj"} < {row["file"] for row in rows}
    broken = {row["file"]: row for row in rows if row["error"]}
    for file, message in (
        ("empty.obj", "expected a mesh or point file, got an empty one"),
        ('wrong, and\n"quoted"\r.obj', "line 1: expected three coordinates"),
        ("noise.glb", "expected a .glb file, got one that cannot be read"),
        ("far.stl", "far.stl: no such file"),
        ("ours.obj", "ZeroDivisionError"),
    ):
        row = broken.pop(file)
        assert message in row["error"]
        assert str(meshes) not in row["error"]
        assert "\n" not in row["error"]
        assert row["rests"] == 0
        table = (*STAMPED, "file", "rests", "seconds", "error")
        assert {value for name, value in row.items() if name not in table} <= {"", None}
    assert broken == {}


def test_files_with_missing_rows_are_skipped(meshes: Path, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    RestTable(path, analyze(meshes))
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith("c.off,,2,")))
    assert sorted(RestTable.read(path)) == [file for file in FILES if file != "c.off"]
    assert RestTable.read(tmp_path / "missing.csv") == {}


HEADER = ",".join(COLUMNS).encode() + b"\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("t.csv", b"", "its columns are others"),
        ("t.csv", b"file,error\na.stl,\n", "its columns are others"),
        ("t.csv", HEADER + b"a.stl,1\n", f"line 2 has 2 columns of {len(COLUMNS)}"),
        ("t.csv", HEADER + b"x," * (len(COLUMNS) - 1) + b"x\n", "invalid literal"),
        ("t.json", b"[{}]", "its columns are others"),
        ("t.json", b"{}", "it is no list of rows"),
        ("t.json", 100_000 * b"[", "too deep"),
        ("t.parquet", b"something else\n", "it is no Parquet file that can be read"),
        ("t.parquet", None, "its columns are others"),
    ],
)
def test_other_files_are_refused(
    tmp_path: Path, name: str, content: bytes | None, message: str
) -> None:
    path = tmp_path / name
    if content is None:
        parquet.write_table(pyarrow.table({name: ["1"] for name in COLUMNS}), path)
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=f"expected a table of an earlier run .*{message}.*--out"):
        RestTable.read(path)


def test_a_file_that_stands_for_too_many_rows_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, entry = tmp_path / "t.parquet", broken_entry("a.stl", Stamp(1, 1), "x" * 5000)
    with RestTable(path, {"a.stl": entry}):
        pass
    assert RestTable.read(path) == {"a.stl": entry}
    for limit, value in (("MAX_ROWS", 0), ("MAX_CELL_BYTES", 4999)):
        with monkeypatch.context() as patched:
            patched.setattr(rest_table, limit, value)
            with pytest.raises(InputError, match="more than"):
                RestTable.read(path)


@pytest.mark.parametrize("ending", ["csv", "json", "parquet"])
def test_texts_are_no_formulas_of_a_spreadsheet(tmp_path: Path, ending: str) -> None:
    path, stamp = tmp_path / f"t.{ending}", Stamp(1, 1, com="-1.0,0.0,0.0")
    names = ["=1+1.stl", "+a.stl", "-b.stl", "@c.stl", "\t=d.stl", "'=e.stl", "'f.stl", "-1"]
    entries = {name: broken_entry(name, stamp, "=x") for name in names}
    with RestTable(path, entries):
        pass
    assert RestTable.read(path) == entries
    if ending == "csv":
        with path.open(newline="") as file:
            cells = [cell for row in csv.reader(file) for cell in row]
        assert {cell for cell in cells if cell[:1] in set("=+-@\t\r")} == {"-1"}
    if ending == "json":
        assert sorted({row["file"] for row in json.loads(path.read_text())}) == sorted(names)
    if ending == "parquet":
        assert sorted(parquet.read_table(path)["file"].to_pylist()) == sorted(names)


def test_the_table_is_saved_at_the_start_at_intervals_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, now = tmp_path / "t.csv", [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    entries = [{f"{i}.stl": broken_entry(f"{i}.stl", Stamp(1, 1), "x")} for i in range(4)]
    with RestTable(path, {}) as table:
        assert path.read_text() == ",".join(COLUMNS) + "\n"
        table.add(entries[2])
        assert len(RestTable.read(path)) == 0
        now[0] += INTERVAL
        table.add(entries[1])
        assert len(RestTable.read(path)) == 2
        table.add(entries[0])
        assert len(RestTable.read(path)) == 2
    assert len(RestTable.read(path)) == 3

    def interrupt() -> None:
        with RestTable(path, table.entries) as again:
            again.add(entries[3])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert list(RestTable.read(path)) == [f"{i}.stl" for i in range(4)]
    assert [file.name for file in tmp_path.iterdir()] == ["t.csv"]


def test_failed_writes_are_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(OutputError, match="expected to write a file in an existing"):
        RestTable(tmp_path / "missing" / "t.csv", {})
    # Another run with the same table.
    path = tmp_path / "t.csv"
    entries = [{f"{i}.stl": broken_entry(f"{i}.stl", Stamp(1, 1), "x")} for i in range(2)]
    one = RestTable(path, {})
    one.add(entries[0])
    with RestTable(path, RestTable.read(path)) as other:
        with pytest.raises(OutputError, match=r"t.csv: expected a table that only this run writes"):
            one.save()
        other.add(entries[1])
    assert RestTable.read(path) == entries[1]
    path.unlink()
    one.save()
    assert RestTable.read(path) == entries[0]
    # Parquet without pyarrow.
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"--out .*extra 'parquet'.*'dicedesign\[parquet\]'"):
        table_format(tmp_path / "t.parquet")
