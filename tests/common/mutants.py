"""Mutants of a file: one operator, constant, bound or early return is another."""

from __future__ import annotations

import ast
import itertools
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from tests.common.paths import ROOT

PAIRS = (
    (ast.Lt, ast.LtE),
    (ast.Lt, ast.Gt),
    (ast.Gt, ast.GtE),
    (ast.LtE, ast.GtE),
    (ast.Eq, ast.NotEq),
    (ast.Is, ast.IsNot),
    (ast.In, ast.NotIn),
    (ast.Add, ast.Sub),
    (ast.Mult, ast.Div),
    (ast.FloorDiv, ast.Mod),
    (ast.BitAnd, ast.BitOr),
    (ast.And, ast.Or),
)
"""Operators that take each other's place."""

SWAPS: dict[Any, list[Any]] = {
    operator: [b if a is operator else a for a, b in PAIRS if operator in (a, b)]
    for pair in PAIRS
    for operator in pair
}
"""What takes the place of an operator."""

NAMES = {"min": "max", "minimum": "maximum", "argmin": "argmax", "floor": "ceil", "any": "all"}
NAMES |= {after: before for before, after in NAMES.items()}

LAST_AXIS = ast.dump(ast.UnaryOp(ast.USub(), ast.Constant(1)))
"""As an argument, -1 is the last axis, often the only one of its kind."""

EQUIVALENT = {
    (
        "rest/basins.py",
        "if not (gap <= CLOSURE_TOLERANCE and (areas > -CLOSURE_TOLERANCE).all()):",
        "areas > -CLOSURE_TOLERANCE -> (areas >= -CLOSURE_TOLERANCE)",
    ): "rounded areas are not at the bound",
    (
        "rest/equilibria.py",
        "inside = self.side_sign > 0",
        "self.side_sign > 0 -> (self.side_sign >= 0)",
    ): "signs are 1 or -1",
    (
        "rest/morse.py",
        "SHORT_ARC = 1e-24",
        "1e-24 -> (1e-21)",
    ): "arcs this short are their chords within rounding",
    ("rest/poses.py", "return self", "return self -> pass"): "they would be computed again",
    (
        "gradient/body_function.py",
        "if any(row is None for row in rows):",
        "any -> all",
    ): "of one body, all rows are missing or none",
    (
        "balance/balanced.py",
        "tolerance: float = 0.005,",
        "0.005 -> (0.01)",
    ): "goals without probabilities do not use it, others are given another",
    (
        "balance/cavity.py",
        "shifts.append((moment - moments[order[:most]].sum(axis=0)) / left[most])",
        "most -> (most + 1)",
    ): "one cell of a coarse grid",
    (
        "balance/ways.py",
        "for place in order[fits[order]][:MAX_TRIED]:",
        "MAX_TRIED -> (MAX_TRIED + 1)",
    ): "bound of the effort",
    (
        "recipe/reading.py",
        'if re.search(r":\\s", lines[number][: mark.column]):',
        "mark.column -> (mark.column + 1)",
    ): "the next character is the colon, without the space after it",
    ("batch/batch.py", "return 0, 0", "0 -> (1)"): "no file has this time either",
    (
        "scenes/picture.py",
        "MAX_FLAT_TRIANGLES = 400",
        "400 -> (401)",
    ): "a choice of looks, between coarse meshes and fine ones",
    (
        "sweep/dice.py",
        "MAX_FOLDER_NAME = 60",
        "60 -> (61)",
    ): "any length far below that of file systems",
    (
        "geometry/surfaces/grid_surface.py",
        "MAX_PLACES = 200_000",
        "200000 -> (200001)",
    ): "size of blocks",
    (
        "concave/complementarity.py",
        "fewest, patience = count + 1, MAX_FAILED_PIVOTS",
        "1 -> (2)",
    ): "more than there can be, either way",
    (
        "optimize/starts/search.py",
        "distances[0] *= np.exp(-rng.uniform(0.0, NEARNESS))",
        "distances[0] *= np.exp(-rng.uniform(0.0, NEARNESS)) -> "
        "distances[0] /= np.exp(-rng.uniform(0.0, NEARNESS))",
    ): "other random shapes, whose probabilities are as uneven",
    (
        "throws/transition_features.py",
        "ENERGY_SOFTENING = 0.02",
        "0.02 -> (0.04)",
    ): "moves probabilities by 1e-4, a hundredth of the model's error",
    (
        "report/gauss_map.py",
        "edges = np.flatnonzero(np.arange(len(hull.tail)) < hull.twin)",
        "np.arange(len(hull.tail)) < hull.twin -> (np.arange(len(hull.tail)) <= hull.twin)",
    ): "no half-edge is its own twin",
    (
        "runtime/outputs.py",
        "MAX_LIST_BYTES = 1 << 28",
        "28 -> (29)",
    ): "lists have kilobytes",
    (
        "runtime/outputs.py",
        "MAX_NAMED = 5",
        "5 -> (6)",
    ): "one more name in a message",
    (
        "runtime/outputs.py",
        'return ", ".join(names[:MAX_NAMED]) + ", ..." * (len(names) > MAX_NAMED)',
        "MAX_NAMED -> (MAX_NAMED + 1)",
    ): "one more name in a message",
}
"""Reasons why mutants change nothing that a user could see, by file, line and change."""


class Mutant(NamedTuple):
    """One change of a file: `text` in place of the characters from `start` to `end`.

    source: its line; owner: qualified name of the function around it, "" outside of functions.
    """

    path: Path
    line: int
    kind: str
    change: str
    source: str
    start: int
    end: int
    text: str
    owner: str


def changes_of(node: Any) -> Iterator[tuple[str, Any, Any]]:
    """Kind of change, node that is replaced, and the node or text in its place."""
    match node:
        case ast.Compare(ops=[op]):
            for other in SWAPS[type(op)]:
                yield "compare", node, ast.Compare(node.left, [other()], node.comparators)
        case ast.BinOp() if type(node.op) in SWAPS and not is_text(node.left, node.right):
            yield "arithmetic", node, ast.BinOp(node.left, SWAPS[type(node.op)][0](), node.right)
        case ast.AugAssign() if type(node.op) in SWAPS and not is_text(node.value):
            other = SWAPS[type(node.op)][0]()
            yield "arithmetic", node, ast.unparse(ast.AugAssign(node.target, other, node.value))
        case ast.BoolOp():
            yield "logic", node, ast.BoolOp(SWAPS[type(node.op)][0](), node.values)
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield "sign", node, node.operand
        case ast.Constant(value=bool()):
            yield "constant", node, ast.Constant(not node.value)
        case ast.Constant(value=int()):
            yield "constant", node, ast.Constant(node.value + 1)
        case ast.Constant(value=float()):
            value = float(node.value)
            yield "constant", node, ast.Constant(value * (2.0 if value > 1e-3 else 1e3) or 1.0)
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in NAMES:
            yield "extreme", node.func, ast.unparse(node.func).removesuffix(name) + NAMES[name]
        case ast.Slice():
            for bound in (node.lower, node.upper):
                if bound is not None and not isinstance(bound, ast.Constant):
                    yield "slice", bound, ast.BinOp(bound, ast.Add(), ast.Constant(1))
        case ast.If(body=[*_, ast.Return() as last]) if "UNDECIDED" not in ast.unparse(node.test):
            # Where a kernel has no answer, NumPy has the same one.
            yield "early", last, "pass"


def is_text(*operands: ast.AST) -> bool:
    """Whether an operand is a text or a list, for which other operators make no sense."""
    known = ast.JoinedStr | ast.List | ast.Tuple | ast.Dict | ast.Set
    return any(isinstance(each, known) or "'" in ast.unparse(each) for each in operands)


def is_left_alone(node: ast.AST) -> bool:
    """Whether a part holds messages, types or a check of lengths only."""
    match node:
        case ast.If():
            return ast.unparse(node.test) == "TYPE_CHECKING"
        case ast.Call():
            return ast.unparse(node.func).split(".")[0] in ("TypeVar", "logging", "warnings")
        case ast.keyword(arg="strict"):
            return True
        case ast.AnnAssign():
            return ast.unparse(node.annotation) == "TypeAlias"
    return isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert)


def mutants_of(path: Path) -> list[Mutant]:
    """All mutants of a file, by its path from the root of the repository."""
    lines, found = (ROOT / path).read_bytes().splitlines(keepends=True), list[Mutant]()
    starts = [0, *itertools.accumulate(map(len, lines))]

    def visit(node: ast.AST, owner: str, prefix: str) -> None:
        """owner: function around the node; prefix: of the names of those inside of it."""
        if is_left_alone(node):
            return
        for kind, old, new in changes_of(node):
            text = new if isinstance(new, str) else f"({ast.unparse(new)})"
            start = starts[old.lineno - 1] + old.col_offset
            end = starts[old.end_lineno - 1] + old.end_col_offset
            shown = " ".join(f"{ast.unparse(old)} -> {text}".split())
            source = lines[old.lineno - 1].decode().strip()
            found.append(Mutant(path, old.lineno, kind, shown, source, start, end, text, owner))
        if isinstance(node, ast.ClassDef):
            prefix = f"{prefix}{node.name}."
        elif isinstance(node, ast.FunctionDef):
            owner, prefix = f"{prefix}{node.name}", f"{prefix}{node.name}.<locals>."
        is_call = isinstance(node, ast.Call | ast.keyword)
        for name, field in ast.iter_fields(node):
            if name not in ("annotation", "returns", "decorator_list", "bases"):
                parts = field if isinstance(field, list) else [field]
                for part in (each for each in parts if isinstance(each, ast.AST)):
                    if not (is_call and ast.dump(part) == LAST_AXIS):
                        visit(part, owner, prefix)

    visit(ast.parse(b"".join(lines)), "", "")
    return found


def pick(files: list[Path], number: int, seed: int) -> list[Mutant]:
    """Mutants at random, evenly over the files, and over kinds of change within each."""
    rng, ranked = random.Random(seed), list[tuple[int, float, Mutant]]()
    for path in files:
        kinds, mutants = Counter[str](), mutants_of(path)
        for one in rng.sample(mutants, len(mutants)):
            kinds[one.kind] += 1
            ranked.append((kinds[one.kind], rng.random(), one))
    of_file = Counter[Path]()
    for place, (_, _, one) in enumerate(sorted(ranked)):
        of_file[one.path] += 1
        ranked[place] = of_file[one.path], place, one
    return sorted(one for _, _, one in sorted(ranked)[:number])
