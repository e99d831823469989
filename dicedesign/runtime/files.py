"""Files that are read whole, files that are written whole or not at all, JSON, and folders that one
process alone writes into."""

from __future__ import annotations

import contextlib
import json
import os
import re
import secrets
import signal
import stat
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Final

from dicedesign.errors import InputError, OutputError

MAX_TEXT_BYTES: Final = 1 << 24
"""Bytes of a file that people write: 16 MiB."""

MAX_DATA_BYTES: Final = 1 << 32
"""Bytes of a file that programs write: 4 GiB."""

_FLAGS: Final = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""Each system has one of the last two."""

_KINDS: Final = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def read_file(
    path: Path, kind: str, *, most: int = MAX_DATA_BYTES, error: type[InputError] = InputError
) -> bytes:
    """Content of a regular file; nothing else is waited for.

    Parameters
    ----------
    path: the file, or a link to one.
    kind: what it is expected to be, for messages, such as "a mesh or point file".
    most: bytes that it may have.
    error: what is raised, InputError or one of its subclasses: there is no such file, it cannot be
        read, it is a directory, a pipe or a device, or it is larger.
    """
    try:
        # A pipe that nobody writes to would be waited for.
        handle = os.open(path, _FLAGS)
        with open(handle, "rb") as file:
            wrong = _wrong(os.fstat(handle), kind, most)
            data = b"" if wrong else file.read()
    except FileNotFoundError as fault:
        raise error(f"{path}: no such file; check the path") from fault
    except IsADirectoryError as fault:
        raise error(f"{path}: expected {kind}, got a directory; name a file") from fault
    except (OSError, ValueError, MemoryError) as fault:
        raise error(
            f"{path}: expected a readable file, got {_reason(fault)!r}; check path and permissions"
        ) from fault
    if wrong:
        raise error(f"{path}: {wrong}")
    return data


def _wrong(status: os.stat_result, kind: str, most: int) -> str:
    """What is wrong with a file, if anything, before it is read."""
    if not stat.S_ISREG(status.st_mode):
        file_kind = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        return f"expected {kind}, got {file_kind}; name a file"
    if status.st_size > most:
        return (
            f"expected {kind} of at most {most >> 20} MiB, got {status.st_size >> 20}; name "
            "another file"
        )
    return ""


def _reason(fault: Exception) -> str:
    """What the system says; Python itself refuses names that no file can have."""
    return getattr(fault, "strerror", None) or str(fault) or "too little memory"


def read_text(path: Path, kind: str, *, error: type[InputError] = InputError) -> str:
    """Text of a regular file in UTF-8 of at most `MAX_TEXT_BYTES` bytes; parameters and errors as
    of `read_file`."""
    data = read_file(path, kind, most=MAX_TEXT_BYTES, error=error)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(f"{path}: expected {kind} in UTF-8, but {fault}; save it as such") from fault


def json_text(data: object) -> str:
    """Plain data as JSON for people, with a line feed at its end. Raises ValueError: a number is
    not finite."""
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def plain(value: object) -> Any:
    """Dataclasses, within mappings and sequences too, as plain data for `json_text`: a key for each
    field, but for optional ones (of default None) that are None."""
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
    """Write a file so that its path holds the old content or all of the new, even after a crash.

    Where the path is a link, the file that it leads to is written; a device or a pipe takes the
    data as they come.

    Parameters
    ----------
    path: the file, in an existing folder.
    data: its content.

    Raises
    ------
    OutputError: the file cannot be written; nothing is left behind.
    """
    try:
        if _is_stream(path):
            Path(path).write_bytes(data)
        else:
            _replace(Path(os.path.realpath(path)), data)
    except (OSError, ValueError) as error:
        raise OutputError(
            f"{path}: expected to write a file in an existing, writable folder with space left, "
            f"got {_reason(error)!r}; create the folder or choose another path"
        ) from error


def _is_stream(path: Path) -> bool:
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def _replace(path: Path, data: bytes) -> None:
    partial = _partial_file(path)
    try:
        with partial.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()
    # The new name is kept over a power failure where the system can sync a folder.
    with contextlib.suppress(OSError):
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _partial_file(path: Path) -> Path:
    """Another name for a file, while it is not whole yet."""
    return path.with_name(f".{path.name[:_MOST_OF_NAME]}.{secrets.token_hex(8)}.part")


_MOST_OF_NAME: Final = 40
"""Characters of a file's name in that of its partial file, which must not become too long."""


def remove_partial_files(folder: Path, name: str | None = None) -> None:
    """Remove what processes left that were killed while they wrote into a folder.

    name: of the one file that they wrote; None for any. Nobody else may write it meanwhile.
    """
    stem = ".*" if name is None else re.escape(name[:_MOST_OF_NAME])
    pattern = re.compile(rf"\.{stem}\.[0-9a-f]{{16}}\.part", re.DOTALL)
    with contextlib.suppress(OSError, ValueError):
        for entry in list(os.scandir(folder)):
            if pattern.fullmatch(entry.name):
                os.unlink(entry.path)


@contextmanager
def open_output_folder(folder: Path) -> Iterator[None]:
    """Make a writable folder. If an error leaves it empty, remove it with its new parents.

    Raises
    ------
    OutputError: the folder cannot be made or written.
    """
    missing = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        make_writable_folder(folder)
        yield
    except BaseException:
        for path in missing:
            # It may not exist yet, or hold a checkpoint.
            with contextlib.suppress(OSError, ValueError):
                path.rmdir()
        raise


def make_writable_folder(folder: Path) -> None:
    """Make a folder for results if it is missing, and try whether files can be made in it.

    Raises
    ------
    OutputError: it cannot be made or written.
    """
    probe = _partial_file(folder / "probe")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch(exist_ok=False)
        # Whoever has the folder alone may have removed it.
        probe.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        raise OutputError(
            f"{folder}: expected a folder that can be written, got {_reason(error)!r}; choose "
            "another with --out"
        ) from error


LOCK: Final = ".lock"
"""There while somebody writes into the folder; says who. Beyond the end of its holder, however that
came, it locks nothing."""


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Nobody else comes in here with the same folder, an existing one, meanwhile.

    Raises
    ------
    InputError: somebody is here already; the message says which process on which machine.
    OutputError: the lock cannot be written.
    """
    try:
        import fcntl
    except ImportError:
        # Windows.
        yield
        return
    path = folder / LOCK
    handle = _opened(path)
    try:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                holder = os.read(handle, 100).decode("utf-8", "replace") or "another process"
                raise InputError(
                    f"{folder}: expected a folder that nobody else writes into, but {holder} does; "
                    "wait for it, or choose another folder with --out"
                ) from error
            if _is_at(handle, path):
                break
            # Its last holder has removed it meanwhile.
            os.close(handle)
            handle = _opened(path)
        os.truncate(handle, 0)
        os.write(handle, f"process {os.getpid()} on {os.uname().nodename}".encode())
        try:
            yield
        finally:
            path.unlink(missing_ok=True)
    finally:
        os.close(handle)


def _opened(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise OutputError(
            f"{path}: expected a file that can be written, got {error.strerror!r}; choose another "
            "folder with --out"
        ) from error


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False


@contextmanager
def hold_interrupts(said: str) -> Iterator[None]:
    """An interrupt that comes in here is raised at the end of it, for something short.

    said: the message of that KeyboardInterrupt. Where somebody else handles interrupts, and in
    threads that get none, nothing is held.
    """
    before = signal.getsignal(signal.SIGINT)
    main_thread = threading.current_thread() is threading.main_thread()
    if before is not signal.default_int_handler or not main_thread:
        yield
        return
    arrived: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if arrived:
        raise KeyboardInterrupt(said)
