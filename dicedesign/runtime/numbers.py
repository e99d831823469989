"""Numbers by name, as many as the extensions of a kind declare."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from dicedesign.errors import InputError


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
        declared = self.declared()
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
    def declared(cls) -> Mapping[str, Number]:
        """What may be given, by name, in order."""
        raise NotImplementedError

    def as_dict(self) -> dict[str, float]:
        """All numbers by name."""
        return {
            name: self._values.get(name, number.default) for name, number in self.declared().items()
        }

    def changed(self: Own, **changes: float) -> Own:
        """The same with some other numbers."""
        return type(self)(**{**self.as_dict(), **changes})

    def __getattr__(self, name: str) -> float:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._values:
            return self._values[name]
        later = self.declared().get(name)
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
                dict.fromkeys(cls.declared(), key), extra_behavior="forbid"
            )
            return cls(**SchemaValidator(keys).validate_json(json.dumps(entry)))

        written = core_schema.plain_serializer_function_ser_schema(cls.as_dict)
        return core_schema.no_info_plain_validator_function(read, serialization=written)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        keys = {
            number.name: {"type": "number", "default": number.default, "description": number.line}
            for number in cls.declared().values()
        }
        return {"type": "object", "properties": keys, "additionalProperties": False}


def _remade(kind: type[Own], given: Mapping[str, float]) -> Own:
    return kind(**given)
