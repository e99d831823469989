"""The frame of all benches: it makes their command lines, prints their tables or JSON, shows their
progress and writes their figures."""

from __future__ import annotations

import argparse
import dataclasses
import os
import platform
import sys
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from dicedesign.bench.options import Amount, Option
from dicedesign.bench.rows import Row, plain
from dicedesign.errors import InputError
from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension
from dicedesign.runtime.workers import one_tensor_thread

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper
    from dicedesign.runtime.workers import Workers

__all__ = [
    "BENCHES",
    "RESULTS",
    "Bench",
    "Item",
    "Items",
    "Run",
    "add_options",
    "execute",
    "machine_description",
]

RESULTS: Final = Path("outputs/bench")
"""Where benches leave their figures and JSON files that do so without being asked."""

Item: TypeAlias = Row | str | Mapping[str, Any]

"""What a bench yields: rows; lines that only the printed tables have; entries that only JSON
has."""

Items: TypeAlias = Generator[Item, None, bool]
"""Items of a bench that returns whether what was measured is as it should be, or the exit code is
1."""


@dataclass(frozen=True, kw_only=True)
class Bench(Extension):
    """A measurement of the product itself.

    Attributes
    ----------
    name: of the command `dicedesign bench NAME`; line: of documentation.
    description: what it does, for `--help`.
    rows: makes the rows and what stands between them, see `Items`; bad input is raised before the
        first.
    full, quick: how much is measured, and with `--quick`: objects of one frozen dataclass.
    amounts: options that replace fields of these.
    options: arguments and further options.
    packages: whose versions tell what was measured.
    workers: help of `--jobs` for a bench with work for many processes; "" for none.
    engine: whether it takes the option `--engine`.
    torch: whether it computes with torch, which is to take one thread.
    unit: of the progress, in the plural.
    figure: drawn of all rows, if any.
    results: folder for figure and JSON file where none is asked for; None to write neither.
    """

    description: str
    rows: Callable[[Run], Iterator[Item]]
    full: Any
    quick: Any
    amounts: tuple[Amount, ...] = ()
    options: tuple[Option, ...] = ()
    packages: tuple[str, ...] = ("numpy", "scipy")
    workers: str = ""
    engine: bool = False
    torch: bool = True
    unit: str = "rows"
    figure: Callable[[Sequence[Any], Run], Paper] | None = None
    results: Path | None = None


BENCHES: Final = FolderRegistry[Bench]("bench", "dicedesign.bench.benches", Bench)
"""All benches."""


class Run:
    """One run of a bench: what was asked for, its workers, and a bar on stderr.

    Attributes
    ----------
    options: of the command line, by name.
    extent: how much is to be measured.
    """

    def __init__(self, extent: Any, executor: Executor | None = None, **options: Any) -> None:
        """executor: does the work for many processes; by default those of the options."""
        self.extent = extent
        self.options = argparse.Namespace(**options)
        self.bar: Any = None
        self._executor = executor
        self._workers: Workers | None = None

    def begin(self, text: str) -> None:
        """Say what is measured from now on."""
        bar = self.bar if self._workers is None else self._workers.bar
        if bar is not None:
            bar.set_description_str(text)

    def advance(self, count: int = 1) -> None:
        """So many more pieces of work are done."""
        if self._workers is not None:
            self._workers.advance(count)
        elif self.bar is not None:
            self.bar.update(count)

    def on_quiet(self) -> None:
        """Say where workers of a cluster have gone."""
        if self._workers is not None:
            self._workers.on_quiet()

    def note(self, text: str) -> None:
        """Say on stderr what is to be known of the run."""
        print(f"note: {text}", file=sys.stderr)

    @contextmanager
    def workers(self, unit: str, total: int) -> Iterator[Executor]:
        """Workers for so many pieces of work; unit: what these are, in the plural."""
        if self._executor is not None:
            yield self._executor
            return
        from dicedesign.runtime.workers import open_workers

        jobs, scheduler = self.options.jobs, self.options.scheduler
        with open_workers(unit, total, jobs=jobs, scheduler=scheduler) as self._workers:
            yield self._workers.executor
        self._workers = None


def add_options(parser: argparse.ArgumentParser, bench: Bench) -> None:
    """Add the arguments and options of a bench, but those of workers and engines."""
    for option in bench.options:
        parser.add_argument(option.name, help=option.help, **option.settings)
    for amount in bench.amounts:
        parser.add_argument(
            amount.option,
            dest=amount.name,
            type=amount.kind,
            metavar=amount.metavar,
            help=amount.help + _defaults(bench, amount.name),
        )
    parser.add_argument("--quick", action="store_true", help="only a part, in about a minute")
    if bench.figure is not None:
        parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw a figure")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help=f"folder for {'' if bench.figure is None else f'{bench.name}.png and '}"
        f"{bench.name}.json (default: {bench.results or 'write none'}; quick: write none)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")


def _defaults(bench: Bench, name: str) -> str:
    full, quick = getattr(bench.full, name), getattr(bench.quick, name)
    if full is None:
        return ""
    return f" (default: {full:,})" if full == quick else f" (default: {full:,}; quick: {quick:,})"


def execute(bench: Bench, options: argparse.Namespace, executor: Executor | None = None) -> int:
    """Run a bench by its options, print what it yields and return the exit code.

    executor: as in `Run`. Raises InputError and OutputError before anything is measured, and
    OutputError where the results cannot be written any more, after they have been printed.
    """
    from dicedesign.runtime.files import json_text, make_writable_folder
    from dicedesign.runtime.workers import progress_bar

    if options.out is None and not options.quick:
        options.out = bench.results
    given = vars(options)
    run = Run(_extent(bench, given), executor, **given)
    if bench.figure is not None:
        _require_folder_of(options.figure)
    if options.out is not None:
        make_writable_folder(options.out)
    sheet = _Sheet(show=not options.json)
    threads = one_tensor_thread() if bench.torch else nullcontext()
    bar: Any = nullcontext() if bench.workers else progress_bar(bench.unit)
    with threads, bar as run.bar:
        is_good = sheet.gather(bench.rows(run))
    described = {**machine_description("dicedesign", *bench.packages), **plain(run.extent)}
    text = json_text({**described, **sheet.record})
    if options.json:
        print(text, end="", flush=True)
    _write(bench, run, sheet.rows, text)
    return 0 if is_good else 1


def _extent(bench: Bench, given: Mapping[str, Any]) -> Any:
    extent = bench.quick if given["quick"] else bench.full
    for amount in bench.amounts:
        if given[amount.name] is not None:
            amount.check(given[amount.name])
            extent = dataclasses.replace(extent, **{amount.name: given[amount.name]})
    return extent


def _require_folder_of(path: Path | None) -> None:
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise InputError(
            f"--figure: expected a file in a folder that exists, got {path}; create the folder or "
            "choose another"
        )


class _Sheet:
    """Prints what a bench yields above the bar, and gathers it for JSON and figure."""

    def __init__(self, *, show: bool) -> None:
        self.rows: list[Row] = []
        self.record: dict[str, Any] = {}
        self._show = show
        self._above: type[Row] | None = None

    def gather(self, items: Iterator[Item]) -> bool:
        """Take all items, and return whether they are good."""
        while True:
            try:
                self._add(next(items))
            except StopIteration as end:
                return end.value is not False

    def _add(self, item: Item) -> None:
        if isinstance(item, Row):
            self.rows.append(item)
            if item.table is not None:
                self.record.setdefault(item.table, []).append(plain(item))
            if item.printed:
                self._print_row(item)
        elif isinstance(item, str):
            self._above = None
            self._print(item)
        else:
            self.record |= plain(item)

    def _print_row(self, row: Row) -> None:
        if type(row) is not self._above:
            self._print(("" if self._above is None else "\n") + row.heading())
            self._above = type(row)
        self._print(row.line())

    def _print(self, text: str) -> None:
        from tqdm import tqdm

        if self._show:
            with tqdm.external_write_mode(sys.stdout):
                print(text, flush=True)


def _write(bench: Bench, run: Run, rows: Sequence[Row], text: str) -> None:
    """Write the figure and the JSON text that were asked for, and say so."""
    from dicedesign.runtime.files import atomic_write

    folder, written = run.options.out, []
    drawn = None if bench.figure is None else run.options.figure
    if bench.figure is not None and (drawn is not None or folder is not None):
        data = bench.figure(rows, run).png()
        for path in (drawn, folder and folder / f"{bench.name}.png"):
            if path is not None:
                atomic_write(path, data)
                written.append(str(path))
    if folder is not None:
        atomic_write(folder / f"{bench.name}.json", text.encode())
        written.append(str(folder / f"{bench.name}.json"))
    if written:
        print(f"wrote {' and '.join(written)}", file=sys.stderr if run.options.json else sys.stdout)


def machine_description(*packages: str) -> dict[str, str]:
    """The date (UTC), the machine without names of users or folders, and the versions of Python and
    of packages; those that are not installed are left out."""
    described = {
        "date": datetime.now(UTC).date().isoformat(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count() or 1} cores",
        "python": platform.python_version(),
    }
    for package in packages:
        try:
            described[package] = version(package)
        except PackageNotFoundError:
            continue
    return described
