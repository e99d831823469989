"""Registries of extensions, and named numbers that extensions declare."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pkgutil import resolve_name
from typing import Any, ClassVar, Generic, TypeVar, get_type_hints

from dicedesign.errors import InputError

EXPECTED = {
    "bool_type": "true or false",
    "dataclass_type": "keys and values",
    "dict_type": "keys and values",
    "finite_number": "a finite number",
    "float_type": "a number",
    "greater_than": "a number above {gt:.15g}",
    "greater_than_equal": "a number of at least {ge:.15g}",
    "int_type": "a whole number",
    "less_than": "a number below {lt:.15g}",
    "less_than_equal": "a number of at most {le:.15g}",
    "list_type": "a list",
    "literal_error": "{expected}",
    "model_type": "keys and values",
    "string_pattern_mismatch": "letters, digits, spaces, dots, dashes and underscores, up to 100, "
    "the first a letter or a digit",
    "string_type": "a text",
    "too_long": "at most {max_length} entries",
    "too_short": "at least {min_length} entries",
    "tuple_type": "a list",
}
"""What an entry should be, by the type of pydantic's error."""


def key_of(error: Mapping[str, Any]) -> str:
    """Dotted key of one of pydantic's errors."""
    return ".".join(str(part) for part in error["loc"] if not str(part).startswith("function-"))


def explain(error: Mapping[str, Any]) -> str:
    """Explain one of pydantic's errors, beginning with its dotted key."""
    key, context = key_of(error), error.get("ctx", {})
    cause = context.get("error")
    if isinstance(cause, ValueError):
        parent, _, last = key.rpartition(".")
        if str(cause).startswith((f"{last}.", f"{last}:")):
            # The message already names the last key.
            return f"{parent}.{cause}".lstrip(".")
        return f"{key + ': ' if key else ''}{cause}"
    expected = EXPECTED.get(error["type"], "another value").format(**context)
    return f"{key or 'recipe'}: expected {expected}, got {reprlib.repr(error['input'])}; correct it"


@dataclass(frozen=True)
class Options:
    """Base of option dataclasses. Fields are checked against their annotations, in recipes and in
    Python; limits are annotations such as `Annotated[float, pydantic.Field(gt=0.0)]`.

    Raises InputError, which begins with the name of a field: it has another type, or is beyond its
    limits.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid", "strict": True, "allow_inf_nan": False}

    def __post_init__(self) -> None:
        # Imported late: queries of meshes have no options.
        from pydantic import ValidationError

        kind: Any = type(self)
        try:
            _field_model(kind).model_validate(vars(self))
        except ValidationError as error:
            raise InputError(explain(error.errors()[0])) from error


@cache
def _field_model(kind: type[Any]) -> Any:
    """Model of pydantic with the fields of an option dataclass."""
    from pydantic import create_model

    hints = get_type_hints(kind, include_extras=True)
    entries: dict[str, Any] = {each.name: (hints[each.name], ...) for each in fields(kind)}
    return create_model(kind.__name__, __config__={"allow_inf_nan": False}, **entries)


@dataclass(frozen=True)
class Extension:
    """Declaration of an extension.

    Attributes
    ----------
    name: name in recipes and commands.
    line: line of documentation, for help texts and the tables of the documentation.
    """

    name: str
    line: str


Kind = TypeVar("Kind", bound=Extension)


@dataclass(eq=False)
class Registry(Generic[Kind]):
    """Extensions of one kind: built-in ones as listed, then the others.

    Attributes
    ----------
    kind: name of the kind in the singular, for messages.
    entry_type: class of the extensions.
    builtin: extensions of this package, or their addresses "module:NAME", imported on first use.
    group: entry points of installed packages, whose values are such addresses.
    """

    kind: str
    entry_type: type[Kind]
    builtin: Sequence[Kind | str]
    group: str
    _entries: dict[str, Kind] | None = field(default=None, init=False)

    def register(self, entry: Kind, *, replace: bool = False) -> Kind:
        """Add an extension in this process and return it.

        replace: whether it replaces an extension with its name, as when a notebook cell runs again.

        Raises InputError if its name is taken and `replace` is false, or its class is wrong.
        """
        return self._add(self._read(), entry, replace)

    def unregister(self, name: str) -> None:
        """Remove an extension. Raises InputError if it does not exist."""
        del self._read()[self[name].name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all extensions, in order."""
        return tuple(self._read())

    def __iter__(self) -> Iterator[Kind]:
        return iter(tuple(self._read().values()))

    def __contains__(self, name: object) -> bool:
        return name in self._read()

    def __getitem__(self, name: str) -> Kind:
        """Extension of a name. Raises InputError if it does not exist."""
        entries = self._read()
        if name not in entries:
            raise InputError(
                f"{self.kind}: expected {', '.join(entries)}, got {name!r}; take one of them"
            )
        return entries[name]

    def _read(self) -> dict[str, Kind]:
        if self._entries is not None:
            return self._entries
        entries: dict[str, Kind] = {}
        for each in self.builtin:
            self._add(entries, resolve_name(each) if isinstance(each, str) else each)
        for point in _entry_points().select(group=self.group):
            try:
                self._add(entries, point.load())
            except (ImportError, AttributeError, InputError) as error:
                package = point.dist.name if point.dist else "an installed package"
                raise InputError(
                    f"{self.kind} {point.name!r} of {package}: expected the address of a "
                    f"{self.entry_type.__name__}, but {error}; fix or uninstall that package"
                ) from error
        self._entries = entries
        return entries

    def _add(self, entries: dict[str, Kind], entry: Kind, replace: bool = False) -> Kind:
        if not isinstance(entry, self.entry_type):
            raise InputError(
                f"{self.kind}: expected a {self.entry_type.__name__}, got {entry!r}; register "
                "it with the others of its kind"
            )
        if not replace and entries.get(entry.name, entry) != entry:
            raise InputError(
                f"{self.kind} {entry.name!r}: expected a name of its own, got one in use; "
                "choose another, or register it with replace=True"
            )
        entries[entry.name] = entry
        return entry


@cache
def _entry_points() -> Any:
    """Entry points of all installed packages, read once as that takes milliseconds."""
    from importlib.metadata import entry_points

    return entry_points()


@dataclass(frozen=True, kw_only=True)
class Number:
    """Number among the options of an extension.

    Attributes
    ----------
    name: key in recipes.
    default: default value.
    line: line of documentation.
    expected: allowed values in words; remedy: advice for other values.
    allows: whether a value is allowed.
    """

    name: str
    default: float
    line: str
    expected: str
    remedy: str
    allows: Callable[[float], bool]


Own = TypeVar("Own", bound="Numbers")


class Numbers:
    """Immutable named numbers, as attributes, with defaults for declared numbers that are not
    given.

    Subclasses list the declared numbers. Numbers declared later have their defaults.
    """

    __slots__ = ("_values",)

    prefix: ClassVar[str] = ""
    """Prefix of names in messages."""

    def __init__(self, **given: float) -> None:
        """Raises InputError for an unknown name, and a value that is not allowed."""
        declared = self.list_numbers()
        for name, value in given.items():
            number = declared.get(name)
            if number is None:
                raise InputError(
                    f"{self.prefix}{name}: expected one of {', '.join(declared)}; correct the name"
                )
            if not number.allows(value):
                raise InputError(
                    f"{self.prefix}{name}: expected {number.expected}, got {value:g}; "
                    f"{number.remedy}"
                )
        self._values = {name: given.get(name, number.default) for name, number in declared.items()}

    @classmethod
    def list_numbers(cls) -> Mapping[str, Number]:
        """Declared numbers by name, in order."""
        raise NotImplementedError

    def as_dict(self) -> dict[str, float]:
        """All numbers by name."""
        return {
            name: self._values.get(name, number.default)
            for name, number in self.list_numbers().items()
        }

    def replace(self: Own, **changes: float) -> Own:
        """Copy with other values of some numbers."""
        return type(self)(**{**self.as_dict(), **changes})

    def __getattr__(self, name: str) -> float:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._values[name] if name in self._values else self.list_numbers()[name].default
        except KeyError:
            raise AttributeError(f"{type(self).__name__} has no {name!r}") from None

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other.as_dict() == self.as_dict()

    def __hash__(self) -> int:
        return hash(tuple(self.as_dict().items()))

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.as_dict().items())
        return f"{type(self).__name__}({given})"

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        from pydantic_core import SchemaValidator, core_schema

        def read(entry: Any) -> Numbers:
            if isinstance(entry, cls):
                return entry
            number = core_schema.float_schema(strict=True)
            key = core_schema.typed_dict_field(number, required=False)
            keys = core_schema.typed_dict_schema(
                dict.fromkeys(cls.list_numbers(), key), extra_behavior="forbid"
            )
            return cls(**SchemaValidator(keys).validate_json(json.dumps(entry)))

        written = core_schema.plain_serializer_function_ser_schema(cls.as_dict)
        return core_schema.no_info_plain_validator_function(read, serialization=written)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        keys = {
            number.name: {"type": "number", "default": number.default, "description": number.line}
            for number in cls.list_numbers().values()
        }
        return {"type": "object", "properties": keys, "additionalProperties": False}
