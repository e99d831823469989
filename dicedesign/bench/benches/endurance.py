"""A soak: very many meshes, runs and damaged files, with processes killed on the way."""

from __future__ import annotations

import signal
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, ClassVar

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column, hidden, percent

if TYPE_CHECKING:
    from dicedesign.bench.endurance.commands import Fault, Tried

__all__ = ["Extent", "FaultRow", "SoakRow"]


@dataclass(frozen=True)
class Extent:
    """How many of each there are, the number of the first run and file, the seed of all, processes
    side by side, and seconds between the deaths of two workers."""

    meshes: int
    runs: int
    files: int
    first: int
    seed: int
    jobs: int
    kill_seconds: float


@dataclass(frozen=True)
class SoakRow(Row):
    """A part of the soak.

    Attributes
    ----------
    part: its name. tried: meshes, recipes or files.
    killed: processes that got a signal on purpose.
    hangs, tracebacks, wrong, lost: faults; see `dicedesign.bench.endurance.commands.Kind`.
    growth: of a worker's memory from the second quarter of the time to the last, as a part; None
        where the processes live too shortly, or the system does not tell.
    seconds: that it took.
    """

    table: ClassVar[str | None] = "parts"

    part: str = column("part", -22)
    tried: int = column("tried", 9, ",d")
    killed: int = column("killed", 8, ",d")
    hangs: int = column("hangs", 7)
    tracebacks: int = column("tracebacks", 12)
    wrong: int = column("wrong", 7)
    lost: int = column("lost", 6)
    growth: float | None = column("memory +%", 11, percent(1))
    seconds: float = column("s", 9, ".0f")
    workers_mb: float | None = hidden(default=None)
    parent_mb: float | None = hidden(default=None)
    table_mb: float | None = hidden(default=None)

    @property
    def faults(self) -> int:
        """All together."""
        return self.hangs + self.tracebacks + self.wrong + self.lost


@dataclass(frozen=True)
class FaultRow(Row):
    """A fault. number: of the run or file, for `--first`; None of a mesh."""

    table: ClassVar[str | None] = "faults"

    part: str = column("part", -22)
    number: int | None = column("number", 9)
    kind: str = column("kind", 11)
    what: str = column("what", 0)


MOST_GROWTH = 0.1
"""Memory counts as flat up to here."""


def _rows(run: Run) -> Items:
    from dicedesign.bench.endurance.commands import require_signals

    require_signals()
    extent: Extent = run.extent
    with _ended_by_signals(), TemporaryDirectory() as name:
        root = Path(name)
        good = []
        for part in (_batch, _runs, _files):
            folder = root / part.__name__
            folder.mkdir()
            good.append((yield from part(run, extent, folder)))
    return all(good)


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Interrupts and terminations unwind the bench, which ends its processes then, and reach these
    even where the shell ignores them."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, signal.default_int_handler) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def _batch(run: Run, extent: Extent, folder: Path) -> Items:
    from dicedesign.bench.endurance.batch import batch_faults, make_meshes, run_batches

    meshes, table = folder / "meshes", folder / "table" / "rests.csv"
    meshes.mkdir()
    table.parent.mkdir()
    run.begin("making meshes")
    answers = make_meshes(meshes, extent.meshes, extent.seed, run.advance)
    run.begin("meshes")
    started = time.perf_counter()
    batch = run_batches(meshes, table, extent.jobs, extent.meshes, extent.seed, extent.kill_seconds)
    seconds = time.perf_counter() - started
    faults = [*batch.faults, *batch_faults(table, answers)]
    part = "meshes of a folder"
    yield from (FaultRow(part, None, fault.kind, fault.what) for fault in faults)
    largest = max((max(sizes) for sizes in batch.workers.values() if sizes), default=None)
    parent = max(batch.parent, default=None)
    sizes = (largest, parent, batch.table_mb)
    counts = _counts(faults)
    row = SoakRow(part, extent.meshes, batch.signals, *counts, batch.growth, seconds, *sizes)
    yield row
    if largest is None or parent is None:
        run.note("the memory of processes is known only where there is a /proc, as on Linux")
    else:
        yield (
            f"workers held {largest:.0f} MB at most, the process that hands out the work "
            f"{parent:.0f} MB, for a table of {batch.table_mb:.0f} MB"
        )
    return row.faults == 0 and (row.growth or 0.0) <= MOST_GROWTH


def _counts(faults: Sequence[Fault]) -> tuple[int, int, int, int]:
    """How many there are of each kind."""
    hangs, tracebacks, wrong, lost = (
        sum(fault.kind == kind for fault in faults)
        for kind in ("hang", "traceback", "wrong", "lost")
    )
    return hangs, tracebacks, wrong, lost


def _runs(run: Run, extent: Extent, folder: Path) -> Items:
    from dicedesign.bench.endurance.commands import drive
    from dicedesign.bench.endurance.runs import run_cases

    numbers = range(extent.first, extent.first + extent.runs)
    run.begin("runs")
    cases, printed = run_cases(folder, numbers, extent.seed), _made(folder / "printed")
    return (yield from _driven(run, "runs of recipes", drive(cases, printed, extent.jobs)))


def _files(run: Run, extent: Extent, folder: Path) -> Items:
    from dicedesign.bench.endurance.commands import drive
    from dicedesign.bench.endurance.files import Samples, file_cases

    numbers = range(extent.first, extent.first + extent.files)
    run.begin("files")
    samples, printed = Samples(_made(folder / "samples")), _made(folder / "printed")
    cases = file_cases(samples, numbers, extent.seed)
    return (yield from _driven(run, "damaged files", drive(cases, printed, extent.jobs)))


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _driven(run: Run, part: str, tried: Generator[Tried, None, None]) -> Items:
    """The faults of cases as they come, then the row of all."""
    started, count, killed, faults = time.perf_counter(), 0, 0, []
    with closing(tried):
        for one in tried:
            run.advance()
            count += 1
            killed += one.killed
            faults += one.faults
            yield from (FaultRow(part, one.number, each.kind, each.what) for each in one.faults)
    row = SoakRow(part, count, killed, *_counts(faults), None, time.perf_counter() - started)
    yield row
    return row.faults == 0


_AMOUNTS = (
    Amount("meshes", "N", "meshes in the folder, one in fifty of them broken"),
    Amount("runs", "N", "random recipes, one in ten of them broken"),
    Amount("files", "N", "damaged files"),
    Amount("first", "N", "number of the first recipe and of the first file", least=0),
    Amount("seed", "S", "of everything random", least=0),
    Amount("jobs", "N", "processes side by side"),
    Amount("kill_seconds", "S", "seconds between the deaths of two workers", kind=float),
)

BENCHES.register(
    Bench(
        name="endurance",
        line="very many meshes, runs and damaged files, with processes killed on the way",
        description="Give the program very many meshes in one folder, random recipes and damaged "
        "files, kill its processes on the way, and count hangs, tracebacks, wrong answers, lost "
        "or half-written results, and the growth of memory. What is made depends on the seed "
        "alone; the moments of signals are parts of the time that the same run took when left "
        "alone.",
        rows=_rows,
        full=Extent(100_000, 1_000, 20_000, first=0, seed=0, jobs=2, kill_seconds=60.0),
        quick=Extent(500, 3, 42, first=0, seed=0, jobs=2, kill_seconds=2.0),
        amounts=_AMOUNTS,
        packages=("numpy", "scipy", "torch"),
        torch=False,
        unit="cases",
    )
)
