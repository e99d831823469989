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
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
"""Root of the repository."""

EQUIVALENT: dict[tuple[str, str], str] = {}
"""Reasons why mutants change nothing that a user could see, by file and change."""

LONGEST_TEST = 15
"""Seconds after which a test of the unchanged package is stopped and not used."""

MAX_RECORDING = 120.0
"""Seconds after which the tests of a file that have not run yet are not used."""

START_UP = 10.0
"""Seconds that a run of tests may take besides the tests."""

PATIENCE = 2.0
"""Factor of the expected seconds after which a mutant counts as killed by the clock."""

PRELOADED = ("torch", "scipy.optimize", "scipy.stats", "scipy.spatial", "manifold3d", "trimesh")
"""Imported once; each run of tests is a fork."""

SWAPS: dict[type, tuple[type, ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.FloorDiv: (ast.Mult,),
    ast.Pow: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
}

LAST_AXIS = ast.dump(ast.UnaryOp(ast.USub(), ast.Constant(1)))

NAMES = {"min": "max", "minimum": "maximum", "argmin": "argmax", "floor": "ceil", "any": "all"}
NAMES |= {after: before for before, after in NAMES.items()}


class Mutant(NamedTuple):
    """One change of a file: `text` in place of the characters from `start` to `end`.

    owner: qualified name of the function around it, "" outside of functions.
    """

    path: Path
    line: int
    kind: str
    change: str
    start: int
    end: int
    text: str
    owner: str


def changes_of(node: ast.AST) -> Iterator[tuple[str, ast.AST, ast.AST | str]]:
    """Kind of change, node that is replaced, and what with."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        for other in SWAPS.get(type(node.ops[0]), ()):
            yield "compare", node, ast.Compare(node.left, [other()], node.comparators)
    elif isinstance(node, ast.BinOp) and not is_text(node.left) and not is_text(node.right):
        for other in SWAPS.get(type(node.op), ()):
            yield "arithmetic", node, ast.BinOp(node.left, other(), node.right)
    elif isinstance(node, ast.BoolOp):
        for other in SWAPS[type(node.op)]:
            yield "logic", node, ast.BoolOp(other(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub | ast.Invert):
        yield "sign", node, node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "constant", node, ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int):
        yield "constant", node, ast.Constant(node.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float):
        factor = 2.0 if abs(node.value) > 1e-3 else 1e3
        yield "constant", node, ast.Constant(node.value * factor or 1.0)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
        name = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
        if name in NAMES:
            text = ast.unparse(node.func).removesuffix(name) + NAMES[name]
            yield "extreme", node.func, text
    elif isinstance(node, ast.Slice):
        for bound in (node.lower, node.upper):
            if bound is not None and not isinstance(bound, ast.Constant):
                yield "slice", bound, ast.BinOp(bound, ast.Add(), ast.Constant(1))
    elif isinstance(node, ast.If) and isinstance(node.body[-1], ast.Return):
        yield "early", node.body[-1], "pass"


def is_text(node: ast.AST) -> bool:
    """Whether an operand is a text, a list or a type, for which other operators make no sense."""
    known = (ast.JoinedStr, ast.List, ast.Tuple, ast.Dict, ast.Set)
    is_string = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return is_string or isinstance(node, known)


def is_left_alone(node: ast.AST) -> bool:
    """Whether a part holds messages or types only."""
    if isinstance(node, ast.If):
        return ast.unparse(node.test) == "TYPE_CHECKING"
    if isinstance(node, ast.Call):
        return ast.unparse(node.func).split(".")[0] in ("TypeVar", "logging", "warnings")
    alias = isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation) == "TypeAlias"
    return alias or isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert)


def mutants_of(path: Path) -> list[Mutant]:
    """All mutants of a file, given relative to the root."""
    source = (ROOT / path).read_text()
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []

    def visit(node: ast.AST, owner: str, prefix: str) -> None:
        """owner: function around the node; prefix: of the names of those inside of it."""
        if is_left_alone(node):
            return
        for kind, old, new in changes_of(node):
            text = new if isinstance(new, str) else f"({ast.unparse(new)})"
            start = starts[old.lineno - 1] + old.col_offset
            end = starts[old.end_lineno - 1] + old.end_col_offset
            shown = " ".join(f"{ast.unparse(old)} -> {text}".split())
            found.append(Mutant(path, old.lineno, kind, shown, start, end, text, owner))
        if isinstance(node, ast.ClassDef):
            prefix = f"{prefix}{node.name}."
        elif isinstance(node, ast.FunctionDef):
            owner, prefix = f"{prefix}{node.name}", f"{prefix}{node.name}.<locals>."
        for name, field in ast.iter_fields(node):
            if name not in ("annotation", "returns", "decorator_list", "bases"):
                children = field if isinstance(field, list) else [field]
                for child in (each for each in children if isinstance(each, ast.AST)):
                    # As an argument, -1 is the last axis.
                    is_argument = isinstance(node, ast.Call | ast.keyword)
                    is_axis = is_argument and ast.dump(child) == LAST_AXIS
                    if not is_axis:
                        visit(child, owner, prefix)

    visit(ast.parse(source), "", "")
    return found


def pick(files: list[Path], number: int, seed: int) -> list[Mutant]:
    """Mutants at random, evenly over the files, and over kinds of change within each."""
    rng, ranked = random.Random(seed), list[tuple[int, float, Mutant]]()
    for path in files:
        kinds, mutants = Counter[str](), mutants_of(path)
        for one in rng.sample(mutants, len(mutants)):
            kinds[one.kind] += 1
            ranked.append((kinds[one.kind], rng.random(), one))
    ranked.sort()
    turns, of_file = list[tuple[int, int, Mutant]](), Counter[Path]()
    for place, (_, _, one) in enumerate(ranked):
        of_file[one.path] += 1
        turns.append((of_file[one.path], place, one))
    return sorted(one for _, _, one in sorted(turns)[:number])


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
            sys.settrace(lambda frame, *_: codes.add(frame.f_code))
        try:
            return (yield)
        finally:
            sys.settrace(None)
            signal.alarm(0)
            package = f"{Path.cwd()}/dicedesign/"
            calls = [c for c in codes if c.co_filename.startswith(package)]
            names = sorted({f"{c.co_filename[len(package) :]}:{c.co_qualname}" for c in calls})
            failed = self.outcomes != {"passed"}
            state = [
                item.nodeid,
                "failed" if failed else "passed",
                time.perf_counter() - started,
                names,
            ]
            with self.out.open("a") as file:
                file.write(json.dumps(state) + "\n")


def stop_test(*_: object) -> None:
    raise TimeoutError


class Known(NamedTuple):
    """A test that passes on the unchanged package."""

    name: str
    seconds: float
    calls: list[str]


def run_tests(
    copy: Path, files: list[str], wanted: list[str] | None, limit: float
) -> tuple[int | None, list[list[Any]]]:
    """Run tests in a fork. Returns the exit status of pytest, None past the limit in seconds, and
    the entries of `Watch`."""
    out = copy.parent / "entries"
    out.write_text("")
    child = os.fork()
    if child == 0:
        os.setsid()
        with open(os.devnull, "w") as nothing:
            os.dup2(nothing.fileno(), 1)
            os.dup2(nothing.fileno(), 2)
        signal.signal(signal.SIGALRM, stop_test)
        stop = ["-x"] if wanted is not None else []
        arguments = [*files, *stop, "-n", "0", "-p", "no:cacheprovider"]
        os._exit(int(pytest.main(arguments, plugins=[Watch(out, wanted)])))
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
        cache.write_text(json.dumps(run_tests(copy, [str(path)], None, MAX_RECORDING)[1]))
    entries = json.loads(cache.read_text())
    return [Known(name, *entry) for name, outcome, *entry in entries if outcome == "passed"]


def judge(copy: Path, mutant: Mutant, limit: float, stages: int) -> str:
    """Run tests that call the function of a mutant, for a limit of seconds; what became of it."""
    call = f"{mutant.path.relative_to('dicedesign')}:{mutant.owner}"
    source, place = (ROOT / mutant.path).read_bytes(), copy / mutant.path
    changed, tried = source[: mutant.start] + mutant.text.encode() + source[mutant.end :], 0
    for stage in stages_of(mutant.path)[:stages]:
        chosen = list[Known]()
        for test in sorted(
            (t for path in stage for t in record(copy, path)), key=lambda t: t.seconds
        ):
            is_called = any(
                c == call or (not mutant.owner and c.startswith(call)) for c in test.calls
            )
            if is_called and (not tried or test.seconds <= limit):
                chosen.append(test)
                limit, tried = limit - test.seconds, tried + 1
        if not chosen:
            continue
        names, seconds = [t.name for t in chosen], sum(t.seconds for t in chosen)
        place.write_bytes(changed)
        # Compiled files are made anew only if the time of change is another.
        os.utime(place, (mutant.start, mutant.start))
        files = sorted({name.partition("::")[0] for name in names})
        status, entries = run_tests(copy, files, names, START_UP + PATIENCE * seconds)
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
    mutants = pick(
        [each.resolve().relative_to(ROOT) for each in given.files], given.mutants, given.seed
    )
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "__pycache__", "outputs"))
        work_in(copy)
        for one in mutants:
            started, reason = time.monotonic(), EQUIVALENT.get((str(one.path), one.change))
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
    sys.modules.pop("tests", None)
    for name in PRELOADED:
        importlib.import_module(name)


if __name__ == "__main__":
    main()
