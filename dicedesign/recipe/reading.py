"""A recipe file, or a typed target, read into a checked recipe; what is said of a bad one."""

from __future__ import annotations

import contextlib
import difflib
import json
import os
import re
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from pydantic import ValidationError

from dicedesign.errors import RecipeError
from dicedesign.fabricate.finish_options import is_font_file
from dicedesign.recipe.recipe import Recipe
from dicedesign.runtime.files import read_text

MOST_DEPTH: Final = 30

MOST_ENTRIES: Final = 10_000
"""Of a recipe; more than any needs."""

BAD_YAML: Final = (TypeError, ValueError, LookupError, AttributeError, RecursionError)
"""What PyYAML raises, besides its own errors, for values that are not what their tag says, such as
2024-13-45 or !!int x, and for nesting without end."""


def read_recipe(path: Path, changes: Sequence[str] = ()) -> Recipe:
    """Read a YAML recipe.

    Parameters
    ----------
    path: the file.
    changes: texts "dotted.key=value" that replace or add entries, values in YAML; the path of a
        mesh, a font or an icon in one is relative to the working directory.

    Raises
    ------
    RecipeError: the file is missing or no YAML mapping, or an entry is unknown or unusable; the
        message names file, key, what was expected and what came.
    """
    data = parse_yaml(read_text(path, "a recipe", error=RecipeError), str(path))
    if not isinstance(data, dict):
        raise RecipeError(
            f"{path}: expected keys and values, got {reprlib.repr(data)}; write name: ... and "
            "target: ..."
        )
    _resolve_paths(data, path.parent)
    for change in changes:
        _apply(data, change)
    # What a change brought is relative to where the command runs; absolute paths stay.
    _resolve_paths(data, Path())
    try:
        return parse_recipe(data)
    except RecipeError as error:
        raise RecipeError(f"{path}: {error}") from error


def _check_entries(data: object) -> None:
    """Raise RecipeError for data that are more than anybody writes once they are written out: a
    kilobyte of YAML whose aliases stand for lists of aliases can stand for more than any memory
    holds, or for itself. And, naming its dotted key, for a text that UTF-8 has no bytes for: the
    name of a file in another encoding, or half of a letter."""
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
        if len(keys) > MOST_DEPTH:
            raise RecipeError(
                f"expected entries at most {MOST_DEPTH} within each other, got more; write them as "
                "in docs/recipes.md"
            )
        if id(part) not in sizes:
            for key in part if isinstance(part, Mapping) else ():
                size(key if isinstance(key, str) else "", *keys)
            entries = part.items() if isinstance(part, Mapping) else enumerate(part)
            sizes[id(part)] = 1 + sum(size(entry, *keys, str(key)) for key, entry in entries)
        return sizes[id(part)]

    if size(data) > MOST_ENTRIES:
        raise RecipeError(
            f"expected at most {MOST_ENTRIES} entries, got more once aliases are written out; "
            "leave some out"
        )


def parse_recipe(data: Mapping[str, Any]) -> Recipe:
    """The recipe of plain data, as YAML would give them.

    Raises RecipeError if an entry is unknown or unusable; the message begins with its dotted key.
    """
    _check_entries(data)
    try:
        # Through JSON: strict validation then takes mappings for options and lists for tuples.
        # Numbers of NumPy become those of Python, and anything else, such as a path, text.
        plain = json.dumps(
            data,
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


def recipe_text(recipe: Recipe) -> str:
    """A recipe with every default written out, as YAML that `read_recipe` takes from anywhere."""
    return yaml.safe_dump(recipe.resolved(), sort_keys=False, allow_unicode=True)


class _Loader(yaml.SafeLoader):
    """YAML with `1e-3` as a number and repeated keys as errors."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                line = key_node.start_mark.line + 1
                raise yaml.YAMLError(f"key {key!r} appears twice, the second time in line {line}")
            seen.add(key)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+0123456789."),
)


def parse_yaml(content: str, where: str) -> object:
    """What a text in YAML says. Raises RecipeError, naming where it is from, where it is none."""
    try:
        return yaml.load(content, Loader=_Loader)
    except (yaml.YAMLError, *BAD_YAML) as error:
        reason = " ".join(str(error).split())
        raise RecipeError(f"{where}: expected YAML, but {reason}; correct it") from error


def _apply(data: dict[str, Any], change: str) -> None:
    key, equals, value = change.partition("=")
    if not equals or not key.strip():
        raise RecipeError(f"--set {change}: expected key=value; write it such as size_mm=40")
    *parents, last = key.strip().split(".")
    for parent in parents:
        if not isinstance(data.get(parent), dict):
            data[parent] = {}
        data = data[parent]
    data[last] = parse_yaml(value, f"--set {key}")


def _resolve_paths(data: Mapping[str, Any], folder: Path) -> None:
    """Make the paths of a recipe absolute that count from a folder."""

    def part(entries: Any, key: str) -> dict[Any, Any]:
        entry = entries.get(key)
        return entry if isinstance(entry, dict) else {}

    engrave = part(data, "engrave")
    paths = [(part(part(data, "start"), "mesh"), "path")]
    paths += [(part(engrave, "icons"), label) for label in part(engrave, "icons")]
    if isinstance(engrave.get("font"), str) and is_font_file(engrave["font"]):
        paths.append((engrave, "font"))
    for entries, key in paths:
        if isinstance(entries.get(key), str):
            # Of one that cannot be a path, the reader of the file says so.
            with contextlib.suppress(ValueError):
                entries[key] = os.path.realpath(folder / entries[key])


def _explain(error: ValidationError) -> str:
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if not str(part).startswith("function-"))
    cause = first.get("ctx", {}).get("error")
    if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{key}: unknown key; {_hint(key)}"
    if first["type"] == "missing":
        return f"{key}: expected this key, but it is missing; add it"
    if isinstance(cause, ValueError):
        parent, _, last = key.rpartition(".")
        if str(cause).startswith((f"{last}.", f"{last}:")):
            # It names the entry from the last key on.
            return f"{parent}.{cause}".lstrip(".")
        return f"{key + ': ' if key else ''}{cause}"
    message = first["msg"][0].lower() + first["msg"][1:].replace("an object", "keys and values")
    return f"{key}: {message}, got {reprlib.repr(first['input'])}; correct it"


def _hint(key: str) -> str:
    """Guess at what was meant by an unknown dotted key."""
    parent, _, name = key.rpartition(".")
    schema = Recipe.model_json_schema()
    places: dict[str, list[str]] = {}
    for place in _key_paths(schema, schema["$defs"]):
        places.setdefault(place.rpartition(".")[2], []).append(place)
    here = [known for known, at in places.items() if f"{parent}.{known}".lstrip(".") in at]
    if close := difflib.get_close_matches(name, here, n=1):
        return f"did you mean {close[0]!r}?"
    if name in places:
        return f"it belongs at {' or '.join(places[name])}"
    if close := difflib.get_close_matches(name, list(places), n=1):
        return f"did you mean {' or '.join(places[close[0]])}?"
    return "remove it"


def _key_paths(
    schema: Mapping[str, Any], definitions: Mapping[str, Any], parent: str = ""
) -> Iterator[str]:
    """Dotted paths of all keys of a JSON schema."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].rpartition("/")[2]]
    for part in (*schema.get("anyOf", ()), *schema.get("allOf", ())):
        yield from _key_paths(part, definitions, parent)
    for name, part in schema.get("properties", {}).items():
        yield f"{parent}{name}"
        yield from _key_paths(part, definitions, f"{parent}{name}.")


LARGEST_DENOMINATOR: Final = 10_000
"""Of fractions that anybody reads."""


def parse_target(text: str, labels: str | None = None) -> dict[str, Any]:
    """The entries of a recipe's `target`, unchecked.

    Parameters
    ----------
    text: probabilities with commas between them, "1/2,1/3,1/6", or what a recipe says, "fair: 7",
        with the space or without.
    labels: with commas between them, or None for those of the target.

    Raises RecipeError for a text that is neither.
    """
    entries: dict[str, Any]
    if ":" in text:
        read = parse_yaml(re.sub(r"^\s*(\w+):(?=\S)", r"\1: ", text), "target")
        if not isinstance(read, dict):
            raise RecipeError(
                f"target: expected probabilities or a key and a value, got {text!r}; write "
                "1/2,1/3,1/6, or fair: 7"
            )
        entries = read
    else:
        entries = {"probabilities": _listed(text)}
    if labels is not None:
        entries["labels"] = _listed(labels)
    return entries


def format_probabilities(probabilities: Iterable[float]) -> str:
    """The text that `parse_target` takes for these probabilities, to the last bit: fractions where
    they are short."""
    pairs = [(float(p), Fraction(p).limit_denominator(LARGEST_DENOMINATOR)) for p in probabilities]
    return ", ".join(str(short) if float(short) == p else repr(p) for p, short in pairs)


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")]
