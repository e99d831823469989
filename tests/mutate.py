"""Mutation testing: change one operator of the package at a time and see whether a test fails.

Usage: python -m tests.mutate FILE... [--mutants N] [--seed S] [--limit SECONDS]

Works in a copy of the repository. Tests of the mirrored folder come first, then those that import
the file, then those that import a module that imports it. Each runs once on the unchanged package,
which records its seconds and the functions that it calls, kept in `.pytest_cache` until its file
changes. Of these, a mutant is run against tests that call its function, the fastest first, until
one fails.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import importlib
import json
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import pytest

from tests.common.mutants import EQUIVALENT, Mutant, pick
from tests.common.paths import ROOT

LONGEST_TEST = 15
"""Seconds after which a test of the unchanged package is stopped and not used."""

MAX_RECORDING = 120.0
"""Seconds after which the tests of a file that have not run yet are not used."""

START_UP = 40.0
"""Seconds that a run of tests may take besides the tests."""

PATIENCE = 2.0
"""Factor of the expected seconds after which a mutant counts as killed by the clock."""

PRELOADED = ("torch", "scipy.optimize", "scipy.stats", "scipy.spatial", "manifold3d", "trimesh")
"""Imported once; each run of tests is a fork."""


@cache
def imports(path: Path) -> set[str]:
    """Modules and names that a file imports anywhere, and those of the tests' own modules."""
    names = set[str]()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    own = [ROOT / "tests" / f"{name.replace('.', '/')}.py" for name in names]
    return names.union(*(imports(each) for each in own if each.is_file()))


def stages_of(path: Path) -> list[list[Path]]:
    """Files of tests in the order in which they are tried."""
    stub = ast.parse((ROOT / "dicedesign/__init__.pyi").read_text())
    froms = [node for node in ast.walk(stub) if isinstance(node, ast.ImportFrom)]
    public = {f"dicedesign.{a.name}": f"dicedesign.{n.module}" for n in froms for a in n.names}
    module = ".".join(path.with_suffix("").parts)
    package = [each.relative_to(ROOT) for each in (ROOT / "dicedesign").rglob("*.py")]
    users = {".".join(p.with_suffix("").parts) for p in package if module in imports(ROOT / p)}
    stages: list[list[Path]] = [[], [], []]
    for test in sorted((ROOT / "tests").rglob("test_*.py")):
        names = {public.get(name, name) for name in imports(test)}
        if test.parent != ROOT / "tests" and not {"soak", "shipped"} & set(test.parts):
            stage = 1 if module in names else 2 if names & users else 3
            place = 0 if test.relative_to(ROOT).parts[1] == path.parts[1] else stage
            if place < 3:
                stages[place].append(test.relative_to(ROOT))
    return stages


class Watch:
    """Plugin of pytest that selects tests, in order, and writes a line for each that has ended.

    wanted: tests to run; None for all, each for at most `LONGEST_TEST` and with its calls recorded.
    """

    def __init__(self, out: Path, wanted: list[str] | None) -> None:
        self.out, self.wanted, self.outcomes = out, wanted, set[str]()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        if self.wanted is not None:
            order = {name: place for place, name in enumerate(self.wanted)}
            items[:] = [item for item in items if item.nodeid in order]
            items.sort(key=lambda item: order[item.nodeid])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.outcomes.add(report.outcome)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.outcomes, codes, started = set(), set[CodeType](), time.perf_counter()
        if self.wanted is None:
            signal.alarm(LONGEST_TEST)
            threading.settrace(lambda frame, *_: codes.add(frame.f_code))
            sys.settrace(lambda frame, *_: codes.add(frame.f_code))
        try:
            return (yield)
        finally:
            threading.settrace(None)
            sys.settrace(None)
            signal.alarm(0)
            package = f"{Path.cwd()}/dicedesign/"
            calls = [code for code in codes if code.co_filename.startswith(package)]
            names = [f"{c.co_filename.removeprefix(package)}:{c.co_qualname}" for c in calls]
            has_passed = self.outcomes == {"passed"}
            state = item.nodeid, has_passed, time.perf_counter() - started, names
            with self.out.open("a") as file:
                file.write(json.dumps(state) + "\n")


def stop_test(*_: object) -> None:
    raise TimeoutError


class Known(NamedTuple):
    """A test that passes on the unchanged package."""

    name: str
    seconds: float
    calls: list[str]


def run_tests(copy: Path, wanted: list[str] | Path, limit: float) -> tuple[int | None, list[Any]]:
    """Run tests by name until one fails, or all of a file, in a fork. Returns the exit status of
    pytest, None past the limit in seconds, and the entries of `Watch`."""
    out = copy.parent / "entries"
    out.write_text("")
    child = os.fork()
    if child == 0:
        os.setsid()
        with open(os.devnull, "w") as nothing:
            os.dup2(nothing.fileno(), 1)
            os.dup2(nothing.fileno(), 2)
        signal.signal(signal.SIGALRM, stop_test)
        names = None if isinstance(wanted, Path) else wanted
        files = [str(wanted)] if names is None else [n.partition("::")[0] for n in names]
        stop = ["--maxfail=0" if names is None else "-x", "-n", "0", "-p", "no:cacheprovider"]
        os._exit(int(pytest.main([*dict.fromkeys(files), *stop], plugins=[Watch(out, names)])))
    ends, status = time.monotonic() + limit, None
    while status is None and time.monotonic() < ends:
        time.sleep(0.02)
        done, code = os.waitpid(child, os.WNOHANG)
        status = os.waitstatus_to_exitcode(code) if done else None
    # Processes that tests have started end with it.
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    if status is None:
        os.waitpid(child, 0)
    return status, [json.loads(line) for line in out.read_text().splitlines()]


def record(copy: Path, path: Path) -> list[Known]:
    """Tests of a file that pass on the unchanged package; from the cache if possible."""
    digest = hashlib.sha256(f"{path}".encode() + (ROOT / path).read_bytes()).hexdigest()
    cache = ROOT / ".pytest_cache" / "mutate" / digest
    if not cache.exists():
        cache.parent.mkdir(parents=True, exist_ok=True)
        cache.write_text(json.dumps(run_tests(copy, path, MAX_RECORDING)[1]))
    entries = json.loads(cache.read_text())
    return [Known(name, *entry) for name, has_passed, *entry in entries if has_passed]


def judge(copy: Path, mutant: Mutant, limit: float, stages: int) -> str:
    """Run tests that call the function of a mutant, for a limit of seconds; what became of it."""
    call, tried = f"{mutant.path.relative_to('dicedesign')}:{mutant.owner}", 0
    source, place = (ROOT / mutant.path).read_bytes(), copy / mutant.path
    for stage in stages_of(mutant.path)[:stages]:
        chosen = list[Known]()
        known = [test for path in stage for test in record(copy, path)]
        for test in sorted(known, key=lambda test: test.seconds):
            # What is outside of functions is called by all that call any function of the file.
            calls = test.calls if mutant.owner else [each[: len(call)] for each in test.calls]
            if call in calls and (not tried or test.seconds <= limit):
                chosen.append(test)
                limit, tried = limit - test.seconds, tried + 1
        if not chosen:
            continue
        names, seconds = [test.name for test in chosen], sum(test.seconds for test in chosen)
        place.write_bytes(source[: mutant.start] + mutant.text.encode() + source[mutant.end :])
        # Compiled files are made anew only if the time of change is another.
        os.utime(place, (hash(mutant) % 2**31,) * 2)
        status, entries = run_tests(copy, names, START_UP + PATIENCE * seconds)
        place.write_bytes(source)
        if status != 0:
            by = entries[-1][0] if entries else "the import"
            return f"killed by {'the clock' if status is None else by}"
    return f"SURVIVED {tried} tests"


def main() -> None:
    parser = argparse.ArgumentParser(description="Change one operator at a time; run the tests.")
    parser.add_argument("files", nargs="+", type=Path, help="files of dicedesign/")
    parser.add_argument("--mutants", type=int, default=20, help="number of mutants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=40.0, help="seconds of tests of a mutant")
    parser.add_argument("--stages", type=int, default=3, help="1 for tests of the mirrored folder")
    given = parser.parse_args()
    files = [each.resolve().relative_to(ROOT) for each in given.files]
    mutants = pick(files, given.mutants, given.seed)
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "__pycache__", "outputs"))
        work_in(copy)
        for one in mutants:
            started = time.monotonic()
            file = str(one.path.relative_to("dicedesign"))
            reason = EQUIVALENT.get((file, one.source, one.change))
            end = f"equivalent: {reason}" if reason else judge(copy, one, given.limit, given.stages)
            seconds = time.monotonic() - started
            print(f"{one.path}:{one.line}  {one.change}  {end}  {seconds:.0f} s", flush=True)
            counts[str(one.path.parts[1])][end.split()[0].strip(":")] += 1
    for room, ends in sorted(counts.items()):
        print(f"{room}: {', '.join(f'{number} {end}' for end, number in sorted(ends.items()))}")


def work_in(copy: Path) -> None:
    """Let forks and their processes import the package and the tests from a copy."""
    os.chdir(copy)
    sys.path[:] = [str(copy), *(path for path in sys.path if Path(path).resolve() != ROOT)]
    others = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    os.environ["PYTHONPATH"] = os.pathsep.join([str(copy), *(p for p in others if p)])
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
        del sys.modules[name]
    for name in PRELOADED:
        importlib.import_module(name)


if __name__ == "__main__":
    main()
