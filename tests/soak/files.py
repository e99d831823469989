"""Read damaged files: meshes, recipes, tables, counts and results."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.batch.batch import analyze_files
from dicedesign.batch.rest_table import RestTable, Stamp
from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.reading import read_recipe
from tests.reference.solids import box
from tests.soak.frame import dicedesign, faults_of, run_command
from tests.soak.meshes import mesh_file

MEMORY = 1 << 30
"""Limit in bytes on the memory for reading a small file."""

MAX_CHANGES = 3
"""Limit on the changes of a file."""

SUM_LIMIT = 1e-9
"""Tolerance on the sum of the probabilities of a damaged but readable mesh."""

NUMBERS = (
    b"0", b"-1", b"1e308", b"1e-320", b"1e999", b"nan", b"9" * 5000, b"1_0", b"2147483648",
    b"1.5", b"",
)  # fmt: skip
"""Replacements of a number."""

PIECES = (
    b"\x00", b"\xff\xfe", b"\r", b"\n\n", b'"', b"[" * 20_000, b"{" * 2_000,
    b"&a [*a, *a]", b"!!python/object:os.system {}", b",", b":", b" " * 5000,
)  # fmt: skip
"""Insertions at a random place."""

WORDS = (b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x00", b"\x00\x00\xc0\x7f")
"""Four bytes that may be read as a huge count."""

MESHES = (".stl", ".text.stl", ".obj", ".off", ".xyz", ".ply", ".glb", ".3mf")

COMMANDS = {
    "recipe.yaml": "read-recipe {}/recipe.yaml",
    "rests.csv": "read-table {}/rests.csv",
    "table.json": "rest good.stl --table {}/table.json --json",
    "counts.csv": "rolls good.stl {}/counts.csv --json",
    "result.json": "rolls {} good.csv --json",
    **{f"mesh{ending}": f"rest {{}}/mesh{ending} --json" for ending in MESHES},
}
"""Command that reads each file of a folder; `read_or_run` adds the first two."""

RECIPE = """
name: die
target: {fair: 3}
start: {prism: {}}
figures: false
report: false
"""


def read_or_run(arguments: list[str]) -> int:
    """Run `python -m dicedesign` with two additional commands that only read a file."""
    readers = {"read-recipe": read_recipe, "read-table": RestTable.read}
    if arguments[0] not in readers:
        return dicedesign(arguments)
    try:
        readers[arguments[0]](Path(arguments[1]))
    except DiceError as error:
        print(f"dicedesign: {error}", file=sys.stderr)
        return 2
    print("{}")
    return 0


def make_samples(folder: Path) -> None:
    """Fill an empty folder with valid files, and with the other inputs of the commands."""
    hull = convex_hull(box(1.0, 0.8, 0.7).points)
    for ending in MESHES:
        content = mesh_file(ending, hull.vertices, hull.triangles)
        (folder / f"mesh{ending}").write_bytes(content)
    shutil.copy(folder / "mesh.stl", folder / "good.stl")
    (folder / "good.csv").write_text("label,count\n1,20\n2,21\n3,14\n")
    (folder / "counts.csv").write_text("label,count\n1,20\n2,21\n3,14\n4,15\n5,11\n6,12\n")
    table = resources.files("dicedesign.throws").joinpath("named/board-game.json")
    (folder / "table.json").write_bytes(table.read_bytes())
    (folder / "good.yaml").write_text(RECIPE)
    RestTable(folder / "rests.csv", analyze_files(str(folder), {"good.stl": Stamp(1, 1)}))
    ended = run_command(["run", "good.yaml", "--out", "die"], folder)
    assert faults_of(ended, 0) == []
    for name in ("recipe.yaml", "result.json"):
        shutil.copy(folder / "die" / name, folder)


def try_damaged(samples: Path, seed: int, number: int) -> list[str]:
    """Read a damaged file, and list the faults; the first file of each kind is valid."""
    rng, names = np.random.default_rng([seed, number]), list(COMMANDS)
    name, other = names[number % len(names)], names[rng.integers(len(names))]
    data = (samples / name).read_bytes()
    is_valid = number < len(names)
    if not is_valid:
        pieces = (samples / other).read_bytes() if rng.random() < 0.3 else data
        for _ in range(rng.integers(1, MAX_CHANGES + 1)):
            data = damage(rng, data, pieces)
    folder = samples / str(number)
    folder.mkdir()
    (folder / name).write_bytes(data)
    command = COMMANDS[name].format(folder).split()
    ended = run_command(command, samples, program=read_or_run, memory=MEMORY)
    shutil.rmtree(folder)
    faults = faults_of(ended, 0, *(() if is_valid else (2,)))
    lines = [line for line in ended.err.splitlines() if not line.startswith("note: ")]
    if not faults and ended.code == 2 and (len(lines) != 1 or ended.out):
        faults = [f"expected one line of an error, got {ended.out + ended.err!r}"]
    elif not faults and ended.code == 0:
        faults = [f"expected an answer alone, got {lines!r}"] if lines else []
        faults += answer_faults(command[0], json.loads(ended.out))
    return [f"{name}: {fault}" for fault in faults]


def answer_faults(command: str, answer: Any) -> list[str]:
    """List faults in the JSON of a command."""
    if command == "rest":
        probabilities = [rest["probability"] for rest in answer["rests"]]
        if not (min(probabilities) >= 0.0 and abs(math.fsum(probabilities) - 1.0) <= SUM_LIMIT):
            return [f"probabilities {probabilities} that sum to {math.fsum(probabilities)!r}"]
    if command == "rolls":
        counts = [outcome["count"] for outcome in answer["outcomes"]]
        if sum(counts) != answer["throws"] or min(counts) < 0:
            return [f"counts {counts} of {answer['throws']} throws"]
    return []


def damage(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """Change the content of a file at random. other: content of a file whose pieces may be used."""
    place = int(rng.integers(len(data) + 1))
    head, tail = data[:place], data[place:]
    first, last = sorted(rng.integers(len(other) + 1, size=2).tolist())
    flipped = bytearray(data)
    for bit in rng.integers(8 * len(data), size=rng.integers(1, 20)).tolist() if data else ():
        flipped[bit // 8] ^= 1 << bit % 8
    numbers = list(re.finditer(rb"-?\d[\d.]*(?:e[-+]?\d+)?", data)) or [re.search(b"$", data)]
    number = numbers[rng.integers(len(numbers))]
    renumbered = data[: number.start()] + NUMBERS[rng.integers(len(NUMBERS))] + data[number.end() :]
    lines = data.splitlines(keepends=True) or [b""]
    line = int(rng.integers(len(lines)))
    times = int(rng.choice([1, 2, 5000])) if len(lines[line]) < 500 else 1
    variants = (
        bytes(flipped),
        head,
        head + tail[rng.integers(1, 60) :],
        head + other[first:last] + tail,
        renumbered,
        renumbered,
        head + PIECES[rng.integers(len(PIECES))] + tail,
        b"".join([*lines[:line], lines[line] * times, *lines[line:]]),
        head + WORDS[rng.integers(len(WORDS))] + tail[4:],
    )
    return variants[rng.integers(len(variants))]
