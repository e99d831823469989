"""Arguments that several subcommands share, see `commands`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from dicedesign.errors import InputError, check_whole

MAX_JOBS = 4096
"""Limit of `--jobs`."""


@dataclass(kw_only=True)
class Command:
    """Arguments of a subcommand."""

    help_text: ClassVar[str] = ""
    """Summary, description, options and an example."""
    one_of: ClassVar[tuple[str, ...]] = ()
    """Mutually exclusive fields; one is required unless one of them has a default."""
    extensions: ClassVar[str] = ""
    """Registry "module:NAME" whose extensions the help lists."""


@dataclass(kw_only=True)
class WithJson(Command):
    help_text = """Options:
    json: print JSON instead of a table"""
    json: bool = False


@dataclass(kw_only=True)
class WithFiles(Command):
    help_text = """Options:
    overwrite: replace files that are there"""
    overwrite: bool = False


@dataclass(kw_only=True)
class WithWorkers(Command):
    help_text = """Options:
    jobs (J): parallel processes (default: one per core, or per thread of the cluster)
    scheduler (ADDRESS): run on the Dask cluster at tcp://HOST:PORT, or encrypted tls://HOST:PORT;
        needs the extra 'cluster'"""
    jobs: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        """Raise InputError for an impossible number of jobs or address."""
        if self.jobs is not None:
            check_whole("--jobs", self.jobs, most=MAX_JOBS)
        if self.scheduler is not None and "://" not in self.scheduler:
            raise InputError(
                "--scheduler: expected an address such as tcp://10.0.0.5:8786, got "
                f"{self.scheduler!r}; the scheduler prints its own when it starts"
            )


@dataclass(kw_only=True)
class WithItem(Command):
    help_text = """Options:
    item (N): of a 3MF file: the N-th body on its plate"""
    item: int | None = None


@dataclass(kw_only=True)
class WithRests(WithItem):
    help_text = """Options:
    com (x,y,z|hull): center of mass, or hull: that of the uniform convex hull (default: of the
        uniform solid; hull for point clouds and open meshes)
    coplanar_tolerance (T): merge hull triangles this near to a plane, over half the extent"""
    com: str | None = None
    coplanar_tolerance: float | None = None


@dataclass(kw_only=True)
class WithBody(WithRests, WithJson):
    help_text = """Options:
    mesh (MESH): STL, OBJ, PLY, OFF, GLB, XYZ, ...
    part (FILE:DENSITY): a closed mesh inside MESH, density relative to MESH, 0 for a cavity; may be
        repeated, the last counts
    largest_part: leave out all but the largest part and what is within it"""
    part: tuple[str, ...] = ()
    largest_part: bool = False


@dataclass(kw_only=True)
class WithResults(Command):
    help_text = """Options:
    out (DIR): folder for the results (default: outputs/NAME)
    files (FORMATS): file formats besides STL, such as 3mf,obj,glb
    printer (NAME): check printability for fdm (filament), sla (resin) or sls (powder), and write
        die_oriented.stl, oriented for the print bed
    no_figures: skip the figures and the report page
    no_clock: omit run times and memory: two runs give the same bytes
    resume: resume an interrupted concave die, or die for a table"""
    out: Path | None = None
    files: str | None = None
    printer: str | None = None
    no_figures: bool = False
    no_clock: bool = False
    resume: bool = False


@dataclass(kw_only=True)
class WithPage(Command):
    help_text = """Options:
    port (N): port of the page; 0 for any free one (default: 8080)
    no_browser: print the address and open no browser"""
    port: int = 8080
    no_browser: bool = False
