"""Tables of the documentation that are generated from the code: recipe keys, statuses, registries.

    python tests/docs/generated_tables.py

rewrites them, between a line `<!-- table: NAME -->` and the next `<!-- end -->` of each page. A
test compares the pages with the code.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import json
import re
import sys
import textwrap
import types
import typing
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import to_jsonable_python

from dicedesign.batch import rest_table
from dicedesign.fabricate import fonts, icons
from dicedesign.fabricate.file_formats import FILE_FORMATS
from dicedesign.fabricate.printers import MATERIALS, PRINTERS, Printer
from dicedesign.geometry.meshes import gltf, parsing, scenes, three_mf, xml_files
from dicedesign.geometry.robots import links, mjcf
from dicedesign.optimize.starts.start import STARTS
from dicedesign.recipe import reading, target
from dicedesign.recipe.recipe import Recipe, StartRecipe
from dicedesign.rest.prior import PRIORS
from dicedesign.results.parts import Status
from dicedesign.runtime import files
from dicedesign.throws.tables import HANDS, least_of, most_of
from dicedesign.view import server

ROOT = Path(__file__).resolve().parents[2]

# Benches are not installed.
sys.path.append(str(ROOT))

REGISTRIES = {
    "starting shapes": "dicedesign.optimize.starts.start:STARTS",
    "energy terms": "dicedesign.optimize.terms:TERMS",
    "preferences": "dicedesign.optimize.preferences:PREFERENCES",
    "printers": "dicedesign.fabricate.printers:PRINTERS",
    "stages": "dicedesign.recipe.pipeline:STAGES",
    "figures": "dicedesign.report.figures:FIGURES",
    "kinds of figures": "dicedesign.report.body_figures:BODY_FIGURES",
}
"""Address "module:attribute" of the registry of each table."""

COMMANDS = {"kinds of figures": "dicedesign figure "}
"""Text before the names of a table's entries."""

BLOCK = re.compile(r"(<!-- table: ([\w ]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def tables() -> dict[str, Callable[[], str]]:
    """Functions that generate all tables, by name."""
    registries = {
        name: partial(registry_table, place, COMMANDS.get(name, ""))
        for name, place in REGISTRIES.items()
    }
    return {
        "recipe keys": recipe_table,
        "benches": bench_table,
        "statuses": status_table,
        "file formats": format_table,
        "priors": priors_table,
        **registries,
        "hands": hands_table,
        "limits of printers": limits_table,
        "sources of printers": sources_table,
        "limits of readers": readers_table,
        **{name: partial(measured_table, table) for name, table in measured().items()},
    }


def pages() -> list[Path]:
    """README and pages of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path) -> dict[str, str]:
    """Current tables of a page by name."""
    return {match[2]: match[3] for match in BLOCK.finditer(page.read_text(encoding="utf-8"))}


def rewrite(text: str, makers: dict[str, Callable[[], str]]) -> str:
    """Text of a page with generated tables."""
    return BLOCK.sub(lambda match: match[1] + makers[match[2]]() + match[4], text)


def markdown(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Markdown table with escaped bars in cells."""
    lines = [header, ("---",) * len(header), *rows]
    return "".join(
        "|" + "|".join(cell if cell == "---" else f" {cell} " for cell in line) + "|\n"
        for line in ([cell.replace("|", "\\|") for cell in line] for line in lines)
    )


def registry_table(place: str, command: str) -> str:
    """Name and line of each extension of a registry."""
    module, _, attribute = place.partition(":")
    entries = getattr(import_module(module), attribute)
    return markdown(
        ("name", "meaning"), [(f"`{command}{entry.name}`", entry.line) for entry in entries]
    )


def hands_table() -> str:
    """Meaning and numbers of each throw distribution."""
    return markdown(
        ("name", "meaning", "height (m)", "speed (m/s)", "spin (rad/s)"),
        [
            (
                f"`{hand.name}`",
                hand.line,
                *(
                    f"{least_of(spread):g} to {most_of(spread):g}"
                    for spread in (hand.height, hand.speed, hand.spin)
                ),
            )
            for hand in HANDS.values()
        ],
    )


def limits_table() -> str:
    """Limits of each kind of printer, in columns."""
    printers = list(PRINTERS)
    names = [field.name for field in dataclasses.fields(Printer)]
    rows = []
    for name in names[names.index("spot_mm") : names.index("sources")]:
        values = [getattr(printer, name) for printer in printers]
        if name == "materials":
            cells = [
                ", ".join(f"{word} {MATERIALS[word].density_g_cm3:g}" for word in value)
                for value in values
            ]
            rows.append(("`materials`, with their densities in g/cm³", *cells))
        elif name != "has_nozzle":
            rows.append((f"`{name}`: {parse_meanings(Printer)[name]}", *(f"{v:g}" for v in values)))
    return markdown(("", *(f"`{printer.name}`" for printer in printers)), rows)


def sources_table() -> str:
    """Sources of the numbers of printers and materials."""
    rows = [(f"`{printer.name}`", "; ".join(printer.sources)) for printer in PRINTERS]
    by_source: dict[str, list[str]] = {}
    for name, material in MATERIALS.items():
        by_source.setdefault(material.source, []).append(f"`{name}`")
    rows += [(", ".join(names), source) for source, names in by_source.items()]
    return markdown(("of", "source"), rows)


def mebibytes(size: int) -> str:
    """Bytes as MiB."""
    return f"{size / (1 << 20):,g}"


def readers_table() -> str:
    """Limits of each reader, by its constants."""
    placed = f"{scenes.MAX_NODES:,} parts; {scenes.MAX_PLACED:,} vertices and triangles"
    zipped = f", or {xml_files.MAX_RATIO} times the file; {mebibytes(xml_files.SMALL_UNPACKED)} any"
    rows = [
        (
            "STL, OBJ, OFF, PLY, XYZ",
            f"{mebibytes(files.MAX_DATA_BYTES)}; text {mebibytes(parsing.MAX_TEXT_BYTES)}",
            "",
            f"{parsing.MAX_HEADER_BYTES:,} bytes in a header of PLY",
            "",
        ),
        (
            "glTF, GLB",
            f"{mebibytes(files.MAX_DATA_BYTES)}; JSON {mebibytes(gltf.MAX_JSON_BYTES)}",
            mebibytes(files.MAX_DATA_BYTES),
            placed,
            "",
        ),
        (
            "COLLADA, AMF",
            mebibytes(xml_files.MAX_XML_BYTES),
            mebibytes(xml_files.MAX_XML_BYTES) + zipped,
            f"{xml_files.MAX_TAGS:,} tags; {placed}",
            "",
        ),
        (
            "3MF",
            mebibytes(files.MAX_DATA_BYTES),
            mebibytes(three_mf.MAX_UNPACKED) + zipped,
            f"{three_mf.MAX_LISTED:,} parts; {scenes.MAX_PLACED:,} vertices and triangles",
            f"{three_mf.MAX_DEPTH}",
        ),
        (
            "URDF, MJCF",
            mebibytes(files.MAX_TEXT_BYTES),
            "",
            f"{links.MAX_TAGS:,} tags; {links.MAX_ATTRIBUTES} attributes; {links.MAX_SHAPES:,} "
            f"shapes of a link; {mjcf.MAX_INCLUDES} included files",
            "",
        ),
        (
            "icons (SVG), fonts",
            f"{mebibytes(icons.MOST_BYTES)}; fonts {mebibytes(fonts.MOST_BYTES)}",
            "",
            f"{icons.MOST_SHAPES:,} shapes; {icons.CORNERS[0]:,} corners; {icons.MOST_PARTS:,} "
            f"elements, commands and numbers; {icons.MOST_CHARACTERS:,} characters",
            f"{icons.MOST_DEPTH}",
        ),
        (
            "recipes (YAML)",
            mebibytes(reading.MAX_CHARACTERS),
            "",
            f"{reading.MAX_ENTRIES:,} entries of {reading.MAX_SCALAR:,} characters; "
            f"{target.MOST_DICE:,} dice",
            f"{reading.MAX_DEPTH}",
        ),
        (
            "throws, masses, directions, tables to throw on",
            mebibytes(files.MAX_TEXT_BYTES),
            "",
            "",
            "",
        ),
        (
            "tables of rests",
            mebibytes(rest_table.MAX_TABLE_BYTES),
            "",
            f"{rest_table.MAX_ROWS:,} rows and {rest_table.MAX_CELL_BYTES:,} bytes in a text of "
            "Parquet",
            "",
        ),
        (
            "requests to the page",
            f"{mebibytes(server.MAX_REQUEST_BYTES)}; meshes {mebibytes(server.MAX_UPLOAD_BYTES)}",
            "",
            f"{server.IDLE_SECONDS:g} seconds of pause",
            "",
        ),
    ]
    return markdown(("what", "file", "unpacked", "most", "depth"), rows)


def bench_table() -> str:
    """First line of each bench."""
    rows = []
    for name in import_module("benchmarks.frame").BENCHES:
        line = (import_module(f"benchmarks.{name}").__doc__ or "").partition("\n")[0]
        rows.append((f"`python -m benchmarks {name}`", line))
    return markdown(("command", "meaning"), rows)


def measured() -> dict[str, Any]:
    """Tables of benches by name."""
    found: dict[str, Any] = json.loads(
        import_module("benchmarks.frame").RECORDED.read_text(encoding="utf-8")
    )
    return found


def measured_table(table: dict[str, Any]) -> str:
    """What a bench printed, with its command, date and machine."""
    rows = [tuple(row) for row in table["rows"]]
    made = f"`{table['command']}`, {table['date']}, {table['machine']}."
    return f"{markdown(tuple(table['titles']), rows)}\n{made}\n"


def status_table() -> str:
    """Name and message of each status."""
    return markdown(
        ("status", "message"), [(f"`{status.name.lower()}`", status.value) for status in Status]
    )


def format_table() -> str:
    """Properties of each file format."""
    rows = [
        (f"`{kind.name}`", kind.line, kind.unit, kind.upward, kind.precision, kind.carries)
        for kind in FILE_FORMATS
    ]
    return markdown(("format", "meaning", "unit", "upward", "coordinates", "holds besides"), rows)


def priors_table() -> str:
    """Form and meaning of each prior."""
    rows = [(f"`{kind.form}`", kind.line) for kind in PRIORS]
    return markdown(("prior", "meaning"), rows)


def recipe_table() -> str:
    """Dotted key, default and meaning of each entry of a recipe."""
    return markdown(("key", "default", "meaning"), list(recipe_rows(Recipe)))


MISSING = object()


def recipe_rows(
    schema: type, parent: str = "", instance: object = None
) -> Iterator[tuple[str, str, str]]:
    """Yield the entries of a model or option class and of nested ones, depth first."""
    if hasattr(schema, "list_numbers"):  # Numbers that extensions declare.
        for number in schema.list_numbers().values():
            default = getattr(instance, number.name, number.default)
            yield f"`{parent}{number.name}`", format_default(default), number.line
        return
    if schema is StartRecipe:
        for kind in STARTS:
            nested = nested_type(kind.options)
            yield f"`{parent}{kind.name}`", "", kind.line
            yield from () if nested is None else recipe_rows(nested, f"{parent}{kind.name}.")
        return
    meanings = parse_meanings(schema)
    hints = typing.get_type_hints(schema)
    for name, default in defaults(schema, instance):
        key, nested = f"{parent}{name}", nested_type(hints[name])
        parts = (
            []
            if nested is None
            else list(recipe_rows(nested, f"{key}.", make_instance(nested, default)))
        )
        shown = "required" if default is MISSING else "" if parts else format_default(default)
        meaning = meanings.get(name) or summary(nested, name)
        yield f"`{key}`", shown, with_numbers(meaning, schema)
        yield from parts


def defaults(schema: type, instance: object) -> Iterator[tuple[str, object]]:
    """Yield the fields with the values of an instance, or with their defaults."""
    if issubclass(schema, BaseModel):
        for name, entry in schema.model_fields.items():
            own = MISSING if entry.is_required() else entry.get_default(call_default_factory=True)
            yield name, getattr(instance, name, own)
    else:
        for field in dataclasses.fields(schema):
            own = field.default
            if own is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
                own = field.default_factory()
            yield (
                field.name,
                getattr(instance, field.name, MISSING if own is dataclasses.MISSING else own),
            )


def nested_type(hint: Any) -> type | None:
    """Class of options in a type that may be optional or annotated."""
    if isinstance(hint, type) and not isinstance(hint, types.GenericAlias):
        is_options = (
            issubclass(hint, BaseModel)
            or dataclasses.is_dataclass(hint)
            or hasattr(hint, "list_numbers")
        )
        return hint if is_options else None
    parts = (nested_type(part) for part in typing.get_args(hint) if part is not type(None))
    return next((part for part in parts if part is not None), None)


def make_instance(schema: type, default: object) -> object:
    """The default, or an instance with all defaults if it is None."""
    if default is not None and default is not MISSING:
        return default
    try:
        return schema()
    except (TypeError, ValueError):
        return None


def format_default(value: object) -> str:
    """Default as a recipe has it."""
    if value is None:
        return ""
    plain = to_jsonable_python(value)
    return f"`{plain if isinstance(plain, str) else json.dumps(plain)}`"


def parse_meanings(schema: type) -> dict[str, str]:
    """Documentation of the fields of a class, in its docstring or below each field."""
    text = inspect.getdoc(schema) or ""
    section = re.search(r"^Attributes\n-+\n(.*?)(?=^\w+\n-+\n|^\S+: *\n|\Z)", text, re.S | re.M)
    meanings: dict[str, str] = {}
    names = "|".join(typing.get_type_hints(schema))
    field = rf"(?:{names})(?:, (?:{names}))*"
    for entry in re.split(r"\n(?=\S)", section[1]) if section else ():
        for match in re.finditer(
            rf"(?:^|[;.]\s)({field}): (.*?)(?=[;.]\s{field}: |\Z)", entry, re.S
        ):
            for name in match[1].split(", "):
                meanings[name] = tidy(match[2])
    bases = [base for base in reversed(schema.__mro__) if dataclasses.is_dataclass(base)]
    for each in dict.fromkeys([*bases, schema]):
        source = ast.parse(textwrap.dedent(inspect.getsource(each))).body[0]
        assert isinstance(source, ast.ClassDef)
        for entry, below in itertools.pairwise(source.body):
            if isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name):
                value = below.value if isinstance(below, ast.Expr) else None
                if isinstance(value, ast.Constant) and isinstance(value.value, str):
                    meanings[entry.target.id] = tidy(value.value)
    if issubclass(schema, BaseModel):
        for name, entry in schema.model_fields.items():
            if entry.description:
                meanings[name] = tidy(entry.description)
    return meanings


def summary(schema: type | None, name: str) -> str:
    """First sentence of the docstring of an entry's class."""
    first = (inspect.getdoc(schema) or "").split("\n\n")[0] if schema is not None else ""
    first = tidy(first).split(". ")[0]
    return re.sub(rf"^`[\w.]*\b{name}`[:,] *", "", first)


def with_numbers(meaning: str, schema: type) -> str:
    """Meaning with the values of constants of its module."""
    constants = vars(sys.modules[schema.__module__])

    def number(match: re.Match[str]) -> str:
        value = constants.get(match[1])
        return f"{value:g}" if isinstance(value, int | float) else match[0]

    return re.sub(r"`([A-Z][A-Z_]+)`", number, meaning)


def tidy(text: str) -> str:
    """Join lines and remove the full stop."""
    line = " ".join(text.split()).replace("``", "`")
    return line if line.endswith("...") else line.removesuffix(".")


def main() -> int:
    """Rewrite all tables and print the pages that changed."""
    makers = tables()
    for page in pages():
        old = page.read_text(encoding="utf-8")
        new = rewrite(old, makers)
        if new != old:
            page.write_text(new, encoding="utf-8")
            print(page.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
