"""Options that several commands have, and what they print alike."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import InputError, check_whole
from dicedesign.runtime.files import atomic_write, json_text
from dicedesign.runtime.text import printable

if TYPE_CHECKING:
    from dicedesign.batch.batch import Center
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats
    from dicedesign.runtime.checkpoint import Checkpoint
    from dicedesign.runtime.workers import Workers


MISSING_KERNELS: Final = (
    "note: without the compiled kernels this takes many times as long; install the package where "
    "there is a C++ compiler"
)

MOST_JOBS: Final = 4096
"""More processes than any machine bears."""


def add_value(
    parser: argparse._ActionsContainer,
    name: str,
    metavar: str,
    help: str,
    type: Callable[[str], Any] = str,
    default: Any = None,
) -> None:
    """Add an option, or a positional argument, that takes one value."""
    parser.add_argument(name, metavar=metavar, help=help, type=type, default=default)


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Add `--json`."""
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def add_worker_options(parser: argparse.ArgumentParser, jobs_help: str, where: str = "") -> None:
    """Add `--jobs` and `--scheduler`; where: what their help begins with."""
    parser.add_argument("--jobs", type=int, metavar="J", help=where + jobs_help)
    parser.add_argument(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help=f"{where}run on the Dask cluster of this address, tls://HOST:PORT if encrypted; needs "
        "the extra 'cluster' (default: on this machine)",
    )


def add_engine_option(parser: argparse.ArgumentParser) -> None:
    """Add `--engine`, the simulator of throws."""
    from dicedesign.throws.engines import ENGINES

    *lines, last = (f"{engine.name}: {engine.line}" for engine in ENGINES)
    parser.add_argument(
        "--engine",
        default="native",
        metavar="NAME",
        help=f"{'; '.join(lines)}; or {last} (default: native)",
    )


def check_worker_options(options: argparse.Namespace) -> None:
    """Raise InputError for a number of jobs or an address that cannot be meant."""
    if options.jobs is not None:
        check_whole("--jobs", options.jobs, most=MOST_JOBS)
    if options.scheduler is not None and "://" not in options.scheduler:
        raise InputError(
            "--scheduler: expected an address such as tcp://10.0.0.5:8786, got "
            f"{options.scheduler!r}; the scheduler prints its own when it starts"
        )


def workers_of(
    options: argparse.Namespace, unit: str, total: int, done: int = 0
) -> AbstractContextManager[Workers]:
    """The workers that the options ask for; unit, total, done: as of `open_workers`. Says whether
    those of this machine are slow."""
    from dicedesign.runtime.workers import open_workers

    if options.scheduler is None:
        note_missing_kernels()
    return open_workers(unit, total, done, jobs=options.jobs, scheduler=options.scheduler)


def note_missing_kernels() -> None:
    """Say on stderr that a command takes long as there are no kernels, if so."""
    from dicedesign.kernels import ops as kernels

    if not kernels.available():
        with suppress(OSError):
            print(MISSING_KERNELS, file=sys.stderr)


def json_path(path: Path) -> Path:
    """The path that `--out` gives for a table of throw parameters. Raises InputError: it does not
    end in .json."""
    if path.suffix != ".json":
        raise InputError(f"--out: expected a path that ends in .json, got {path}; rename it")
    return path


def checkpoint_beside(out: Path | None, work: Mapping[str, str]) -> Checkpoint:
    """The checkpoint of work whose result will be written, with a note if there is one already;
    without a result to be written, one that keeps no file.

    work: as of `Checkpoint`. Raises InputError: the one there is of other work.
    """
    from dicedesign.runtime.checkpoint import Checkpoint

    if out is None:
        return Checkpoint()
    path = out.with_suffix(".checkpoint.npz")
    checkpoint = Checkpoint(path, {**work, "version of dicedesign": version("dicedesign")})
    if os.path.exists(path):
        print(f"note: goes on from {printable(path)}", file=sys.stderr)
    return checkpoint


def write_table(path: Path, entries: dict[str, Any]) -> None:
    """Write the file of a table of throw parameters, and say so."""
    atomic_write(path, json_text(entries).encode())
    print(f"note: wrote {printable(path)}", file=sys.stderr)


def direction(vector: Iterable[float]) -> str:
    """A unit vector for people."""
    # Adding zero takes the sign off a zero.
    return "  ".join(f"{x + 0.0:8.5f}" for x in vector)


def percent_interval(interval: Iterable[float]) -> str:
    """Limits of a probability, in percent."""
    return "  ".join(f"{100 * limit:7.3f}" for limit in interval)


def print_json(plain: object) -> None:
    """Print plain data, which have finite numbers only."""
    print(json_text(plain), end="")


WORDS = {2: "two", 3: "three", 6: "six"}


def numbers(option: str, text: str, form: str) -> list[float]:
    """The finite numbers of a text such as "x,y,z", which is its form. Raises InputError naming the
    option."""
    count = form.count(",") + 1
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(f"{option}: expected {WORDS[count]} numbers {form}, got {text!r}")
    return values


def vector(option: str, text: str) -> tuple[float, float, float]:
    """The three finite numbers of "x,y,z". Raises InputError naming the option."""
    x, y, z = numbers(option, text, "x,y,z")
    return x, y, z


def add_body_options(parser: argparse.ArgumentParser) -> None:
    """Add MESH, `--part` and `add_rest_options`."""
    parser.add_argument(
        "mesh",
        type=Path,
        metavar="MESH",
        help="STL, OBJ, PLY, OFF, GLB, XYZ, ..., or densities of cells, NPY or NPZ",
    )
    parser.add_argument(
        "--part",
        action="append",
        default=[],
        metavar="FILE:DENSITY",
        help="a closed mesh in the same frame, of another density in units of MESH's own; it takes "
        "the place of what it overlaps, and 0 is a cavity; more than one may be given, the last "
        "one counts where they overlap",
    )
    add_rest_options(parser)


def add_rest_options(parser: argparse.ArgumentParser) -> None:
    """Add `--com` and `--coplanar-tolerance`."""
    parser.add_argument(
        "--com",
        metavar="x,y,z|hull",
        help="center of mass in the mesh's unit, or that of the uniform solid hull (default: of "
        "the uniform solid; of its hull for point clouds and open meshes)",
    )
    parser.add_argument(
        "--coplanar-tolerance",
        type=float,
        metavar="T",
        help="merge hull triangles within this distance of one plane, relative to the body's half "
        "extent (default: 1e-11, for rounded coordinates such as STL 2e-6)",
    )


def center_of_mass(text: str | None) -> Center:
    """The center of mass that `--com` asks for."""
    if text is None:
        return None
    return "hull" if text == "hull" else vector("--com", text)


def read_poses(
    path: Path,
    center: Center | Floats = None,
    coplanar_tolerance: float | None = None,
    parts: Sequence[str] = (),
) -> tuple[Body, RestPoses]:
    """The body of a file and its rests; notes about them go to stderr.

    center, coplanar_tolerance: as in `rest_poses`; parts: what `--part` gives.
    """
    # Imported here, as other commands do without.
    from dicedesign.geometry.meshes.reading import read_body, without_solids
    from dicedesign.rest.poses import rest_poses

    with without_solids():
        body = read_body(path)
        others = [_part(text) for text in parts]
    if others:
        from dicedesign.geometry.meshes.manifold import weighted_body

        body = weighted_body([(body, 1.0), *others])
    poses = rest_poses(body, center, coplanar_tolerance=coplanar_tolerance)
    for note in poses.notes:
        print(f"note: {note}", file=sys.stderr)
    return body, poses


def _part(text: str) -> tuple[Body, float]:
    """The body and the density that a `--part` gives."""
    from dicedesign.geometry.meshes.reading import read_body

    path, _, density = text.rpartition(":")
    try:
        number = float(density)
    except ValueError:
        number = math.nan
    if not path or not 0.0 <= number < math.inf:
        raise InputError(
            f"--part: expected FILE:DENSITY with a density from 0 on, got {text!r}; write it such "
            "as ball.stl:7.8"
        )
    return read_body(Path(path)), number
