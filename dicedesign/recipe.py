"""A recipe file read into checked options.

The parts of the schema that are options of the method or the engraving are the option classes
themselves; only what a file adds to them is described here.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from dicedesign.design.descent import DescentOptions
from dicedesign.design.targets import Target, binomial, fair, listed, relabelled, sum_of_dice
from dicedesign.errors import InputError, RecipeError
from dicedesign.fabricate.engraving_options import EngravingOptions

__all__ = ["Recipe", "StartRecipe", "TargetRecipe", "read_recipe"]


def _fraction(value: object) -> object:
    if isinstance(value, str):
        try:
            return float(Fraction(value.replace(" ", "")))
        except (ValueError, ZeroDivisionError) as error:
            raise ValueError(
                f"expected a number or a fraction such as 1/36, got {value!r}"
            ) from error
    return value


def _text(value: object) -> object:
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _word(word: str, meaning: object) -> BeforeValidator:
    return BeforeValidator(lambda value: meaning if value == word else value)


def _switch(value: object) -> object:
    return {True: {}, False: None}[value] if isinstance(value, bool) else value


Label = Annotated[str, BeforeValidator(_text), Field(min_length=1, max_length=12)]
Probability = Annotated[float, BeforeValidator(_fraction)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _one_of(model: BaseModel, *names: str) -> None:
    given = [name for name in names if getattr(model, name) is not None]
    if len(given) != 1:
        got = " and ".join(given) if given else "none of them"
        raise ValueError(f"expected exactly one of {', '.join(names)}, got {got}")


class TargetRecipe(_Strict):
    """`target`: one distribution, perhaps with labels of one's own."""

    binomial: int | None = None
    sum_of_dice: list[int] | None = None
    fair: int | None = None
    probabilities: list[Probability] | None = None
    labels: list[Label] | None = None

    @model_validator(mode="after")
    def _check(self) -> TargetRecipe:
        _one_of(self, "binomial", "sum_of_dice", "fair", "probabilities")
        self.target()
        return self

    def target(self) -> Target:
        """The distribution with its labels."""
        if self.binomial is not None:
            bare = binomial(self.binomial)
        elif self.sum_of_dice is not None:
            bare = sum_of_dice(self.sum_of_dice)
        elif self.fair is not None:
            bare = fair(self.fair)
        else:
            bare = listed(self.probabilities or [])
        return relabelled(bare, self.labels)


class PrismRecipe(_Strict):
    """`start.prism`: sides default to the number of outcomes."""

    sides: int | None = None
    height: float = 1.5
    cap: float = 1.3


class RepulsionRecipe(_Strict):
    """`start.repulsion`: one facet for each outcome."""


class MeshRecipe(_Strict):
    """`start.mesh`: the convex hull of a file, its path relative to the recipe."""

    path: str


class StartRecipe(_Strict):
    """`start`: one starting shape."""

    prism: PrismRecipe | None = None
    hendecahedron: Literal["bisymmetric", "circus"] | None = None
    repulsion: RepulsionRecipe | None = None
    mesh: MeshRecipe | None = None

    @model_validator(mode="after")
    def _check(self) -> StartRecipe:
        _one_of(self, "prism", "hendecahedron", "repulsion", "mesh")
        return self


class MethodRecipe(_Strict):
    """`method`: how the die is found."""

    descent: DescentOptions = Field(default_factory=DescentOptions)


class Recipe(_Strict):
    """A whole recipe.

    Attributes
    ----------
    name: folder name of the results.
    seed: of everything random.
    target, start: what is wanted, and what to begin with.
    assignment: labels in the order of the start's directions; None for the order of the target.
    center_of_mass: (3,) fixed, in the start's unit; None for the uniform solid.
    size_mm: largest vertex-to-vertex distance of the printed die.
    engrave: engraving options, or None for a plain die.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)]
    target: TargetRecipe
    start: StartRecipe
    seed: Annotated[int, Field(ge=0)] = 0
    assignment: Annotated[list[Label] | None, _word("in_order", None)] = None
    center_of_mass: Annotated[
        tuple[float, float, float] | None,
        _word("uniform", None),
        BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
    ] = None
    method: MethodRecipe = Field(default_factory=MethodRecipe)
    size_mm: Annotated[float, Field(gt=0.0, le=1000.0)] = 30.0
    engrave: Annotated[EngravingOptions | None, BeforeValidator(_switch)] = Field(
        default_factory=EngravingOptions
    )

    @model_validator(mode="after")
    def _check(self) -> Recipe:
        labels = self.target.target().labels
        if self.assignment is not None and sorted(self.assignment) != sorted(labels):
            raise ValueError(
                f"assignment: expected each of the labels {', '.join(labels)} once, got "
                f"{', '.join(self.assignment)}"
            )
        return self

    def outcome_of_direction(self) -> list[int]:
        """For each direction of the start, the index of its outcome in the target."""
        labels = self.target.target().labels
        return [labels.index(label) for label in self.assignment or labels]

    def resolved(self) -> dict[str, Any]:
        """The recipe with every default written out, as plain data."""
        plain: dict[str, Any] = TypeAdapter(Recipe).dump_python(self, mode="json")
        plain["assignment"] = plain["assignment"] or "in_order"
        plain["center_of_mass"] = plain["center_of_mass"] or "uniform"
        plain["engrave"] = plain["engrave"] or False
        for part in ("target", "start"):
            plain[part] = {key: value for key, value in plain[part].items() if value is not None}
        return plain


def read_recipe(path: Path, changes: Sequence[str] = ()) -> Recipe:
    """Read a YAML recipe.

    Parameters
    ----------
    path: the file.
    changes: texts "dotted.key=value" that replace or add entries, values in YAML.

    Raises
    ------
    RecipeError: the file is missing or no YAML mapping, or an entry is unknown or unusable; the
        message names file, key, what was expected and what came.
    """
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise RecipeError(f"{path}: expected a readable recipe file, but {reason}") from error
    data = _load(content, str(path))
    if not isinstance(data, dict):
        raise RecipeError(
            f"{path}: expected keys and values (name: ..., target: ...), got {data!r}"
        )
    for change in changes:
        _apply(data, change)
    _resolve_mesh_path(data, path.parent)
    try:
        # Through JSON: strict validation then takes mappings for options and lists for tuples.
        return Recipe.model_validate_json(json.dumps(data, default=str))
    except ValidationError as error:
        raise RecipeError(_explain(path, error)) from error


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


def _load(content: str, where: str) -> object:
    try:
        return yaml.load(content, Loader=_Loader)
    except (yaml.YAMLError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise RecipeError(f"{where}: expected YAML, but {reason}") from error


def _apply(data: dict[str, Any], change: str) -> None:
    key, equals, value = change.partition("=")
    if not equals or not key.strip():
        raise RecipeError(f"--set {change}: expected key=value, such as size_mm=40")
    *parents, last = key.strip().split(".")
    for parent in parents:
        if not isinstance(data.get(parent), dict):
            data[parent] = {}
        data = data[parent]
    data[last] = _load(value, f"--set {key}")


def _resolve_mesh_path(data: Mapping[str, Any], folder: Path) -> None:
    start = data.get("start")
    mesh = start.get("mesh") if isinstance(start, dict) else None
    if isinstance(mesh, dict) and isinstance(mesh.get("path"), str):
        mesh["path"] = str(folder / mesh["path"])


def _explain(path: Path, error: ValidationError) -> str:
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if not str(part).startswith("function-"))
    cause = first.get("ctx", {}).get("error")
    if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        known = sorted(set(_property_names(Recipe.model_json_schema())))
        close = difflib.get_close_matches(str(first["loc"][-1]), known, n=1)
        hint = f"did you mean {close[0]!r}?" if close else "remove it"
        return f"{path}: {key}: unknown key; {hint}"
    if first["type"] == "missing":
        return f"{path}: {key}: expected this key, but it is missing; add it"
    if isinstance(cause, InputError | ValueError):
        return f"{path}: {key + ': ' if key else ''}{cause}"
    message = first["msg"][0].lower() + first["msg"][1:]
    return f"{path}: {key}: {message}, got {first['input']!r}"


def _property_names(schema: object) -> Iterator[str]:
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
        for part in schema.values():
            yield from _property_names(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from _property_names(part)
