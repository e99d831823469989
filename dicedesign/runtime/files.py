"""Read whole files, write files atomically, make JSON, and lock folders."""

from __future__ import annotations

import contextlib
import json
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from dicedesign.errors import InputError, OutputError
from dicedesign.runtime.interrupts import hold_interrupts

MAX_TEXT_BYTES = 1 << 24
"""Limit for files written by people: 16 MiB."""

MAX_DATA_BYTES = 1 << 32
"""Limit for files written by programs: 4 GiB."""

MIN_FREE_BYTES = 1 << 24
"""Room for results that is looked for before the work: 16 MiB."""

MIN_MEMORY_BYTES = 3 << 26
"""Address space that NumPy needs, 192 MiB: with less, its libraries end the process."""

DESIGN_MEMORY_BYTES = 3 << 29
"""Address space of a small design, 1.5 GiB: with less, it fails at its end, or waits for ever."""

_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""Each system has one of the last two flags."""


def read_file(
    path: Path, kind: str, *, most: int = MAX_DATA_BYTES, error: type[InputError] = InputError
) -> bytes:
    """Read a regular file, without waiting for pipes or devices.

    Parameters
    ----------
    path: file, or a link to one.
    kind: expected content for messages, such as "a mesh or point file".
    most: size limit in bytes.
    error: exception for a missing, unreadable or too large file, a directory, a pipe or a device;
        InputError or one of its subclasses.
    """
    try:
        # Opening a pipe must not block.
        handle = os.open(path, _FLAGS)
        with open(handle, "rb") as file:
            status = os.fstat(handle)
            is_regular = stat.S_ISREG(status.st_mode)
            # A file that grows meanwhile must not fill the memory.
            size = status.st_size if is_regular and status.st_size <= most else 0
            data = file.read(size) or b""
    except FileNotFoundError as fault:
        raise error(f"{path}: no such file; check the path") from fault
    except IsADirectoryError as fault:
        raise error(f"{path}: expected {kind}, got a directory; name a file") from fault
    except (OSError, ValueError, MemoryError) as fault:
        raise error(
            f"{path}: expected a readable file, got {_reason(fault)!r}; check path and permissions"
        ) from fault
    if not is_regular:
        raise error(f"{path}: expected {kind}, got a pipe or a device; name a file")
    if status.st_size > most:
        raise error(
            f"{path}: expected {kind} of at most {most >> 20} MiB, got {status.st_size >> 20}; "
            "name another file"
        )
    return data


def _reason(fault: Exception) -> str:
    """Reason given by the system, or by Python for an invalid file name."""
    return getattr(fault, "strerror", None) or str(fault) or "too little memory"


def read_text(path: Path, kind: str, *, error: type[InputError] = InputError) -> str:
    """Read a UTF-8 text file of at most `MAX_TEXT_BYTES` bytes; parameters and errors as
    of `read_file`."""
    data = read_file(path, kind, most=MAX_TEXT_BYTES, error=error)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(f"{path}: expected {kind} in UTF-8, but {fault}; save it as such") from fault


def json_text(data: object) -> str:
    """Indented JSON of plain data, with a final line feed. Raises ValueError if a number is not
    finite."""
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def plain(value: object) -> Any:
    """Convert dataclasses, also nested ones, to plain data: a key for each field, except fields
    that are None and have this default."""
    if is_dataclass(value) and not isinstance(value, type):
        pairs = [(field, getattr(value, field.name)) for field in fields(value)]
        return {
            field.name: plain(each)
            for field, each in pairs
            if each is not None or field.default is not None
        }
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value


def atomic_write(path: Path, data: bytes) -> None:
    """Write a file atomically: even after a crash it has its old content or all of the new.

    Links are followed; devices and pipes are written directly.

    Parameters
    ----------
    path: the file, in an existing folder.
    data: its content.

    Raises
    ------
    OutputError: the file cannot be written; nothing is left behind.
    """
    write_files({path: data})


def write_files(contents: Mapping[Path, bytes]) -> None:
    """Write files as `stage_files` does."""
    with stage_files(contents):
        pass


@contextmanager
def stage_files(contents: Mapping[Path, bytes]) -> Iterator[None]:
    """Write files on entry under temporary names, and rename them on exit, in their order.

    If the disk has no space for all of them, or the block raises, none of them changes. Links are
    followed; devices and pipes are written on exit.

    Parameters
    ----------
    contents: the content of each file, in existing folders.

    Raises
    ------
    OutputError: a file cannot be written; no temporary file is left behind.
    """
    partials: dict[Path, Path] = {}
    try:
        for path, data in contents.items():
            with _explain_failure(path):
                if not is_stream(path):
                    partials[path] = partial = _partial_file(Path(os.path.realpath(path)))
                    with partial.open("xb") as file:
                        file.write(data)
                        file.flush()
                        os.fsync(file.fileno())
        yield
        for path, data in contents.items():
            with _explain_failure(path):
                if path in partials:
                    os.replace(partials[path], os.path.realpath(path))
                else:
                    Path(path).write_bytes(data)
    finally:
        for partial in partials.values():
            with contextlib.suppress(OSError, ValueError):
                partial.unlink(missing_ok=True)
    # Sync the folders where possible, so that the new names survive a power failure.
    for parent in {partial.parent for partial in partials.values()}:
        with contextlib.suppress(OSError):
            folder = os.open(parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


@contextmanager
def _explain_failure(path: Path) -> Iterator[None]:
    """Raise OutputError for a system error while a file is written."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise OutputError(
            f"{path}: expected to write a file in an existing, writable folder with space left, "
            f"got {_reason(error)!r}; create the folder or choose another path"
        ) from error


def is_stream(path: Path) -> bool:
    """Whether a path is a device or a pipe, also by a link."""
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def _partial_file(path: Path) -> Path:
    """Temporary path of a file while it is written."""
    return path.with_name(f".{path.name[:_MAX_NAME]}.{secrets.token_hex(8)}.part")


_MAX_NAME = 40
"""Characters of a file name in the name of its partial file."""


def remove_partial_files(folder: Path, name: str | None = None) -> None:
    """Remove partial files of killed processes.

    name: file whose partial files to remove; None for all. No other process may write it.
    """
    stem = ".*" if name is None else re.escape(name[:_MAX_NAME])
    pattern = re.compile(rf"\.{stem}\.[0-9a-f]{{16}}\.part", re.DOTALL)
    with contextlib.suppress(OSError, ValueError):
        for entry in list(os.scandir(folder)):
            if pattern.fullmatch(entry.name):
                os.unlink(entry.path)


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove files of a folder if they exist. Raises OutputError."""
    try:
        for name in names:
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: expected old results that can be removed, but {error.strerror}; choose "
            "another folder with --out"
        ) from error


@contextmanager
def open_output_folder(folder: Path) -> Iterator[None]:
    """Make a writable folder. If an error leaves it empty, remove it with its new parents.

    Raises
    ------
    OutputError: the folder cannot be created or written.
    """
    missing = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        make_writable_folder(folder)
        yield
    except BaseException:
        with hold_interrupts():
            for path in missing:
                # It may not exist yet, or hold a checkpoint.
                with contextlib.suppress(OSError, ValueError):
                    path.rmdir()
        raise


def make_writable_folder(folder: Path) -> None:
    """Make a folder for results if it is missing, and check that it is writable and has room.

    Raises
    ------
    OutputError: it cannot be created or written, or less than `MIN_FREE_BYTES` are left on its disk
        or allowed for a file.
    """
    probe = _partial_file(folder / "probe")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with hold_interrupts():
            probe.touch(exist_ok=False)
            # The process that locks the folder may have removed it.
            probe.unlink(missing_ok=True)
        free = shutil.disk_usage(folder).free
    except (OSError, ValueError) as error:
        raise OutputError(
            f"{folder}: expected a folder that can be written, got {_reason(error)!r}; choose "
            "another with --out"
        ) from error
    if free < MIN_FREE_BYTES:
        raise OutputError(
            f"{folder}: expected at least {MIN_FREE_BYTES >> 20} MiB free on its disk, got "
            f"{free >> 10} KiB; make room, or choose another with --out"
        )
    if (most := _limit("RLIMIT_FSIZE")) is not None and most < MIN_FREE_BYTES:
        raise OutputError(
            f"{folder}: expected files of up to {MIN_FREE_BYTES >> 20} MiB to be allowed, got a "
            f"limit of {most >> 10} KiB; raise it, as by `ulimit -f unlimited`"
        )


def check_memory(least: int = MIN_MEMORY_BYTES) -> None:
    """Raise OutputError if the system allows this process less than this number of bytes."""
    if (most := _limit("RLIMIT_AS")) is not None and most < least:
        raise OutputError(
            f"memory: expected at least {least >> 20} MiB for this process, got a limit "
            f"of {most >> 20}; raise it, as by `ulimit -v unlimited`"
        )


def _limit(name: str) -> int | None:
    """Limit of the system for this process, in bytes; None without one."""
    try:
        import resource
    except ImportError:
        # Windows.
        return None
    soft, _ = resource.getrlimit(getattr(resource, name))
    return None if soft == resource.RLIM_INFINITY else soft


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Lock an existing folder against other processes, where the file system can.

    Raises InputError: another process holds the lock.
    """
    try:
        import fcntl
    except ImportError:
        # Windows.
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        # Network file systems may lock no folders.
        with contextlib.suppress(OSError):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError(
                    f"{folder}: expected a folder that no other process uses, but one does; wait "
                    "for it, or choose another folder with --out"
                ) from error
        yield
    finally:
        os.close(handle)
