"""Extensions of one kind by name: one file each, found in a folder or registered from outside.

A kind of extension (energy terms, starting shapes, preferences, engines, hands, printers, stages,
file formats, figures, benches) is a subclass of `Extension` and a `Registry` of them. A file of the
registry's folder makes one and registers it when it is imported; the folder is imported on first
use. What others write does the same from a module of theirs: it is imported before use, or named by
an entry point of the group `ENTRY_POINTS`. Files of extensions import what is heavy inside their
functions, so that names, options and lines of documentation cost nothing.
"""

from __future__ import annotations

import pkgutil
import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from typing import Final, Generic, TypeVar

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension

ENTRY_POINTS: Final = "dicedesign.extensions"
"""Group of entry points of installed packages; each names a module that registers extensions."""


Kind = TypeVar("Kind", bound=Extension)


class FolderRegistry(Generic[Kind]):
    """The extensions of one kind.

    Attributes
    ----------
    kind: what they are, for messages, in the singular.
    folder: package whose modules are imported on first use, each of which registers one.
    type: their class.
    """

    def __init__(self, kind: str, folder: str, type: type[Kind]) -> None:
        self.kind = kind
        self.folder = folder
        self.type = type
        self._entries: dict[str, Kind] = {}
        self._ordered: tuple[Kind, ...] | None = None
        self._folder_is_read = False

    def register(self, entry: Kind) -> Kind:
        """Add an extension and return it. Raises InputError where its name is taken, or it is of
        another kind."""
        if not isinstance(entry, self.type):
            raise InputError(
                f"{self.kind}: expected a {self.type.__name__}, got {entry!r}; register it with "
                "the others of its kind"
            )
        # Those of the folder come first, whoever registers one beside them.
        if not sys._getframe(1).f_globals.get("__name__", "").startswith(f"{self.folder}."):
            self._read_folder()
        known = self._entries.get(entry.name)
        if known is not None and known != entry:
            raise InputError(
                f"{self.kind} {entry.name!r}: expected a name of its own, got one that is taken; "
                "choose another"
            )
        self._entries[entry.name] = entry
        self._ordered = None
        return entry

    def unregister(self, name: str) -> None:
        """Take an extension out again."""
        del self._entries[name]
        self._ordered = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of all extensions, in their order."""
        return tuple(entry.name for entry in self)

    @property
    def entries(self) -> tuple[Kind, ...]:
        """All extensions, in their order; the same object until one comes or goes."""
        self._read()
        if self._ordered is None:
            entries = sorted(self._entries.values(), key=lambda entry: (entry.rank, entry.name))
            self._ordered = tuple(entries)
        return self._ordered

    def __iter__(self) -> Iterator[Kind]:
        return iter(self.entries)

    def __contains__(self, name: object) -> bool:
        self._read()
        return name in self._entries

    def __getitem__(self, name: str) -> Kind:
        """Raises InputError where there is no such extension."""
        self._read()
        if name not in self._entries:
            raise InputError(
                f"{self.kind}: expected {', '.join(self.names)}, got {name!r}; take one of them"
            )
        return self._entries[name]

    def _read(self) -> None:
        self._read_folder()
        _load_entry_points()

    def _read_folder(self) -> None:
        if self._folder_is_read:
            return
        # Those that are imported here ask for what is registered.
        self._folder_is_read = True
        try:
            for module in pkgutil.iter_modules(import_module(self.folder).__path__):
                import_module(f"{self.folder}.{module.name}")
        except BaseException:
            self._folder_is_read = False
            raise


@cache
def _load_entry_points() -> None:
    """Import what installed packages register, once for all registries. Raises InputError where
    one cannot be imported."""
    from importlib.metadata import entry_points

    for point in entry_points(group=ENTRY_POINTS):
        try:
            point.load()
        except (ImportError, AttributeError, InputError) as error:
            package = "of an installed package" if point.dist is None else f"of {point.dist.name}"
            raise InputError(
                f"extension {point.name!r} {package}: expected a module that can be imported, but "
                f"{error}; mend or uninstall it"
            ) from error
