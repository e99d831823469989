"""Extensions of one kind by name: built-in ones, those of installed packages, and those registered
by a script; and numbers by name, as many as the extensions of a kind declare."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, ClassVar, Final, Generic, TypeVar

from dicedesign.errors import InputError

STRICT: Final = {"extra": "forbid", "strict": True}
"""Class attribute `__pydantic_config__` of every option dataclass: when a recipe is read into it,
unknown keys and wrong types are errors. Nothing else in those classes knows of pydantic."""


@dataclass(frozen=True)
class Extension:
    """The declaration of an extension.

    Attributes
    ----------
    name: by which recipes and commands call it.
    line: of documentation, for help texts and the tables of the documentation.
    """

    name: str
    line: str


Kind = TypeVar("Kind", bound=Extension)


class Registry(Generic[Kind]):
    """The extensions of one kind, in their order: built-in ones as listed, then the others.

    Attributes
    ----------
    kind: what they are, for messages, in the singular.
    type: their class.
    builtin: those that come with the package, or their addresses "module:NAME", which are imported
        on first use.
    group: of entry points by which installed packages add theirs, with such addresses as values.
    """

    def __init__(
        self, kind: str, type: type[Kind], builtin: Sequence[Kind | str], group: str
    ) -> None:
        self.kind = kind
        self.type = type
        self.builtin = tuple(builtin)
        self.group = group
        self._entries: dict[str, Kind] | None = None

    def register(self, entry: Kind) -> Kind:
        """Add an extension for this process and return it. Raises InputError where its name is
        taken, or it is of another kind."""
        return self._add(self._read(), entry)

    def unregister(self, name: str) -> None:
        """Remove an extension. Raises InputError where there is no such extension."""
        del self._read()[self[name].name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all extensions, in their order."""
        return tuple(self._read())

    def __iter__(self) -> Iterator[Kind]:
        return iter(tuple(self._read().values()))

    def __contains__(self, name: object) -> bool:
        return name in self._read()

    def __getitem__(self, name: str) -> Kind:
        """Raises InputError where there is no such extension."""
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
            if isinstance(each, str):
                module, _, name = each.partition(":")
                each = getattr(import_module(module), name)
            self._add(entries, each)
        for point in _entry_points().select(group=self.group):
            try:
                self._add(entries, point.load())
            except (ImportError, AttributeError, InputError) as error:
                package = point.dist.name if point.dist else "an installed package"
                raise InputError(
                    f"{self.kind} {point.name!r} of {package}: expected the address of a "
                    f"{self.type.__name__}, but {error}; fix or uninstall that package"
                ) from error
        self._entries = entries
        return entries

    def _add(self, entries: dict[str, Kind], entry: Kind) -> Kind:
        if not isinstance(entry, self.type):
            raise InputError(
                f"{self.kind}: expected a {self.type.__name__}, got {entry!r}; register it with "
                "the others of its kind"
            )
        if entries.get(entry.name, entry) != entry:
            raise InputError(
                f"{self.kind} {entry.name!r}: expected a name of its own, got one that is taken; "
                "choose another"
            )
        entries[entry.name] = entry
        return entry


@cache
def _entry_points() -> Any:
    """Those of all installed packages; reading them takes milliseconds, once for all registries."""
    from importlib.metadata import entry_points

    return entry_points()


@dataclass(frozen=True, kw_only=True)
class Number:
    """One number among the options of an extension.

    Attributes
    ----------
    name: by which recipes give it.
    default: what it is unless given.
    line: of documentation.
    expected: what it may be, in words; remedy: what to do else.
    allows: tells whether it may be some number.
    """

    name: str
    default: float
    line: str
    expected: str
    remedy: str
    allows: Callable[[float], bool]


Own = TypeVar("Own", bound="Numbers")


class Numbers:
    """Numbers by name, each an attribute: those that were given, and defaults for all others that
    are declared now or later. Once made, they stay as they are.

    Subclasses say what is declared. A recipe's entry is read into one by what is declared then.
    """

    __slots__ = ("_values",)

    prefix: ClassVar[str] = ""
    """Of names in messages."""

    def __init__(self, **given: float) -> None:
        """Raises InputError for a name that nothing declares, a number that is not allowed, and a
        declared name that the class needs for itself."""
        declared = self.list_numbers()
        for name in declared:
            if hasattr(type(self), name):
                raise InputError(
                    f"{self.prefix}{name}: expected another name, got one that numbers need for "
                    "themselves; choose another"
                )
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
        """What may be given, by name, in order."""
        raise NotImplementedError

    def as_dict(self) -> dict[str, float]:
        """All numbers by name."""
        return {
            name: self._values.get(name, number.default)
            for name, number in self.list_numbers().items()
        }

    def changed(self: Own, **changes: float) -> Own:
        """The same with some other numbers."""
        return type(self)(**{**self.as_dict(), **changes})

    def __getattr__(self, name: str) -> float:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._values:
            return self._values[name]
        later = self.list_numbers().get(name)
        if later is None:
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        return later.default

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other.as_dict() == self.as_dict()

    def __hash__(self) -> int:
        return hash(tuple(self.as_dict().items()))

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.as_dict().items())
        return f"{type(self).__name__}({given})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), self.as_dict())

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


def _remade(kind: type[Own], given: Mapping[str, float]) -> Own:
    return kind(**given)
