"""Files that a command may replace: those that it has written before, and nobody has changed since.

A folder of results has a list of its files with their checksums, such as result.json. A file is
ours if such a list in its folder names it with the checksum of its content; no other is replaced or
removed.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from dicedesign.errors import InputError, printable
from dicedesign.runtime.files import (
    is_stream,
    json_text,
    read_file,
    remove_files,
    stage_files,
)
from dicedesign.runtime.interrupts import hold_interrupts

LISTS = ("result.json", "set.json", "sweep.json")
"""Lists of files; "sha256" in them has the checksum of each by name."""

UNFINISHED = ".unfinished.json"
"""List of the files of a folder, old and new, while they are replaced."""

MAX_LIST_BYTES = 1 << 28
"""Limit for lists: 256 MiB."""

MAX_NAMED = 5
"""Largest number of files in a message."""


def checksum(data: bytes) -> str:
    """Hexadecimal SHA-256 of a file's content."""
    return hashlib.sha256(data).hexdigest()


def checksums(files: Mapping[str, bytes]) -> dict[str, str]:
    """Checksums of contents by name, "sha256" in a list of files."""
    return {name: checksum(data) for name, data in files.items()}


def is_file_name(name: str) -> bool:
    """Whether a text is the name of a file within a folder: without separators, and no parent."""
    return name not in ("", ".", "..") and not set(name) & {"/", "\\", "\0"}


def own_files(folder: Path, lists: Iterable[str] = LISTS) -> dict[str, str]:
    """Checksums, by name, of the files in a folder that its lists name with these, and of lists."""
    own: dict[str, str] = {}
    for name in (*lists, UNFINISHED):
        try:
            data = read_file(folder / name, "a list of files", most=MAX_LIST_BYTES)
            listed = json.loads(data)["sha256"].items()
        except (InputError, ValueError, RecursionError, LookupError, TypeError, AttributeError):
            continue
        own[name] = checksum(data)
        for file, sums in listed:
            found = file_checksum(folder / file) if is_file_name(file) else None
            if found is not None and (found == sums or (isinstance(sums, list) and found in sums)):
                own[file] = found
    return own


def file_checksum(path: Path) -> str | None:
    """Checksum of a file; None if it is missing or cannot be read."""
    try:
        return checksum(read_file(path, "a file"))
    except InputError:
        return None


def check_folder(
    folder: Path, names: Iterable[str], inputs: Iterable[Path] = (), own: Iterable[str] = ()
) -> None:
    """Raise InputError if a folder has files of these names that are not ours, or are inputs.

    inputs: files that are read, or folders. own: names that are known to be ours.
    """
    names = [name for name in dict.fromkeys(names) if os.path.lexists(folder / name)]
    known = {*own_files(folder), *own} if names else ()
    foreign = [name for name in names if name not in known]
    if foreign:
        raise InputError(
            f"{folder}: expected a folder in which no file of yours would be replaced, got "
            f"{_listed(foreign)}, which no result.json there lists with this content; move "
            f"{'it' if len(foreign) == 1 else 'them'}, or choose another folder with --out"
        )
    _refuse_inputs([folder / name for name in names], inputs)


def check_files(
    paths: Iterable[Path], inputs: Iterable[Path], *, overwrite: bool, option: str
) -> None:
    """Raise InputError if files to write are there already, or are inputs, also by a link.

    Parameters
    ----------
    paths: files to write; devices and pipes may be there.
    inputs: files that are read, or folders.
    overwrite: files that are there and no inputs may be replaced.
    option: that names the files.
    """
    present = [path for path in paths if os.path.lexists(path) and not is_stream(path)]
    _refuse_inputs(present, inputs, option)
    if present and not overwrite:
        raise InputError(
            f"{option}: expected {'a file' if len(present) == 1 else 'files'} yet to be written, "
            f"got {_listed(map(str, present))}, which "
            f"{'exists' if len(present) == 1 else 'exist'}; take another name, or add --overwrite"
        )


def _refuse_inputs(paths: Iterable[Path], inputs: Iterable[Path], option: str = "--out") -> None:
    """Raise InputError if one of the existing files is an input, or lies in a folder of inputs."""
    inputs = [given for given in inputs if os.path.exists(given)]
    for path in paths:
        for given in inputs:
            is_inside = os.path.isdir(given) and Path(given).resolve() in path.resolve().parents
            if is_inside or (os.path.exists(path) and os.path.samefile(path, given)):
                raise InputError(
                    f"{option}: expected another file than an input, got {path}, which "
                    f"{'lies in ' if is_inside else 'is '}{given}; take another"
                )


def _listed(names: Iterable[str]) -> str:
    names = [printable(name) for name in names]
    return ", ".join(names[:MAX_NAMED]) + ", ..." * (len(names) > MAX_NAMED)


@contextmanager
def replace_files(
    folder: Path, files: Mapping[str, bytes], sums: Mapping[str, str], name: str, data: bytes
) -> Iterator[None]:
    """Replace the files of a list in a folder, and the list last; remove those that it no longer
    names.

    On entry the files are written under temporary names and the list is removed; on exit they are
    renamed. Interrupts wait meanwhile. On a full disk, or if the block raises, the old files stay.
    Wherever the process is killed, `own_files` knows the old and the new files.

    Parameters
    ----------
    folder: existing folder.
    files: contents by name; sums: their `checksums`.
    name, data: of the list, one of `LISTS`, with these as "sha256".

    Raises
    ------
    InputError: a file of one of these names is not ours. OutputError: one cannot be written.
    """
    with hold_interrupts("the results were complete by then"):
        same = [file for file in files if file_checksum(folder / file) == sums[file]]
        check_folder(folder, [*files, name], own=same)
        before = own_files(folder, [name])
        either = {file: [before[file]] for file in before if file not in (name, UNFINISHED)}
        for file in files:
            either.setdefault(file, []).append(sums[file])
        contents = {folder / file: content for file, content in files.items()}
        with stage_files({**contents, folder / name: data}):
            unfinished = {folder / UNFINISHED: json_text({"sha256": either}).encode()}
            with stage_files(unfinished):
                pass
            remove_files(folder, [name])
            yield
            remove_files(folder, either.keys() - files.keys())
        remove_files(folder, [UNFINISHED])
