"""Damaged files through the readers: meshes, recipes, tables, counts and results."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.batch.batch import analyse_files
from dicedesign.batch.rest_table import RestTable, Stamp
from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.reading import read_recipe
from tests.reference.solids import box
from tests.soak.commands import Case, Command, Ended, Fault, Tried, drive, faults_of
from tests.soak.mesh_files import mesh_file

MEMORY: Final = 1 << 30
"""Bytes that reading a small file may take beside the program."""

MOST_CHANGES: Final = 3
"""Of a file."""

SUM_LIMIT: Final = 1e-9
"""By how much the odds of a damaged mesh that can still be read may miss 1 in sum."""

NUMBERS: Final = (
    b"0", b"-1", b"1e308", b"-1e308", b"1e-320", b"1e999", b"nan", b"inf", b"9" * 400, b"9" * 5000,
    b"0x10", b"1_0", b"2147483648", b"18446744073709551616", b"1.5", b"true", b"",
)  # fmt: skip
"""What takes the place of a number."""

PIECES: Final = (
    b"\x00", b"\xff\xfe", b"\xed\xa0\x80", b"\r", b"\n\n", b'"', b"'", b"[" * 20_000, b"{" * 2_000,
    b"&a [*a, *a]", b"!!python/object:os.system {}", b"\xe2\x80\xae", b",", b":", b"#", b" " * 5000,
)  # fmt: skip
"""What is pushed in somewhere."""


@dataclass(frozen=True)
class _Reader:
    """A kind of file and how it is read.

    Attributes
    ----------
    ending: of the files.
    arguments: of the command line for a file's path.
    program: see `Command`.
    check: what is wrong with an answer, as JSON, or "".
    place: path of the file in its folder.
    """

    ending: str
    arguments: Callable[[str], tuple[str, ...]]
    check: Callable[[Any], str] = lambda answer: ""
    program: Callable[[list[str]], int] | None = None
    place: str = ""


def _read(arguments: list[str]) -> int:
    """Read a file by the reader that the first argument names, as a command does."""
    kind, path = arguments
    try:
        (read_recipe if kind == "recipe" else RestTable.read)(Path(path))
    except DiceError as error:
        return _refused(error)
    print("{}")
    return 0


def _refused(error: DiceError) -> int:
    print(f"dicedesign: {error}", file=sys.stderr)
    return 2


def _bad_rests(answer: Any) -> str:
    odds = [rest["probability"] for rest in answer["rests"]]
    if not all(0.0 <= one <= 1.0 for one in odds):
        return f"odds {odds}"
    if not abs(math.fsum(odds) - 1.0) <= SUM_LIMIT:
        return f"odds that sum to {math.fsum(odds)!r}"
    return ""


def _bad_rolls(answer: Any) -> str:
    counts = [one["count"] for one in answer["outcomes"]]
    if sum(counts) != answer["throws"] or min(counts) < 0:
        return f"counts {counts} of {answer['throws']} throws"
    return ""


def _mesh(ending: str) -> _Reader:
    return _Reader(ending, lambda path: ("rest", path, "--json"), _bad_rests)


READERS: Final = {
    "recipe": _Reader(".yaml", lambda path: ("recipe", path), program=_read),
    "table of rests": _Reader(".csv", lambda path: ("rests", path), program=_read),
    "throw table": _Reader(
        ".json", lambda path: ("rest", "good.stl", "--table", path, "--json"), _bad_rests
    ),
    "counts": _Reader(".csv", lambda path: ("rolls", "good.stl", path, "--json"), _bad_rolls),
    "result": _Reader(
        ".json",
        lambda path: ("rolls", str(Path(path).parent), "good.csv", "--json"),
        _bad_rolls,
        place="result.json",
    ),
    **{
        f"{ending[1:]} mesh": _mesh(ending)
        for ending in (".stl", ".obj", ".off", ".xyz", ".ply", ".glb", ".3mf")
    },
    "text stl mesh": _mesh(".stl"),
}
"""By what they read."""


class Samples:
    """Sound files of each kind, beside what the commands that read them need: good.stl and
    good.csv."""

    def __init__(self, folder: Path) -> None:
        """folder: an empty one. Raises RuntimeError where the result of a run cannot be made."""
        self.folder = folder
        hull = convex_hull(box(1.0, 0.8, 0.7).points)
        (folder / "good.stl").write_bytes(mesh_file(".stl", hull.vertices, hull.triangles))
        (folder / "good.csv").write_text("label,count\n1,20\n2,21\n3,14\n")
        (folder / "good.yaml").write_text(_RECIPE)
        RestTable(folder / "rests.csv", analyse_files(str(folder), {"good.stl": Stamp(1, 1)}))
        for made in drive([_finished(folder)], folder, 1):
            if made.faults:
                raise RuntimeError(made.faults[0].what)
        self._contents = {
            "recipe": (folder / "die" / "recipe.yaml").read_bytes(),
            "table of rests": (folder / "rests.csv").read_bytes(),
            "throw table": _table_text("board-game"),
            "counts": b"label,count\n1,20\n2,21\n3,14\n4,15\n5,11\n6,12\n",
            "result": (folder / "die" / "result.json").read_bytes(),
        }
        for kind, reader in READERS.items():
            if kind not in self._contents:
                text = kind.startswith("text")
                data = mesh_file(reader.ending, hull.vertices, hull.triangles, text=text)
                self._contents[kind] = data

    def content(self, kind: str) -> bytes:
        """The content of a sound file."""
        return self._contents[kind]


_RECIPE: Final = """
name: die
target: {fair: 3}
start: {prism: {}}
figures: false
report: false
"""


def _finished(folder: Path) -> Case:
    """A run whose result is a sample."""
    ended = yield Command(("run", "good.yaml", "--out", "die"), folder)
    return Tried(0, faults_of(ended, 0))


def _table_text(name: str) -> bytes:
    return resources.files("dicedesign.throws").joinpath(f"named/{name}.json").read_bytes()


def file_cases(samples: Samples, numbers: range, seed: int) -> Iterator[Case]:
    """The cases of these numbers, each a damaged file, the first of each kind a sound one."""
    kinds = list(READERS)
    for number in numbers:
        rng = np.random.default_rng([seed, number])
        kind = kinds[number % len(kinds)]
        data = samples.content(kind)
        sound = number < len(kinds)
        if not sound:
            other = samples.content(kinds[int(rng.integers(len(kinds)))])
            data = damaged(rng, data, other if rng.random() < 0.3 else data)
        yield _case(samples, number, kind, data, sound)


def _case(samples: Samples, number: int, kind: str, data: bytes, sound: bool) -> Case:
    reader, folder = READERS[kind], samples.folder / str(number)
    folder.mkdir()
    path = folder / (reader.place or f"file{reader.ending}")
    path.write_bytes(data)
    arguments = reader.arguments(str(path))
    ended = yield Command(arguments, samples.folder, program=reader.program, memory=MEMORY)
    shutil.rmtree(folder)
    faults = [Fault(one.kind, f"{kind}: {one.what}") for one in _faults(ended, reader, sound)]
    return Tried(number, faults)


def _faults(ended: Ended, reader: _Reader, sound: bool) -> list[Fault]:
    found = faults_of(ended, 0, *(() if sound else (2,)))
    if found:
        return found
    said = [line for line in ended.err.splitlines() if not line.startswith("note: ")]
    if ended.code == 2:
        if len(said) != 1 or ended.out:
            return [Fault("wrong", f"expected one line of an error, got {ended.out + ended.err!r}")]
        return []
    if said:
        return [Fault("wrong", f"expected an answer alone, got {said!r}")]
    wrong = reader.check(json.loads(ended.out))
    return [Fault("wrong", wrong)] if wrong else []


def damaged(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """A file's content after a few changes of random kinds. other: of a file that pieces are taken
    from."""
    for _ in range(int(rng.integers(1, MOST_CHANGES + 1))):
        data = _CHANGES[int(rng.integers(len(_CHANGES)))](rng, data, other)
    return data


def _place(rng: np.random.Generator, data: bytes) -> int:
    return int(rng.integers(len(data) + 1))


def _flipped(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 20)) if data else 0):
        changed[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _truncated(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    return data[: _place(rng, data)]


def _without_slice(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    start = _place(rng, data)
    return data[:start] + data[start + int(rng.integers(1, 60)) :]


def _spliced(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    first, second = sorted((_place(rng, other), _place(rng, other)))
    start = _place(rng, data)
    return data[:start] + other[first:second] + data[start:]


def _with_number(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """With another number in place of one of the text."""
    found = list(re.finditer(rb"-?\d[\d.]*(?:e[-+]?\d+)?", data))
    if not found:
        return data
    match = found[int(rng.integers(len(found)))]
    new = NUMBERS[int(rng.integers(len(NUMBERS)))]
    return data[: match.start()] + new + data[match.end() :]


def _with_piece(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    start = _place(rng, data)
    return data[:start] + PIECES[int(rng.integers(len(PIECES)))] + data[start:]


def _with_line_again(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """With a line repeated, a few times or very often."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    place, times = int(rng.integers(len(lines))), int(rng.choice([1, 2, 5000]))
    repeated = lines[place] * times if len(lines[place]) < 500 else lines[place]
    return b"".join([*lines[:place], repeated, *lines[place:]])


def _with_large_word(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """With four bytes that a program may take for a huge count."""
    start = _place(rng, data)
    word = [b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x00", b"\x00\x00\xc0\x7f"]
    return data[:start] + word[int(rng.integers(4))] + data[start + 4 :]


_CHANGES: Final = (
    _flipped,
    _truncated,
    _without_slice,
    _spliced,
    _with_number,
    _with_number,
    _with_piece,
    _with_line_again,
    _with_large_word,
)
