"""`dicedesign rolls`: tables, JSON, typed throws, errors."""

from __future__ import annotations

import io
import json
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.processes import heed_interrupts

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses


@pytest.fixture
def die(tmp_path: Path) -> Path:
    target = [1 / 16, 2 / 16, 3 / 16, 4 / 16, 3 / 16, 2 / 16, 1 / 16]
    return finished_run(tmp_path / "2d4", list("2345678"), target)


def counts(tmp_path: Path, values: dict[str, int]) -> Path:
    path = tmp_path / "counts.csv"
    path.write_text("label,count\n" + "".join(f"{k},{v}\n" for k, v in values.items()))
    return path


def run_json(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main(["rolls", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_designed_die(die: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    throws = counts(tmp_path, {"8": 9, "2": 11, "3": 20, "4": 30, "5": 45, "6": 27, "7": 18})
    result = run_json(capsys, die, throws, "--confidence", 1.0 - 2.0**-53)
    assert (result["throws"], result["rejected"], result["exact_test"]) == (160, False, None)
    assert result["confidence"] == 1.0 - 2.0**-53
    assert [outcome["label"] for outcome in result["outcomes"]] == list("2345678")
    first = result["outcomes"][0]
    assert (first["count"], first["probabilities"]) == (11, 1 / 16)
    assert first["interval"][0] < first["frequency"] < first["interval"][1]
    assert first["posterior_mean"] == pytest.approx(11.5 / 163.5)
    assert all(outcome["posterior_interval"][1] < 1.0 for outcome in result["outcomes"])
    assert result["chi_square"]["degrees"] == 6
    assert result["total_variation"]["noise_floor"] > 0.0
    assert result["throws_to_confirm"] > result["throws_to_reject"] > 0


def test_as_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    die = finished_run(tmp_path / "coins", list("012"), [0.25, 0.5, 0.25], status="off_target")
    throws = counts(tmp_path, {"0": 4, "1": 10, "2": 3})
    assert main(["rolls", str(die), str(throws), "--confidence", "0.9"]) == 0
    out, err = capsys.readouterr()
    assert "does not meet its target (off_target)" in err
    assert "exact multinomial test, as some outcomes are rare: p = 0.86" in out
    assert "do not reject these probabilities at the level 0.1" in out
    verdict = run_json(capsys, die, throws, "--confidence", "0.9")
    assert verdict["throws_to_reject"] > verdict["throws"] == 17
    assert f"{verdict['throws_to_reject'] - 17} more throws would reject" in out
    one = finished_run(tmp_path / "one", ["1"], [1.0])
    assert main(["rolls", str(one), str(throws)]) == 2
    assert "expected a die with at least 2 outcomes, got 1" in capsys.readouterr().err


def test_the_rests_of_a_mesh_are_its_outcomes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    box = box_file(tmp_path)
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


class Pipe(io.StringIO):
    """Standard input. "^C" is an interrupt.

    log: file of throws; saved: its labels each time a line is read.
    """

    def __init__(self, log: Path, typed: str) -> None:
        super().__init__(typed)
        self.log = log
        self.saved: list[str] = []

    def readline(self, size: int = -1, /) -> str:
        self.saved.append("".join(self.log.read_text().split()[1:]))
        line = super().readline(size)
        if line == "^C\n":
            raise KeyboardInterrupt
        return line


class Terminal(Pipe):
    """Terminal with typed lines."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "rolls.csv"


@pytest.mark.parametrize("kind", [Pipe, Terminal])
@pytest.mark.parametrize("end", ["", "done\n5 5 5\n", "^C\n5 5 5\n"])
def test_typed_throws_have_the_verdict_of_a_file(
    die: Path,
    log: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    kind: type[Pipe],
    end: str,
) -> None:
    """Each line is saved before the next is read."""
    log.write_text("label\n2\n7\n")
    stdin = kind(log, "5\n4 6 7\n\n3\n8\nundo\n5\n" + end)
    monkeypatch.setattr(sys, "stdin", stdin)
    result = run_json(capsys, die, "--log", log)
    assert stdin.saved[:5] == ["27", "275", "275467", "275467", "2754673"]
    assert stdin.saved[5:] == ["27546738", "2754673", "27546735"]
    assert log.read_text().split() == ["label", *"27546735"]
    assert result == run_json(capsys, die, log)


def test_a_wrong_line_is_refused(
    die: Path, log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A terminal asks again; a pipe ends there, and the throws before are logged."""
    monkeypatch.setattr(sys, "stdin", Terminal(log, "5\n4 9\n4 6\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 0
    captured = capsys.readouterr()
    assert "got '9'" in captured.err
    assert "3 throws, tested for the target" in captured.out
    monkeypatch.setattr(sys, "stdin", Pipe(log, "7\n4 9\n4 6\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 2
    assert "stdin, line 2: roll: expected a label of the die" in capsys.readouterr().err
    assert log.read_text().split() == ["label", *"5467"]


def test_an_empty_line_at_a_terminal_shows_the_whole_verdict(
    die: Path, log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one that is printed at the end; other lines get a sentence."""
    monkeypatch.setattr(sys, "stdin", Terminal(log, "5 6\n\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 0
    out, err = capsys.readouterr()
    _, sentence, whole, _ = err.split("> ")
    assert len(sentence.splitlines()) == 1 < len(whole.splitlines())
    assert whole.strip() in out
    assert sentence.strip() not in out


def test_no_throw_is_typed(
    die: Path, log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", Terminal(log, "undo\n\n5\nundo\n"))
    assert main(["rolls", str(die), "--log", str(log)]) == 0
    assert capsys.readouterr().out == "no throws, nothing to judge\n"
    monkeypatch.setattr(sys, "stdin", Pipe(log, ""))
    assert run_json(capsys, die, "--log", log) == {"throws": 0}
    assert log.read_text() == "label\n"


def test_a_page_logs_throws_until_an_interrupt(die: Path, log: Path) -> None:
    """Then the verdict is printed, as after typed throws."""
    pytest.importorskip("uvicorn")
    command = [sys.executable, "-m", "dicedesign", "rolls", str(die), "--log", str(log)]
    process = subprocess.Popen(
        [*command, "--page", "--port", "0", "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )
    with process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        for outcome in (0, 6, 6):
            request = urllib.request.Request(address + "roll", str(outcome).encode())
            with urllib.request.urlopen(request, timeout=60) as answer:
                assert answer.status == 200
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (0, "")
    assert "3 throws, tested for the target" in out
    assert log.read_text().split() == ["label", "2", "8", "8"]


def test_only_a_page_for_phones_is_open_to_the_network(
    die: Path, log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its address has a key, another one each time."""
    pytest.importorskip("uvicorn")
    served = []

    def run(app: object, listening: socket.socket) -> None:
        address = capsys.readouterr().out.splitlines()[-1]
        served.append((listening.getsockname()[0], address))

    monkeypatch.setattr("dicedesign.view.server.run", run)
    monkeypatch.setattr("dicedesign.view.server.network_address", lambda: "192.0.2.7")
    page = ["rolls", str(die), "--log", str(log), "--page", "--port", "0"]
    for more in ([], ["--phone"], ["--phone"]):
        assert main([*page, *more]) == 0
    (alone, local), *phones = served
    assert alone == "127.0.0.1"
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", local)
    assert [host for host, _ in phones] == ["0.0.0.0"] * 2
    keys = [re.fullmatch(r"http://192\.0\.2\.7:\d+/([\w-]{12,})/", url) for _, url in phones]
    assert len({key[1] for key in keys if key is not None}) == 2


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["counts.csv", "--page"], "--page: expected a file for the throws"),
        (["--log", "rolls.csv", "--phone"], "--phone: expected --page"),
        (["--log", "rolls.csv", "--port", "0"], "--port: expected --page"),
        (["--log", "rolls.csv", "--page", "--json"], "--json: expected no --page"),
    ],
)
def test_a_page_needs_a_file_and_its_options_a_page(
    die: Path, options: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["rolls", str(die), *options]) == 2
    assert expected in capsys.readouterr().err
