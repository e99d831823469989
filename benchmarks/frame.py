"""What all benches share: options, tables and JSON on stdout, pictures, timing, processes.

A bench is a module of this folder that `BENCHES` names. The first line of its docstring says what
it measures, the rest is the description of `--help`. It has `run(options, report)`, which returns
whether all is as it should be, and may have `add_options(parser)` for options beside `--quick`,
`--json`, `--jobs`, `--out` and `--record`. `python -m benchmarks all` runs again whatever made the
tables in `RECORDED`, which the pages of docs/ show; with --quick it runs every bench in short form.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import platform
import re
import secrets
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime
from glob import glob
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from itertools import chain
from multiprocessing import TimeoutError as NoAnswer
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import Any

import numpy as np

from dicedesign import DiceError, Recipe, read_recipe
from dicedesign.recipe.pipeline import Work, run_stages

BENCHES = (
    "accuracy",
    "codes",
    "concave",
    "default_dice",
    "design",
    "exact",
    "figure_10",
    "finished",
    "gallery",
    "gradients",
    "speed",
    "stability",
    "starts",
    "table",
    "thrown",
    "train",
)

RECORDED = Path(__file__).with_name("recorded.json")
"""Tables of the pages, by the names of bench and table: title and texts of each column, command,
date and machine."""

PACKAGES = ("dicedesign", "numpy", "scipy", "torch", "trimesh", "manifold3d", "mujoco")
"""Whose versions are recorded."""


class Report:
    """Prints tables as their rows come, and keeps everything for JSON.

    Attributes
    ----------
    record: what JSON will have, tables as lists of rows.
    texts: tables as printed, by name: titles, then rows.
    figure: of matplotlib, to be saved beside it, if a bench sets one.
    """

    def __init__(self, *, show: bool) -> None:
        self.record: dict[str, Any] = {}
        self.texts: dict[str, list[list[str]]] = {}
        self.figure: Any = None
        self._show = show
        self._last = ""

    def table(self, name: str, columns: str) -> Callable[..., None]:
        """A function that adds a row: a value for each column.

        columns: titles and formats, which begin with the width, such as "recipe 28s | error 9.1e".
        None and what is not finite are printed as "-".
        """
        titles, forms = zip(*(one.rsplit(" ", 1) for one in columns.split(" | ")), strict=True)
        # As wide as its title or its values, texts to the left.
        sizes = [int(re.match("[0-9]+", form)[0]) for form in forms]
        places = [
            f"{'<' if form.endswith('s') else '>'}{max(size, len(title))}"
            for title, form, size in zip(titles, forms, sizes, strict=True)
        ]

        def add(*values: Any) -> None:
            self.record.setdefault(name, []).append(dict(zip(titles, values, strict=True)))
            if name != self._last:
                self.line("\n" + " ".join(map(format, titles, places)))
                self._last = name
            is_missing = [
                value is None or (isinstance(value, float) and not np.isfinite(value))
                for value in values
            ]
            cells = [
                "-" if missing else format(value, form)
                for value, form, missing in zip(values, forms, is_missing, strict=True)
            ]
            texts = self.texts.setdefault(name, [list(titles)])
            texts.append([cell.strip() for cell in cells])
            self._print(" ".join(map(format, cells, places)).rstrip())

        return add

    def line(self, text: str) -> None:
        """Print a line that only people read."""
        self._last = ""
        self._print(text)

    def _print(self, text: str) -> None:
        if self._show:
            print(text, flush=True)


def parser_of(name: str | None) -> argparse.ArgumentParser:
    """The command line, with a bench or with all of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measurements.")
    benches = parser.add_subparsers(title="benches", required=True, metavar="NAME", dest="name")
    for one in BENCHES if name is None else (name,):
        module = import_module(f"benchmarks.{one}")
        line, _, description = (module.__doc__ or "").partition("\n")
        _add_options(
            benches.add_parser(one, help=line, description=f"{line}\n{description}"), module
        )
    return parser


def main(arguments: Sequence[str]) -> int:
    """Run a bench: exit code 0 where all is as it should be, 1 where not, 2 for bad input."""
    if arguments[:1] == ["all"]:
        names = [argument for argument in arguments[1:] if argument in BENCHES]
        if set(arguments[1:]) <= {"--quick", *names}:
            return run_all(names, quick="--quick" in arguments)
    name = arguments[0] if arguments and arguments[0] in BENCHES else None
    options = parser_of(name).parse_args(arguments)
    report = Report(show=not options.json)
    try:
        is_good = bool(options.run(options, report))
    except DiceError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 2
    text = json.dumps({**_description(), **report.record}, default=_plain, indent=1)
    if options.json:
        print(text)
    if options.record:
        record(report, shlex.join(arg for arg in arguments if arg != "--record"))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / f"{options.name}.json").write_text(text + "\n")
        if report.figure is not None:
            report.figure.savefig(options.out / f"bench_{options.name}.png", dpi=110)
    return 0 if is_good else 1


def record(report: Report, arguments: str) -> None:
    """Write the tables of a run that pages show into `RECORDED`, and into these."""
    name, described = arguments.split()[0], _description()
    recorded = json.loads(RECORDED.read_text())
    pages = RECORDED.parents[1] / "docs"
    shown = "".join(page.read_text(encoding="utf-8") for page in pages.glob("*.md"))
    for table, (titles, *rows) in report.texts.items():
        if f"<!-- table: {name} {table} -->" not in shown:
            continue
        recorded[f"{name} {table}"] = {
            "command": f"python -m benchmarks {arguments}",
            "date": described["date"],
            "machine": described["machine"],
            "titles": titles,
            "rows": rows,
        }
    text = json.dumps(dict(sorted(recorded.items())), indent=1)
    # A row is a line.
    text = re.sub(r"\[\s+([^][]*?)\s+\]", lambda row: f"[{' '.join(row[1].split())}]", text)
    RECORDED.write_text(text + "\n")
    rewrite = RECORDED.parents[1] / "tests" / "docs" / "generated_tables.py"
    subprocess.run([sys.executable, str(rewrite)], check=True)


def run_all(names: Sequence[str], *, quick: bool) -> int:
    """Run again each command that made recorded tables, and record them; or run the commands at the
    top of docs/numbers.md in short form. 1 or 2 where one of them is not as it should be.

    names: of the benches that are run; all if there are none.
    """
    commands = [table["command"] for table in json.loads(RECORDED.read_text()).values()]
    if quick:
        page = RECORDED.parents[1] / "docs" / "numbers.md"
        commands = re.findall("^python -m benchmarks .*", page.read_text(encoding="utf-8"), re.M)
    codes = []
    for command in dict.fromkeys(commands):
        if names and shlex.split(command)[3] not in names:
            continue
        print(f"\n{command}", flush=True)
        start = time.perf_counter()
        paths = [sorted(glob(word)) or [word] for word in shlex.split(command)[3:]]
        codes.append(main([*chain(*paths), "--quick" if quick else "--record"]))
        print(f"{time.perf_counter() - start:.0f} s", flush=True)
    return max(codes)


def _add_options(parser: argparse.ArgumentParser, module: ModuleType) -> None:
    if hasattr(module, "add_options"):
        module.add_options(parser)
    parser.add_argument("--quick", action="store_true", help="only a part, in about a minute")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), metavar="N", help="processes (default: cores)"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for JSON and a picture")
    parser.add_argument(
        "--record", action="store_true", help=f"write the tables into {RECORDED.name} and the pages"
    )
    parser.set_defaults(run=module.run)


def _description() -> dict[str, str]:
    """The date (UTC), the machine without names of users or folders, and versions."""
    described = {
        "date": datetime.now(UTC).date().isoformat(),
        "machine": f"{os.cpu_count()} cores of {_processor()}, {platform.system()}",
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            described[package] = version(package)
        except PackageNotFoundError:
            continue
    return described


def _processor() -> str:
    """Model of the processor, where the system says it."""
    try:
        return re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())[1].strip()
    except (OSError, TypeError):
        return platform.machine()


def _plain(value: Any) -> Any:
    """What JSON has no form for: arrays as lists, others as text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def panels(count: int, columns: int, size: tuple[float, float] = (5.0, 3.8)) -> tuple[Any, Any]:
    """A figure and its axes, one after the other; those beyond the count are blank."""
    from matplotlib.figure import Figure

    rows = -(-count // columns)
    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for blank in axes[count:]:
        blank.axis("off")
    return figure, axes[:count]


def processes(jobs: int) -> ProcessPoolExecutor:
    """So many processes for tasks that can be pickled."""
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))


class Watched:
    """Calls functions in a process of its own, which is replaced when it hangs or dies."""

    def __enter__(self) -> Watched:
        self._pool = get_context("spawn").Pool(1)
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.terminate()

    def call(self, seconds: float, function: Callable[..., Any], *arguments: Any) -> Any:
        """`function(*arguments)`. Raises what that raises, and NoAnswer after so many seconds."""
        try:
            return self._pool.apply_async(function, arguments).get(seconds)
        except NoAnswer:
            self._pool.terminate()
            self._pool = get_context("spawn").Pool(1)
            raise NoAnswer(f"no answer in {seconds:g} s, or its process died") from None


def time_in_turn(
    actions: Sequence[Callable[[], Any]], seconds: float, *, rounds: int = 5, row: float = 0.0
) -> list[float]:
    """Median processor seconds of each action. They are called in rounds, in random order, so that
    what slows the machine falls on all alike; a first call of each is not counted.

    seconds: of all rounds together, about; rounds: how many at least.
    row: seconds for which an action is called again and again when its turn comes; all calls but
        the first count. At 0 it is called once, and pays for caches that the one before it filled.
    """
    taken: list[list[float]] = [[] for _ in actions]
    for action in actions:
        action()
    order = np.random.default_rng(0)
    was_collecting = gc.isenabled()
    gc.disable()
    end = time.process_time() + seconds
    try:
        while rounds > 0 or time.process_time() < end:
            rounds -= 1
            for index in order.permutation(len(actions)):
                taken[index] += _repeat(actions[index], row)
    finally:
        if was_collecting:
            gc.enable()
    return [median(times) for times in taken]


def _repeat(action: Callable[[], Any], row: float) -> list[float]:
    """Seconds of an action's calls in a row."""
    if row > 0.0:
        action()
    times: list[float] = []
    end = time.process_time() + row
    while not times or time.process_time() < end:
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return times


def make_die(recipe: Recipe, last: str = "check", *, enlarge: bool = False) -> Work:
    """The work of a recipe up to and with a stage; nothing is written. Raises NoStartError where
    nothing leads there, InputError where the start does not suit the target.

    enlarge: see `Work`.
    """
    work = Work(recipe, enlarge=enlarge)
    run_stages(work, last=last)
    return work


def with_method(recipe: Recipe, **options: Any) -> Recipe:
    """The recipe with other options of its methods, by the methods' names; None leaves one out."""
    return recipe.model_copy(update={"method": recipe.method.model_copy(update=options)})


def add_recipes(parser: argparse.ArgumentParser, nargs: str = "+") -> None:
    """The argument `recipes`."""
    parser.add_argument("recipes", nargs=nargs, type=Path, metavar="RECIPE.yaml or FOLDER")


def add_seeds(parser: argparse.ArgumentParser) -> None:
    """The options `--seeds` and `--fresh`."""
    parser.add_argument("--seeds", type=int, metavar="N", help="from 0 on (default: 10; quick: 1)")
    parser.add_argument(
        "--fresh", type=int, metavar="N", help="that nobody chose (default: 10; quick: 0)"
    )


def take_seeds(options: argparse.Namespace, report: Report) -> tuple[list[int], list[int]]:
    """Seeds from 0 on, and fresh ones that nobody chose; both are recorded."""
    default = (1, 0) if options.quick else (10, 10)
    fresh = default[1] if options.fresh is None else options.fresh
    seeds = list(range(options.seeds or default[0]))
    drawn = [secrets.randbelow(2**32) for _ in range(fresh)]
    report.record["seeds used"] = seeds + drawn
    return seeds, drawn


def read_recipes(options: argparse.Namespace) -> list[Recipe]:
    """All of them, and of folders those in them; what is wrong with one is said before anything is
    designed."""
    paths = [
        path
        for given in options.recipes
        for path in (sorted(given.glob("*.yaml")) if given.is_dir() else [given])
    ]
    return [read_recipe(path) for path in paths]
