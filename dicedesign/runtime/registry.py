"""Extensions of one kind by name: built-in ones, those of installed packages, and those registered
by a script."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, Final, Generic, TypeVar

from dicedesign.errors import InputError

STRICT: Final = {"extra": "forbid", "strict": True}
"""Class attribute `__pydantic_config__` of every option dataclass: when a recipe is read into it,
unknown keys and wrong types are errors. Nothing else in those classes knows of pydantic."""


@dataclass(frozen=True, kw_only=True)
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
