"""The frame of all benches: their command lines, tables, JSON, files and exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from dicedesign.bench.frame import BENCHES, Bench, Items, Run, machine_description
from dicedesign.bench.options import Amount, meshes
from dicedesign.bench.rows import Row, column, hidden, percent, plain
from dicedesign.cli.main import main
from dicedesign.errors import InputError, OutputError
from dicedesign.results.status import Status

NAMES = (
    "accuracy", "company", "concave", "design", "endurance", "exact", "finished", "gradients",
    "lean", "momentum", "paper", "priors", "probe", "simulators", "speed", "stability", "table",
    "thrown", "tolerance", "view",
)  # fmt: skip

TOY = '''
"""How long words are: a bench from outside the package."""

from dataclasses import dataclass

from dicedesign.bench.frame import BENCHES, Bench
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column


@dataclass(frozen=True)
class Extent:
    words: int


@dataclass(frozen=True)
class WordRow(Row):
    word: str = column("word", -10)
    letters: int = column("letters", 8)


def rows(run):
    for word in ("die", "facet", "saddle")[: run.extent.words]:
        run.advance()
        yield WordRow(word, len(word))
    return True


BENCHES.register(
    Bench(
        name="words",
        line="how long words are",
        description="Count letters.",
        rows=rows,
        full=Extent(3),
        quick=Extent(1),
        amounts=(Amount("words", "N", "how many"),),
        torch=False,
    )
)
'''


def test_a_bench_from_outside_runs_by_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "toy_bench.py").write_text(TOY)
    monkeypatch.syspath_prepend(tmp_path)
    __import__("toy_bench")
    try:
        assert main(["bench", "words"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line.split() for line in lines] == [
            ["word", "letters"],
            ["die", "3"],
            ["facet", "5"],
            ["saddle", "6"],
        ]
        assert len({len(line) for line in lines}) == 1
        assert main(["bench", "words", "--quick", "--json"]) == 0
        record = json.loads(capsys.readouterr().out)
        assert (record["words"], record["rows"]) == (1, [{"word": "die", "letters": 3}])
        with pytest.raises(SystemExit, match="0"):
            main(["bench", "--help"])
        assert "how long words are" in capsys.readouterr().out
    finally:
        BENCHES.unregister("words")


def test_help_names_every_bench_and_loads_nothing_heavy() -> None:
    script = (
        "import sys\n"
        "from dicedesign.cli.main import main\n"
        "try:\n    main(['bench', '--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'torch', 'matplotlib', 'manifold3d', 'scipy', 'mujoco', 'trimesh'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    )
    for bench in BENCHES:
        assert bench.name in done.stdout
    assert BENCHES.names == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_bench_has_the_options_of_all(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["bench", name, "--help"])
    text = capsys.readouterr().out
    bench = BENCHES[name]
    options = {"--quick", "--json", "--out", *(amount.option for amount in bench.amounts)}
    options |= {"--figure"} if bench.figure else set()
    options |= {"--jobs", "--scheduler"} if bench.workers else set()
    options |= {"--engine"} if bench.engine else set()
    assert all(option in text for option in options)
    assert type(bench.full) is type(bench.quick)
    for amount in bench.amounts:
        assert hasattr(bench.full, amount.name)


@dataclass(frozen=True)
class Extent:
    tries: int
    share: float


@dataclass(frozen=True)
class TryRow(Row):
    """With every kind of cell."""

    computed: ClassVar[tuple[str, ...]] = ("double",)

    name: str = column("name", -6)
    value: float | None = column("value", 8, ".2f")
    share: float = column("share %", 9, percent(1))
    note: str = column("", 0, default="")
    more: tuple[float, ...] = hidden(default=())

    @property
    def double(self) -> float:
        return 2.0 * (self.value or 0.0)


@dataclass(frozen=True)
class EndRow(Row):
    table: ClassVar[str | None] = "ends"

    count: int = column("count", 5)


def tries(run: Run) -> Items:
    run.begin("tries")
    for path in run.options.meshes:
        raise InputError(f"{path}: expected none")
    if run.extent.tries == 13:
        run.note("unlucky")
    yield {"seed": np.int64(7)}
    for number in range(run.extent.tries):
        value = None if number == 1 else float("nan") if number == 2 else float(number)
        yield TryRow("abc", value, run.extent.share, "so" * (number == 1), (float("inf"),))
        run.advance()
    yield EndRow(run.extent.tries)
    yield "\nthe end"
    return run.extent.tries < 3


@pytest.fixture
def toy() -> Iterator[Bench]:
    def figure(rows: object, run: Run) -> object:
        from dicedesign.report.charts.paper import Paper

        return Paper(10.0, 10.0)

    yield BENCHES.register(
        Bench(
            name="toy",
            line="tries",
            description="Try.",
            rows=tries,
            full=Extent(2, 0.25),
            quick=Extent(1, 0.25),
            amounts=(
                Amount("tries", "N", "how many"),
                Amount("share", "S", "of all", "--part", float, below=1.0),
            ),
            options=(meshes(),),
            torch=False,
            figure=figure,
        )
    )
    BENCHES.unregister("toy")


def test_tables_json_and_exit_codes(toy: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "toy"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "name     value  share %",
        "abc       0.00     25.0",
        "abc          -     25.0  so",
        "",
        "count",
        "    2",
        "",
        "the end",
    ]
    assert main(["bench", "toy", "--tries", "3", "--part", "0.5", "--json"]) == 1
    out, err = capsys.readouterr()
    record = json.loads(out)
    assert err == ""
    assert set(machine_description("dicedesign", "numpy", "scipy")) <= set(record)
    assert (record["tries"], record["share"], record["seed"]) == (3, 0.5, 7)
    assert [row["value"] for row in record["rows"]] == [0.0, None, None]
    assert record["rows"][0]["more"] == [None]
    assert record["rows"][0]["double"] == 0.0
    assert record["ends"] == [{"count": 3}]
    assert main(["bench", "toy", "--quick"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 7
    assert main(["bench", "toy", "--tries", "13"]) == 1
    assert capsys.readouterr().err == "note: unlucky\n"


def test_figure_and_json_are_written(
    toy: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn, folder = tmp_path / "drawn.png", tmp_path / "new" / "folder"
    assert main(["bench", "toy", "--figure", str(drawn), "--out", str(folder)]) == 0
    written = f"{drawn} and {folder / 'toy.png'} and {folder / 'toy.json'}"
    assert capsys.readouterr().out.splitlines()[-1] == f"wrote {written}"
    assert drawn.read_bytes() == (folder / "toy.png").read_bytes()
    assert drawn.read_bytes().startswith(b"\x89PNG")
    assert main(["bench", "toy", "--out", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == json.loads((folder / "toy.json").read_text())
    assert err.startswith("wrote ")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tries", "0"], "--tries: expected at least 1, got 0"),
        (["--part", "1"], "--part: expected a number in (0, 1), got 1"),
        (["--part", "nan"], "--part: expected a number in (0, 1), got nan"),
        (["--figure", "no/such.png"], "--figure: expected a file in a folder that exists"),
        (["--figure", "."], "--figure: expected a file in a folder that exists"),
        (["--out", "taken/bench"], "expected a folder that can be written, got"),
        (["mesh.stl"], "mesh.stl: expected none"),
    ],
)
def test_bad_input_is_said_before_anything_is_measured(
    toy: Bench,
    options: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("")
    assert main(["bench", "toy", *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err


def test_positive_numbers_are_asked_for() -> None:
    amount = Amount("seconds", "S", "each", kind=float)
    amount.check(1e-9)
    for value in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="--seconds: expected a positive number, got"):
            amount.check(value)


def test_results_are_printed_even_if_they_cannot_be_written(
    toy: Bench,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr("dicedesign.runtime.files.atomic_write", full)
    assert main(["bench", "toy", "--json", "--out", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert len(json.loads(out)["rows"]) == 2
    assert "the disk is full" in err


def test_plain_data() -> None:
    given = {"a": np.array([1.0, np.nan]), "b": (Status.TIME_LIMIT, np.float64(2.0)), "c": None}
    assert plain(given) == {"a": [1.0, None], "b": ["time_limit", 2.0], "c": None}
