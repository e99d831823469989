"""Target, start and method of a recipe, as checked entries."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Final

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    create_model,
    model_validator,
)
from pydantic_core import core_schema

# Registers the surfaces that the package builds.
from dicedesign.concave.options import ConcaveOptions
from dicedesign.optimize.options import ExactOptions, PaperOptions
from dicedesign.optimize.starts.start import STARTS, Start, StartKind, Task, made_start
from dicedesign.optimize.targets import Target, binomial, fair, listed, relabelled, sum_of_dice

LONGEST_LABEL: Final = 24
"""Characters that a facet may bear, in one line or more."""


def _fraction(value: object) -> object:
    if not isinstance(value, str):
        return value
    above, slash, below = value.partition("/")
    try:
        number = float(above) / (float(below) if slash else 1.0)
    except (ValueError, ZeroDivisionError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"expected a number or a fraction such as 1/36, got {value!r}; correct it")
    return number


def _text(value: object) -> object:
    if value is None or isinstance(value, bool):
        raise ValueError(
            f"expected a text, got {value}, which is how YAML reads words such as yes, no, on, off "
            "and null; put it in quotes"
        )
    is_number = isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))
    text = str(value) if is_number else value
    if isinstance(text, str) and not 1 <= len(text) <= LONGEST_LABEL:
        raise ValueError(f"expected 1 to {LONGEST_LABEL} characters, got {text!r}; rewrite it")
    if isinstance(text, str) and "\n" in text:
        raise ValueError(
            "expected a label in one line, which is broken at spaces where that makes it larger, "
            f"got {text!r}; write spaces"
        )
    return text


Label = Annotated[str, BeforeValidator(_text)]

Probability = Annotated[float, BeforeValidator(_fraction)]


class Strict(BaseModel):
    """A part of a recipe: no unknown keys, no conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def one_of(model: BaseModel, *names: str) -> str:
    """The one of some entries that is given. Raises ValueError unless it is exactly one."""
    given = [name for name in names if getattr(model, name) is not None]
    if len(given) != 1:
        got = " and ".join(given) if given else "none of them"
        raise ValueError(f"expected exactly one of {', '.join(names)}, got {got}; keep one")
    return given[0]


class TargetRecipe(Strict):
    """`target`: one distribution, perhaps with labels of one's own.

    Attributes
    ----------
    binomial: heads among so many fair coins, at least 1.
    sum_of_dice: the total of fair dice with these numbers of sides, each at least 2.
    fair: so many equally probable outcomes, at least 2.
    probabilities: of the outcomes, above 0 and summing to 1; numbers or fractions such as 1/36.
    labels: of the outcomes, 1 to 24 characters each; the distribution's own unless given.
    """

    binomial: int | None = None
    sum_of_dice: list[int] | None = None
    fair: int | None = None
    probabilities: list[Probability] | None = None
    labels: list[Label] | None = None

    @model_validator(mode="after")
    def _check(self) -> TargetRecipe:
        one_of(self, "binomial", "sum_of_dice", "fair", "probabilities")
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


@dataclass(frozen=True)
class StartRecipe:
    """`start`: one starting shape, or a search for some; see `STARTS`.

    Attributes
    ----------
    name: the key of the start.
    options: what is said of it.

    The key is an attribute too: `start.mesh` has the options of a mesh, or is None for another.
    """

    name: str
    options: Any

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in STARTS:
            raise AttributeError(name)
        return self.options if name == self.name else None

    @property
    def kind(self) -> StartKind:
        """Kind of the start."""
        return STARTS[self.name]

    def check(self, outcomes: int) -> None:
        """Raise ValueError, naming the key, where the shape cannot bear so many outcomes. What a
        mesh or a shape can bear is known only once it is there."""
        self.kind.check(self.options, outcomes)

    def made(self, task: Task) -> Start | None:
        """See `made_start`."""
        return made_start(self.name, self.options, task)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        def read(entry: Any) -> StartRecipe:
            if isinstance(entry, cls):
                return entry
            keys = _start_keys()
            model = keys.model_validate_json(json.dumps(entry))
            name = one_of(model, *keys.model_fields)
            return cls(name, getattr(model, name))

        def written(start: StartRecipe) -> dict[str, Any]:
            options = TypeAdapter(start.kind.options).dump_python(start.options, mode="json")
            return {start.name: options}

        return core_schema.no_info_plain_validator_function(
            read, serialization=core_schema.plain_serializer_function_ser_schema(written)
        )

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        keys: dict[str, Any] = handler(_start_keys().__pydantic_core_schema__)
        return keys


def _start_keys() -> type[Strict]:
    """A model with a key for each start that is registered now."""
    return _keys_of(tuple((kind.name, kind.options) for kind in STARTS))


@cache
def _keys_of(kinds: tuple[tuple[str, Any], ...]) -> type[Strict]:
    keys: dict[str, Any] = {name: (options | None, None) for name, options in kinds}
    return create_model("StartKeys", __base__=Strict, **keys)


METHODS: Final = ("exact", "paper", "concave")
"""Keys of `method`."""


class MethodRecipe(Strict):
    """`method`: how the die is found: `exact` unless it says `paper`, or `concave` for a die that
    keeps the shape of its start. A word alone is the method with all its defaults."""

    exact: ExactOptions | None = Field(default_factory=ExactOptions)
    paper: PaperOptions | None = None
    concave: ConcaveOptions | None = None

    @model_validator(mode="before")
    @classmethod
    def _choose(cls, given: Any) -> Any:
        if given in METHODS:
            given = {given: {}}
        if isinstance(given, dict) and any(given.get(name) is not None for name in METHODS):
            return {"exact": None, **given}
        return given

    @model_validator(mode="after")
    def _check(self) -> MethodRecipe:
        one_of(self, *METHODS)
        return self

    @property
    def name(self) -> str:
        """The key of the method."""
        return next(key for key, value in self if value is not None)

    @property
    def thrown(self) -> bool:
        """True where the target is meant for a die that is thrown onto a table."""
        return self.exact is not None and self.exact.odds == "thrown"

    @property
    def table(self) -> str | None:
        """Name of the table that the die is thrown onto, with the way to throw, for `table_named`;
        None for a die whose target is meant without momentum."""
        return self.exact.thrown_onto if self.exact is not None and self.thrown else None

    @property
    def tolerance(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.paper is not None:
            return self.paper.reached
        options = self.exact or self.concave
        assert options is not None
        return options.tolerance
