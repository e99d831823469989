"""`dicedesign rolls`: tables, JSON, figure, typed throws, errors."""

from __future__ import annotations

import csv
import io
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.paths import public_data

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses


@pytest.fixture
def die(tmp_path: Path) -> Path:
    target = [1 / 16, 2 / 16, 3 / 16, 4 / 16, 3 / 16, 2 / 16, 1 / 16]
    return finished_run(tmp_path / "2d4", list("2345678"), target)


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return box_file(tmp_path)


def counts(tmp_path: Path, values: dict[str, int]) -> Path:
    path = tmp_path / "counts.csv"
    path.write_text("label,count\n" + "".join(f"{k},{v}\n" for k, v in values.items()))
    return path


def run_json(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main(["rolls", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_designed_die(die: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    throws = counts(tmp_path, {"8": 9, "2": 11, "3": 20, "4": 30, "5": 45, "6": 27, "7": 18})
    result = run_json(capsys, die, throws)
    assert list(result) == [
        "probabilities_source",
        "throws",
        "confidence",
        "outcomes",
        "chi_square",
        "exact_test",
        "p_value",
        "rejected",
        "total_variation",
        "throws_to_reject",
        "throws_to_confirm",
    ]
    assert (result["throws"], result["rejected"], result["exact_test"]) == (160, False, None)
    assert [outcome["label"] for outcome in result["outcomes"]] == list("2345678")
    first = result["outcomes"][0]
    assert (first["count"], first["probabilities"]) == (11, 1 / 16)
    assert first["interval"][0] < first["frequency"] < first["interval"][1]
    assert first["posterior_mean"] == pytest.approx(11.5 / 163.5)
    assert result["chi_square"]["degrees"] == 6
    assert result["total_variation"]["noise_floor"] > 0.0


def test_as_a_table(die: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    throws = counts(tmp_path, {"2": 1, "3": 2, "4": 3, "5": 4, "6": 3, "7": 2, "8": 2})
    assert main(["rolls", str(die), str(throws), "--confidence", "0.9"]) == 0
    out = capsys.readouterr().out
    assert "17 throws, tested for the target of its design" in out
    assert "90 % interval" in out
    assert "exact multinomial test, as some outcomes are rare: p = 0.98" in out
    assert "do not reject these probabilities at the level 0.1" in out
    assert "more throws would reject these probabilities with probability 0.8" in out
    assert "would show that they are, to within a total variation of 0.02" in out


def test_the_rests_of_a_mesh_are_its_outcomes(
    box: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = run_json(capsys, box, counts(tmp_path, {"1": 30, "2": 28, "6": 2}))
    probabilities = [outcome["probabilities"] for outcome in result["outcomes"]]
    np.testing.assert_allclose(probabilities, rest_poses(read_body(box)).probabilities)
    assert [outcome["label"] for outcome in result["outcomes"]] == list("123456")
    assert [outcome["count"] for outcome in result["outcomes"]] == [30, 28, 0, 0, 0, 2]
    assert result["probabilities_source"] == "geometric probabilities of its rests"


def test_a_designed_die_loads_nothing_heavy(die: Path, tmp_path: Path) -> None:
    throws = counts(tmp_path, {"5": 3})
    code = (
        "import sys; from dicedesign.cli.main import main; main(sys.argv[1:]); "
        "print(sorted(name for name in ('torch', 'matplotlib', 'trimesh', "
        "'dicedesign.geometry', 'dicedesign.report') if name in sys.modules))"
    )
    command = [sys.executable, "-c", code, "rolls", str(die), str(throws)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "[]"


def test_published_throws_of_a_published_mesh(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The throws of each pair of outcomes are known only together. The test rejects the geometric
    probabilities of the hendecahedron, and not those of three coins."""
    with public_data("published/throws.csv").open() as file:
        rows = list(csv.DictReader(file))
    for name, rejected in (("2d6_hendecahedron", True), ("binomial2", False)):
        mine = [row for row in rows if row["die"] == name]
        probabilities = np.array([float(row["geometric"]) for row in mine])
        labels = [row["outcome"] for row in mine]
        target = (probabilities / probabilities.sum()).tolist()
        folder = finished_run(tmp_path / name, labels, target, status="off_target")
        throws = counts(tmp_path, {row["outcome"]: int(row["throws"]) for row in mine})
        assert main(["rolls", str(folder), str(throws), "--json"]) == 0
        captured = capsys.readouterr()
        result = json.loads(captured.out)
        assert result["throws"] == sum(int(row["throws"]) for row in mine)
        assert result["rejected"] is rejected
        assert "does not meet its target (off_target)" in captured.err


def test_a_die_with_one_outcome(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = finished_run(tmp_path / "one", ["1"], [1.0])
    assert main(["rolls", str(one), str(counts(tmp_path, {"1": 3}))]) == 2
    assert "expected a die with at least 2 outcomes, got 1" in capsys.readouterr().err


def test_the_largest_confidence(
    die: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = run_json(
        capsys, die, counts(tmp_path, {"5": 30, "4": 20}), "--confidence", "0.9999999999999999"
    )
    assert result["confidence"] == 1.0 - 2.0**-53
    assert result["throws_to_confirm"] > result["throws_to_reject"] > 0
    assert all(outcome["posterior_interval"][1] < 1.0 for outcome in result["outcomes"])


class Terminal(io.StringIO):
    """Terminal with typed lines; "^C" is an interrupt."""

    def isatty(self) -> bool:
        return True

    def readline(self, size: int = -1, /) -> str:
        line = super().readline(size)
        if line == "^C\n":
            raise KeyboardInterrupt
        return line


@pytest.mark.parametrize("stdin", [io.StringIO, Terminal])
@pytest.mark.parametrize("end", ["", "done\n5 5 5\n"])
def test_typed_throws_have_the_verdict_of_a_file(
    die: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    stdin: type[io.StringIO],
    end: str,
) -> None:
    log = tmp_path / "rolls.csv"
    log.write_text("label\n2\n7\n")
    monkeypatch.setattr(sys, "stdin", stdin("5\n4 6 7\n\n3\n8\nundo\n5\n" + end))
    result = run_json(capsys, die, "--log", log)
    assert log.read_text().split() == ["label", "2", "7", "5", "4", "6", "7", "3", "5"]
    assert result == run_json(capsys, die, log)


def test_a_wrong_line_is_refused(
    die: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A terminal asks again; a pipe ends there, and the throws before are logged."""
    log = tmp_path / "rolls.csv"
    monkeypatch.setattr(sys, "stdin", Terminal("5\n4 9\n4 6\n^C\n7\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 0
    captured = capsys.readouterr()
    assert "got '9'" in captured.err
    assert "3 throws, tested for the target" in captured.out
    assert log.read_text().split() == ["label", "5", "4", "6"]
    monkeypatch.setattr(sys, "stdin", io.StringIO("7\n4 9\n4 6\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 2
    assert "stdin, line 2: roll: expected a label of the die" in capsys.readouterr().err
    assert log.read_text().split() == ["label", "5", "4", "6", "7"]


def test_no_throw_is_typed(
    die: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = tmp_path / "rolls.csv"
    monkeypatch.setattr(sys, "stdin", Terminal("undo\n\n5\nundo\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 0
    assert capsys.readouterr().out == "no throws, nothing to judge\n"
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    assert run_json(capsys, die, "--log", log) == {"throws": 0}
    assert log.read_text() == "label\n"


def test_typed_throws_survive_a_kill(die: Path, tmp_path: Path) -> None:
    """Each line is logged at once, and an interrupt ends with the verdict."""
    log = tmp_path / "rolls.csv"
    for sent, typed in ((signal.SIGKILL, "5\n4\n"), (signal.SIGINT, "6\n")):
        process = subprocess.Popen(
            [sys.executable, "-m", "dicedesign", "rolls", str(die), "--log", str(log)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdin is not None
        process.stdin.write(typed)
        process.stdin.flush()
        last, deadline = typed.split()[-1], time.monotonic() + 60.0
        while not (log.exists() and log.read_text().split()[-1] == last):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(sent)
        out, _ = process.communicate()
        assert process.returncode == (0 if sent == signal.SIGINT else -sent)
    assert "3 throws, tested" in out
    assert log.read_text().split() == ["label", "5", "4", "6"]
