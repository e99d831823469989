"""Counts of one die, throw by throw."""

from __future__ import annotations

from pathlib import Path

import pytest

from dicedesign.errors import InputError
from dicedesign.throws.roll_log import RollLog, read_counts

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


def test_labels_are_no_formulas_of_a_spreadsheet(tmp_path: Path) -> None:
    path, labels = tmp_path / "new.csv", ["+", "-", "-1", "+1", "=2+3", "'=4", "@x", "'y"]
    log = RollLog(path, labels)
    for label in labels:
        log.add(label)
    cells = path.read_text().splitlines()[1:]
    assert {cell for cell in cells if cell[0] in "=+-@"} == {"-1", "+1"}
    assert RollLog(path, labels).throws == labels
    # As somebody writes them.
    path.write_text("label\n+\n=2+3\n-1\n")
    assert RollLog(path, labels).throws == ["+", "=2+3", "-1"]


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
