"""Read recipes and typed targets, with error messages."""

from __future__ import annotations

import contextlib
import csv
import difflib
import json
import os
import re
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import ValidationError

from dicedesign.errors import RecipeError, named
from dicedesign.fabricate.finish_options import ICON_NAMES, is_font_file
from dicedesign.recipe.recipe import Recipe
from dicedesign.recipe.target import read_shorthand
from dicedesign.runtime.files import read_text
from dicedesign.runtime.registry import explain, key_of

MAX_DEPTH = 30
"""Levels of nested entries in a recipe."""

MAX_ENTRIES = 10_000
"""Entries in a recipe."""

MAX_CHARACTERS = 1 << 20
"""Characters of a recipe, or of one of its entries on the command line."""

MAX_SCALAR = 10_000
"""Characters of one text or number in YAML."""

VALUE_ERRORS = (TypeError, ValueError, LookupError, AttributeError, RecursionError, OverflowError)
"""Errors of PyYAML, besides its own, for values that do not match their tag, such as 2024-13-45 or
!!int x, and for infinite nesting."""


def read_recipe(path: Path, changes: Sequence[str] = ()) -> Recipe:
    """Read a YAML recipe.

    Parameters
    ----------
    path: the file.
    changes: texts "dotted.key=value" that replace or add entries, values in YAML. Their paths are
        relative to the working directory, those of the file to its folder.

    Raises
    ------
    RecipeError: the file is missing or is no YAML mapping, or an entry is unknown or invalid; the
        message names file and key.
    """
    data = parse_yaml(read_text(path, "a recipe", error=RecipeError), str(path))
    if not isinstance(data, dict):
        raise RecipeError(
            f"{path}: expected keys and values, got {reprlib.repr(data)}; write name: ... and "
            "target: ..."
        )
    resolve_paths(data, path.parent)
    for change in changes:
        _apply_change(data, change)
    # Paths of changes are relative to the working directory.
    resolve_paths(data, Path())
    try:
        return parse_recipe(data)
    except RecipeError as error:
        raise RecipeError(f"{path}: {error}") from error


def _check_entries(data: object) -> None:
    """Raise RecipeError for too many entries, and for a text that UTF-8 cannot encode.

    A kilobyte of YAML whose aliases stand for lists of aliases can expand to more than any memory
    holds, or contain itself. File names in other encodings hold lone surrogates.
    """
    sizes: dict[int, int] = {}

    def size(part: object, *keys: str) -> int:
        if isinstance(part, str | Path):
            try:
                str(part).encode("utf-8")
            except UnicodeEncodeError as error:
                raise RecipeError(
                    f"{'.'.join(keys) or 'keys'}: expected a text in UTF-8, got {str(part)!r}; "
                    "rename it"
                ) from error
        if not isinstance(part, Mapping | list | tuple):
            return 1
        if len(keys) > MAX_DEPTH:
            raise RecipeError(
                f"expected entries at most {MAX_DEPTH} within each other, got more; write them as "
                "in docs/recipes.md"
            )
        if id(part) not in sizes:
            for key in part if isinstance(part, Mapping) else ():
                size(key if isinstance(key, str) else "", *keys)
            entries = part.items() if isinstance(part, Mapping) else enumerate(part)
            sizes[id(part)] = 1 + sum(size(entry, *keys, str(key)) for key, entry in entries)
        return sizes[id(part)]

    if size(data) > MAX_ENTRIES:
        raise RecipeError(
            f"expected at most {MAX_ENTRIES} entries, got more once aliases are written out; "
            "leave some out"
        )


def parse_recipe(data: Mapping[str, Any]) -> Recipe:
    """Check a recipe of plain data, as read from YAML.

    Raises RecipeError if an entry is unknown or invalid; the message begins with its dotted key.
    """
    _check_entries(data)
    entries = _read_lengths(data)
    try:
        # Strict validation of JSON accepts mappings for options and lists for tuples. NumPy numbers
        # become Python numbers, anything else, such as a path, becomes text.
        plain = json.dumps(
            entries,
            default=lambda value: value.item() if isinstance(value, np.generic) else str(value),
        )
    except (TypeError, ValueError, RecursionError) as error:
        raise RecipeError(
            f"expected texts as keys and entries that do not contain themselves, but {error}; "
            "write them as in docs/recipes.md"
        ) from error
    try:
        return Recipe.model_validate_json(plain)
    except ValidationError as error:
        raise RecipeError(_explain(error)) from error


LENGTH = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*([a-z]*)")

UNITS_MM = {"": 1.0, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of lengths, in mm."""


def _read_lengths(entries: Any, key: str = "") -> Any:
    """Copy entries, with texts such as "3cm" of keys that end in _mm as numbers."""
    if isinstance(entries, Mapping):
        return {
            name: _read_lengths(entry, f"{key}.{name}".lstrip("."))
            for name, entry in entries.items()
        }
    if not isinstance(entries, str) or not key.endswith("_mm"):
        return entries
    length = LENGTH.fullmatch(entries.lower().strip())
    if length is None or length[2] not in UNITS_MM:
        raise RecipeError(
            f"{key}: expected a length in mm such as 30, or with a unit such as 30mm, 3cm or "
            f"1.2in, got {reprlib.repr(entries)}; write it so"
        )
    # Rounded, as 1.1 inches times 25.4 is not 27.94.
    return float(f"{float(length[1]) * UNITS_MM[length[2]]:.12g}")


def recipe_text(recipe: Recipe) -> str:
    """YAML of a recipe with every default and absolute paths."""
    return yaml.safe_dump(recipe.as_dict(), sort_keys=False, allow_unicode=True)


class _Loader(yaml.SafeLoader):
    """YAML loader that reads `1e-3` as a number and refuses repeated keys, and too many, too deep
    or too long entries while it reads them."""

    depth, nodes = 0, 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self.depth, self.nodes = self.depth + 1, self.nodes + 1
        if self.depth > MAX_DEPTH + 1 or self.nodes > 2 * MAX_ENTRIES:
            raise RecipeError(
                f"expected at most {MAX_ENTRIES} entries, {MAX_DEPTH} within each other, got more; "
                "write them as in docs/recipes.md"
            )
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def compose_scalar_node(self, anchor: Any) -> Any:
        node = super().compose_scalar_node(anchor)
        if len(node.value) > MAX_SCALAR:
            raise RecipeError(
                f"expected texts of at most {MAX_SCALAR} characters, got {len(node.value)}; "
                "shorten it"
            )
        return node

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        super().flatten_mapping(node)
        if len(node.value) > MAX_ENTRIES:
            raise RecipeError(
                f"expected at most {MAX_ENTRIES} entries, got more once merged; leave some out"
            )

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in keys:
                raise yaml.MarkedYAMLError(problem="key twice", problem_mark=key_node.start_mark)
            keys.add(key)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$"),
    list("-+0123456789."),
)


YAML_FAULTS = (
    ("key twice", "each key once", "remove or rename one"),
    (r"'\\t'", "spaces, not a tab, at the start of a line", "write spaces"),
    ("quoted scalar .* end of stream", "a closing quote", "add it"),
    ("while parsing a flow", "a comma or a closing bracket", "add it, or put a text in quotes"),
    ("simple key|missing colon", "a key, a colon and a space", "write it such as size_mm: 30"),
    ("second colon", "one colon and a space in a line", "put a text with colons in quotes"),
    (
        "found '(<scalar>|]|})'",
        "nothing after a closing quote or bracket",
        "remove it, or put the whole text in quotes",
    ),
    (
        "<block end>|<document start>|mapping values|sequence entries",
        "as many spaces at the start of a line as its neighbors have",
        "indent keys that belong together alike",
    ),
    ("cannot start", "a letter, a digit or a quote at the start of a text", "put it in quotes"),
)
"""Pattern of the parser's message, what is expected, and the remedy."""


def parse_yaml(content: str, where: str) -> object:
    """Parse YAML. Raises RecipeError that begins with `where`."""
    if len(content) > MAX_CHARACTERS:
        raise RecipeError(
            f"{where}: expected at most {MAX_CHARACTERS} characters, got {len(content)}; leave "
            "some out"
        )
    try:
        return yaml.load(content, Loader=_Loader)
    except RecipeError as error:
        raise RecipeError(f"{where}: {error}") from error
    except (yaml.YAMLError, *VALUE_ERRORS) as error:
        raise RecipeError(f"{where}: {_explain_yaml(error, content.splitlines())}") from error


def _explain_yaml(error: Exception, lines: Sequence[str]) -> str:
    """Say in plain words what is wrong with YAML."""
    mark, context = getattr(error, "problem_mark", None), getattr(error, "context_mark", None)
    if mark is None:
        return "expected YAML, got a value that cannot be read; write it as in docs/recipes.md"
    message = f"{getattr(error, 'context', '')} {getattr(error, 'problem', '')}"
    if re.search("while (scanning a (simple|quoted)|parsing a flow)", message) and context:
        # The fault begins there, and is noticed later.
        mark = context
    number = min(mark.line, len(lines) - 1)
    if "mapping values" in message:
        above = next((k for k in reversed(range(number)) if lines[k].strip()), number)
        if re.search(r":\s", lines[number][: mark.column]):
            message = "second colon"
        elif not re.search(r":(\s|$)", lines[above]):
            message, number = "missing colon", above
    place = f"line {number + 1}: " if len(lines) > 1 else ""
    for pattern, expected, remedy in YAML_FAULTS:
        if re.search(pattern, message):
            got = reprlib.repr(lines[number].strip())
            return f"{place}expected {expected}, got {got}; {remedy}"
    return f"cannot be read as YAML at line {number + 1}, column {mark.column + 1}; correct it"


def _apply_change(data: dict[str, Any], change: str) -> None:
    key, equals, value = change.partition("=")
    if not equals or not key.strip():
        raise RecipeError(f"--set {change}: expected key=value; write it such as size_mm=40")
    *parents, last = key.strip().split(".")
    for parent in parents:
        if not isinstance(data.get(parent), dict):
            data[parent] = {}
        data = data[parent]
    data[last] = parse_yaml(value, f"--set {key}")


def resolve_paths(data: Mapping[str, Any], folder: Path) -> None:
    """Make the relative paths of a recipe, which start in a folder, absolute."""

    def part(entries: Any, key: str) -> dict[Any, Any]:
        entry = entries.get(key)
        return entry if isinstance(entry, dict) else {}

    engrave = part(data, "engrave")
    paths = [(part(part(data, "start"), "mesh"), "path")]
    icons = part(engrave, "icons")
    paths += [(icons, label) for label in icons]
    if isinstance(engrave.get("font"), str) and is_font_file(engrave["font"]):
        paths.append((engrave, "font"))
    for entries, key in paths:
        path = entries.get(key)
        if isinstance(path, str) and not (entries is icons and path in ICON_NAMES):
            # The reader of the file refuses an invalid path.
            with contextlib.suppress(ValueError):
                entries[key] = os.path.realpath(folder / path)


def _explain(error: ValidationError) -> str:
    errors = error.errors()
    # A misspelled key is the cause of a missing one.
    unknown = [one for one in errors if one["type"] in UNKNOWN]
    first = (unknown or errors)[0]
    key = key_of(first)
    if unknown:
        return f"{key}: unknown key; {_hint(key)}"
    if first["type"] == "missing":
        return f"{key}: expected this key, but it is missing; add it"
    return explain(first)


UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")


def _hint(key: str) -> str:
    """Suggest what to do about an unknown dotted key."""
    parent, _, name = key.rpartition(".")
    schema = Recipe.model_json_schema()
    places: dict[str, list[str]] = {}
    for place in _key_paths(schema, schema["$defs"]):
        places.setdefault(place.rpartition(".")[2], []).append(place)
    siblings = [known for known, at in places.items() if f"{parent}.{known}".lstrip(".") in at]
    if close := difflib.get_close_matches(name, siblings, n=1):
        return f"did you mean {close[0]!r}?"
    if name in places:
        return f"it belongs at {' or '.join(places[name])}"
    if close := difflib.get_close_matches(name, list(places), n=1):
        return f"did you mean {' or '.join(places[close[0]])}?"
    if parent.rpartition(".")[2] in ("start", "weights", "prefer"):
        return "remove it, or register or install the extension that adds it"
    return "remove it"


def _key_paths(
    schema: Mapping[str, Any], definitions: Mapping[str, Any], parent: str = ""
) -> Iterator[str]:
    """Yield the dotted paths of all keys in a JSON schema."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].rpartition("/")[2]]
    for part in (*schema.get("anyOf", ()), *schema.get("allOf", ())):
        yield from _key_paths(part, definitions, parent)
    for name, part in schema.get("properties", {}).items():
        yield f"{parent}{name}"
        yield from _key_paths(part, definitions, f"{parent}{name}.")


MAX_DENOMINATOR = 10_000
"""Denominator up to which a probability is written as a fraction."""

SUM_ERROR = 1e-15
"""Relative error of a sum of probabilities of faces."""


def parse_target(text: str, labels: str | None = None) -> dict[str, Any]:
    """Parse the `target` of a recipe from the command line, without checking it.

    Parameters
    ----------
    text: see `read_shorthand`; or an entry such as "fair: 7" or "fair:7".
    labels: labels separated by commas, in double quotes if they contain some; None for those of the
        target. Faces with the same label are one outcome.

    Raises InputError for any other text.
    """
    with named("target"):
        entries: Any = read_shorthand(text)
    if entries is None:
        entries = parse_yaml(re.sub(r"^\s*(\w+):(?=\S)", r"\1: ", text), "target")
        if not isinstance(entries, dict):
            raise RecipeError(
                "target: expected dice, weights, probabilities, or a key and a value, got "
                f"{reprlib.repr(text)}; write 2d6, 1:2:3, 1/2,1/3,1/6, or fair: 7"
            )
    if labels is not None:
        entries["labels"] = split_texts("labels", labels)
    return entries


def split_texts(key: str, text: str) -> list[str]:
    """Split texts at commas that are not in double quotes. Raises RecipeError that begins with
    `key`."""
    try:
        rows = list(csv.reader([text], skipinitialspace=True))
    except csv.Error as error:
        raise RecipeError(
            f"{key}: expected texts with commas between them in one line, got "
            f"{reprlib.repr(text)}; correct it"
        ) from error
    return [part.strip() for row in rows for part in row]


def format_probabilities(probabilities: Iterable[float]) -> str:
    """Text of probabilities that `parse_target` reads back exactly, with short fractions, also for
    sums of faces, whose last digit may be off."""
    pairs = [(float(p), Fraction(p).limit_denominator(MAX_DENOMINATOR)) for p in probabilities]
    texts = (str(short) if abs(short - p) <= SUM_ERROR * p else repr(p) for p, short in pairs)
    return ", ".join(texts)
