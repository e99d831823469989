"""Files with counts of throws: of several dice, and of one die, throw by throw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.paths import public_data

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.roll_log import RollLog, read_counts
from dicedesign.throws.throw_counts import read_throw_counts

HEADER = "die,mesh,outcome,throws,geometric\n"


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return box_file(tmp_path)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Folder of a run: a box with three labels, and a facet without one."""
    normals = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    facets = zip(["x", "x", "y", "y", None, "z"], normals, strict=True)
    labels, center = ["x", "y", "z", "w"], [0.0, 0.0, 1.0]
    folder = finished_run(tmp_path / "run", labels, [0.25] * 4, facets, center=center)
    box_file(folder, (10.0, 12.0, 15.0), "die_plain.stl")
    return folder


def write_counts(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "throws.csv"
    path.write_text(text)
    return path


def test_the_published_dice() -> None:
    names = ["binomial2", "binomial3", "2d6_hendecahedron"]
    two, three, many = read_throw_counts(public_data("published/throws.csv"), names)
    # The middle outcome of the first die is a facet of two triangles, 0.7 degrees apart.
    assert two.labels == ("1", "0 or 2")
    assert two.counts.tolist() == [49, 51]
    assert two.group_of_rest.tolist() == [1, 1, 0, 0]
    assert three.labels == ("1 or 2", "0 or 3")
    assert three.counts.tolist() == [255, 74]
    assert many.labels == ("7", "6 or 8", "5 or 9", "4 or 10", "3 or 11", "2 or 12")
    assert many.counts.tolist() == [105, 189, 197, 100, 60, 13]
    wanted = np.array([6, 10, 8, 6, 4, 2]) / 36.0
    assert many.geometric == pytest.approx(wanted, abs=4e-3)
    assert many.by_outcome(np.arange(11)).tolist() == [0, 3, 7, 11, 15, 19]


def test_a_mesh(box: Path, tmp_path: Path) -> None:
    """Other columns, empty lines and blanks are ignored; sizes are in millimeters."""
    text = "note,die,mesh,outcome,throws,geometric,size_mm\n"
    probabilities = _probabilities(box)
    for i, name in enumerate("ABCDEF"):
        text += f"x, b ,{box.name},{name}, {i + 1} ,{probabilities[i]},16\n\n"
    (die,) = read_throw_counts(write_counts(tmp_path, text))
    assert die.labels == ("A or B", "C or D", "E or F")
    assert die.counts.tolist() == [3, 7, 11]
    assert die.size == 0.016
    assert die.geometric == pytest.approx(
        [probabilities[0] * 2, probabilities[2] * 2, probabilities[4] * 2]
    )


def _probabilities(box: Path) -> np.ndarray:
    """Probabilities of a box's sides without momentum."""
    return rest_poses(read_body(box)).probabilities


def test_sessions_and_materials(run: Path, tmp_path: Path) -> None:
    """Without the columns, each die has a session of its own, and all have one material."""
    text = "die,mesh,outcome,throws\nb,run,z,5\nb,run,x,7\nc,run,z,5\nc,run,x,7\n"
    first, second = read_throw_counts(write_counts(tmp_path, text))
    assert first.session_key != second.session_key
    assert (first.material, second.material) == ("", "")
    header, *rows = text.splitlines()
    text = "\n".join([header + ",session,material", *(f"{row},b,oak" for row in rows)])
    first, second = read_throw_counts(write_counts(tmp_path, text))
    assert first.session_key == second.session_key == ("b", "")
    assert (first.session, second.material) == ("b", "oak")


def test_a_run(run: Path, tmp_path: Path) -> None:
    """Outcomes are matched by labels, without probabilities; the size is in millimeters."""
    text = "die,mesh,outcome,throws\nb,run,z,5\nb,run,x,7\nb,run,y,9\n"
    (die,) = read_throw_counts(write_counts(tmp_path, text))
    assert die.labels == ("z", "x", "y")
    assert die.counts.tolist() == [5, 7, 9]
    assert die.size == pytest.approx(2e-3 * np.linalg.norm([5.0, 6.0, 8.5]), rel=1e-6)
    other_size = "die,mesh,outcome,throws,size_mm\nb,run,z,5,20\nb,run,x,7,20\n"
    assert read_throw_counts(write_counts(tmp_path, other_size))[0].size == 0.02
    normals = die.body.rest_normals @ die.body.axes.T
    for normal, group in zip(normals.round(6).tolist(), die.group_of_rest.tolist(), strict=True):
        axis = int(np.abs(normal).argmax())
        assert group == (-1 if axis == 2 and normal[2] > 0 else (1, 2, 0)[axis])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the columns die, mesh, outcome, throws, each once, got none"),
        (HEADER, "expected a line for each outcome, got none"),
        (HEADER + "b,box.obj,1,2\n", "line 2: expected 5 entries, got 'b,box.obj,1,2'"),
        (HEADER + "b,box.obj,1,2.5,0.4\n", "line 2: expected a whole number from 0"),
        (HEADER + "b,box.obj,1,0,0.4\n", "expected throws of 'b', got none"),
        (HEADER + "b,box.obj,1,2,0.4\nb,box.obj,1,2,0.4\n", "line 3: expected each outcome of 'b'"),
        (HEADER + "b,box.obj,1,2,often\n", "line 2: expected a finite number as geometric"),
        (HEADER + "b,box.obj,1,2,.99\nb,box.obj,2,3,.01\n", "expected rests with the geometric"),
        ("die,mesh,outcome,throws\nb,box.obj,1,2\n", "expected a column geometric"),
        ("die,mesh,outcome,throws\nb,run,q,2\n", r"expected a label of the die \(x, y, z, w\)"),
        ("die,mesh,outcome,throws\nb,run,x,2\n", "expected two outcomes or more of 'b', got x"),
        ("die,mesh,outcome,throws\nb,run,x,2\nb,box.obj,y,2\n", "line 3: expected the mesh of"),
        (
            "die,mesh,outcome,throws,size_mm\nb,run,x,2,20\nb,run,y,2,21\n",
            "line 3: expected the size_mm of the other lines of 'b', '20', got '21'",
        ),
        ("die,mesh,outcome,throws\nb,run,x,2\nb,run,w,1\n", "expected a stable facet with the"),
        (
            "die,mesh,outcome,throws,session\nb,run,x,2,a\nb,run,y,2,b\n",
            "line 3: expected the session of the other lines of 'b', 'a', got 'b'; give the die",
        ),
        (
            "die,mesh,outcome,throws,material\nb,run,x,2,\nb,run,y,2,\n",
            "line 2: expected the name of a material, got none; write one for each die, or leave",
        ),
    ],
)
def test_invalid_files(box: Path, run: Path, tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_throw_counts(write_counts(tmp_path, text))


@pytest.mark.parametrize(
    ("com", "size", "message"),
    [
        ("", "0", "size_mm"),
        ("0 0", "", "com"),
        ("0 inf 0", "", "com.*inf"),
        ("9 0 0", "", "center of mass"),
    ],
)
def test_invalid_sizes_and_centers(
    box: Path, tmp_path: Path, com: str, size: str, message: str
) -> None:
    rows = [f"b,{box.name},{i},2,{p},{com},{size}\n" for i, p in enumerate(_probabilities(box))]
    with pytest.raises(InputError, match=f"line 2: .*{message}"):
        read_throw_counts(write_counts(tmp_path, HEADER.strip() + ",com,size_mm\n" + "".join(rows)))


# One die.


LABELS = ["1", "2", "heads, or tails"]


def write_log(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "throws.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ('label,count\n1,10\n2,3\n"heads, or tails",0\n', [10, 3, 0]),
        ("label,count\n2,5", [0, 5, 0]),
        ("\ufeffLabel , Count\r\n\r\n 2 , 5 \r\n,\r\n", [0, 5, 0]),
        ('label\n1\n2\n\n1\n"heads, or tails"\n', [2, 1, 1]),
    ],
)
def test_good_files(tmp_path: Path, text: str, counts: list[int]) -> None:
    assert read_counts(write_log(tmp_path, text), LABELS).tolist() == counts


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"throws.csv: expected a first line label,count or label, got ''"),
        ("label,count\n1,0\n2,0\n", r"expected at least one throw, got none"),
        ("label,count\n1,10\n\n7,3\n", r"line 4: expected a label of the die \(1, 2, .*got '7'"),
        ("label,count\n1,-2\n", r"line 2: expected a whole number from 0 to 1000000000, got '-2'"),
        ("label,count\n1,1_000\n", r"got '1_000'"),
        ("label,count\n1\n", r"line 2: expected 2 entries, got '1'"),
        ("label\n1,4\n", r"line 2: expected 1 entries, got '1,4'"),
        ("label,count\n1,4\n2,2\n1,3\n", r"line 4: expected each label once, got '1' as on line 2"),
        (b"label\n\xff\n", r"expected a CSV file of throws in UTF-8, but .*0xff"),
    ],
)
def test_bad_files(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_counts(write_log(tmp_path, text), LABELS)


def test_each_throw_is_saved(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    log = RollLog(path, LABELS)
    assert path.read_text() == "label\n"
    assert log.undo() is None
    for text, added in (
        ("2", ["2"]),
        ("1  2 1", ["1", "2", "1"]),
        ("2,1,", ["2", "1"]),
        ("", []),
        ("Heads,  or tails", ["heads, or tails"]),
    ):
        before = list(log.throws)
        assert log.add(text) == added
        assert log.throws == before + added
        assert RollLog(path, LABELS).throws == log.throws
    assert read_counts(path, LABELS).tolist() == log.counts.tolist() == [3, 3, 1]
    assert log.undo() == "heads, or tails"
    assert log.undo() == "1"
    assert read_counts(path, LABELS).tolist() == [2, 3, 0]


def test_a_line_with_a_wrong_label_is_not_saved(tmp_path: Path) -> None:
    log = RollLog(tmp_path / "new.csv", LABELS)
    log.add("1")
    with pytest.raises(InputError, match=r"^roll: .*'3'"):
        log.add("2 3")
    assert RollLog(tmp_path / "new.csv", LABELS).throws == ["1"]


def test_case_matters_only_for_ambiguous_labels(tmp_path: Path) -> None:
    log = RollLog(tmp_path / "new.csv", ["a", "A", "Two\nlines"])
    assert log.add("A a a") == ["A", "a", "a"]
    assert log.add("two lines") == ["Two\nlines"]
    assert RollLog(tmp_path / "new.csv", log.labels).counts.tolist() == [2, 1, 1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("label,count\n1,3\n", r"expected a first line label, got 'label,count'; .* a new file"),
        ("", r"expected a first line label, got ''"),
        ("label\n1\n5\n", r"line 3: expected a label of the die"),
    ],
)
def test_other_files_are_not_overwritten(tmp_path: Path, text: str, message: str) -> None:
    path = write_log(tmp_path, text)
    with pytest.raises(InputError, match=message):
        RollLog(path, LABELS)
    assert path.read_text() == text
