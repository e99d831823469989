"""Arguments of each subcommand, as dataclasses: keyword-only fields are options.

`help_text` describes them, with the placeholder of each value in brackets. It is no docstring, as
`python -OO` removes those.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Literal

from dicedesign.cli.shared_options import (
    Command,
    WithBody,
    WithFiles,
    WithItem,
    WithJson,
    WithPage,
    WithRests,
    WithResults,
    WithWorkers,
)


@dataclass
class RunArguments(WithResults):
    help_text = """Make a printable die from a recipe.

    Writes the engraved die, result.json and a report.

    Options:
    recipe (RECIPE): YAML file
    set (key=value): change an entry, such as size_mm=40 or target.fair=7; may be repeated

    Example: dicedesign run recipes/fair_d7.yaml --out outputs/d7"""

    recipe: Path
    _: KW_ONLY
    set: tuple[str, ...] = ()


@dataclass
class DesignArguments(WithItem, WithResults):
    help_text = """Make a printable die from probabilities.

    Writes the engraved die, its recipe, result.json and a report.

    Options:
    text (TARGET): dice such as d7, 2d6+1, 4d6kh3, d% or 4dF; probabilities such as 50%,30%,1/5;
        weights such as 1:2:3; or a recipe's, such as 'binomial: 4'
    target (TEXT): same as TARGET
    labels (a,b,...): of the probabilities; equal ones are one outcome (default: 1,2,...)
    icons (a=SVG,...): pictures in place of labels, such as 6=skull.svg or 1=heart
    pips: dots in place of numbers
    font (NAME): installed font of the labels, or a .ttf or .otf file
    edges (X|chamfer): round them with a radius of X mm, or cut them flat
    mesh (FILE): bend this closed surface into a die, as little as possible
    repair: repair the mesh first if it is not a closed surface of one solid
    name (NAME): name of the die and, with dashes, its folder (default: die)
    seed (N): random seed; another gives another shape (default: 0)
    size_mm (X): largest diagonal, as 25 or 1.2in (default: 30, more if labels need it)
    faces (auto|one|N): number of faces: the best, one an outcome, or N (default: auto)
    for_ (PURPOSE): throwing, setting-down or both (default: both)
    table (NAME): table or its .json file (default: board-game)
    candidates (N): compare so many dice, in a table and a picture (default: 1)
    pick (K): make number K of them instead of the best

    Example: dicedesign design 1/2,1/3,1/6 --labels A,B,C"""

    text: str | None = None
    _: KW_ONLY
    target: str | None = None
    labels: str | None = None
    icons: str | None = None
    pips: bool = False
    font: str | None = None
    edges: str | None = None
    mesh: str | None = None
    repair: bool = False
    name: str = "die"
    seed: int = 0
    size_mm: str | None = None
    faces: str | None = None
    for_: str | None = None
    table: str | None = None
    candidates: int | None = None
    pick: int | None = None
    one_of = ("text", "target")


@dataclass
class SetArguments(Command):
    help_text = """Make a set of dice in one style.

    The dice have their usual bodies, one size and labels of one height. Writes a folder for each, a
    page of all, and plate.3mf with all dice on the print bed, each resting on a face.

    Options:
    dice (DIE): d4, d6, d8, d10, d12, d20, d% for 00 to 90, or other targets such as 2d6 or 4dF
    size (MM): distance between opposite faces, or without them the height at rest (default: 16;
        larger for dice whose labels need it)
    font (NAME): an installed font, or a .ttf or .otf file
    edges (MM|chamfer): round the edges with this radius, or cut them flat
    printer (NAME): fdm (filament), sla (resin) or sls (powder) (default: fdm)
    out (DIR): folder for the results (default: outputs/set)

    Example: dicedesign set d4 d6 d8 d10 d% d12 d20"""

    dice: tuple[str, ...]
    _: KW_ONLY
    size: float = 16.0
    font: str | None = None
    edges: str | None = None
    printer: str = "fdm"
    out: Path = Path("outputs/set")


@dataclass
class SweepArguments(WithWorkers):
    help_text = """Make a die for each combination of some values, and rank them.

    A page shows the dice, the best first: by the smallest circle in a labeled facet times the
    momentum margin. Repeat the command to make those that are missing.

    Options:
    recipe (RECIPE): YAML file
    set (KEY=VALUE,VALUE,...): values of a key, such as size_mm=20,30,40; may be repeated
    seeds (N): random seeds from 0 to N - 1
    out (DIR): folder for the dice, on a cluster seen by all (default: outputs/NAME_sweep)

    Example: dicedesign sweep recipes/binomial_5.yaml --seeds 20 --set size_mm=30,40"""

    recipe: Path
    _: KW_ONLY
    set: tuple[str, ...] = ()
    seeds: int | None = None
    out: Path | None = None


@dataclass
class RestArguments(WithBody, WithWorkers, WithFiles):
    help_text = """List the resting poses of meshes with their probabilities.

    Given a folder, writes a table of all meshes in it (--out); repeat the command to resume. A 3MF
    file has a result for each body on its plate.

    Options:
    meshes (MESH): mesh (STL, OBJ, ...), robot (URDF, MJCF) or folder of meshes
    density (D): in g/cm3, for the mass and inertia of bodies without a mass
    masses (FILE.csv): columns file and x,y,z (center of mass) or density
    all_facets: list unstable facets too, with the rest they roll to
    table (NAME|FILE.json): of a mesh: add probabilities for throws onto board-game, hard-wood,
        paper, carpet or a table file; a throw distribution follows a colon: board-game:cup
    prior (PRIOR): of a mesh: distribution of the direction down at release (default: uniform):
        vmf:x,y,z:CONCENTRATION, half:x,y,z, cap:x,y,z:DEGREES or samples:FILE.csv
    figure (FILE): draw the Morse-Smale complex, as .pdf, .svg or .png
    out (TABLE): table to write or resume, .csv, .json or .parquet (extra 'parquet')
    jobs (J): of a table: parallel processes (default: one per core)

    Example: dicedesign rest die.stl --table board-game"""

    meshes: tuple[Path, ...]
    _: KW_ONLY
    density: float | None = None
    masses: Path | None = None
    all_facets: bool = False
    table: str | None = None
    prior: str | None = None
    figure: Path | None = None
    out: Path | None = None


@dataclass
class DropArguments(WithBody):
    help_text = """Follow a body from its release until it rests.

    The body is released without momentum and rolls down quasi-statically.

    Options:
    down (x,y,z): direction in the body's frame that points down at release
    max_angle_deg (A): split rotations larger than this

    Example: dicedesign drop die.stl --down 0.3,0.2,-1"""

    mesh: Path
    _: KW_ONLY
    down: str
    max_angle_deg: float | None = None


@dataclass
class PoseArguments(WithRests, WithJson, WithWorkers, WithFiles):
    help_text = """Place meshes on a plane in their resting poses.

    A mesh stands on the plane z = 0 in its most probable pose or another one, with the center of
    mass on the z axis, in its own unit. GLB files keep materials, PLY files keep colors; other
    formats hold the shape alone.

    Options:
    meshes (MESH): STL, OBJ, PLY, OFF, GLB, XYZ, ..., or a folder of meshes
    out (PATH): for one mesh: output file, whose ending gives the format (default: MESH_posed in
        this folder); otherwise: output folder (default: posed)
    pose (N): the N-th most probable pose (default: 1)
    facet (N): stand on a facet of the hull, stable or not, numbered from 0 as in tables of rests
    random: draw the pose by its probability, and a random angle about the vertical
    seed (S): random seed of --random (default: 0)
    format (NAME): format of files in a folder: stl, obj, glb, ... (default: each mesh's own)
    up: vertical axis; y suits viewers of GLB files (default: z)

    Example: dicedesign pose bunny.obj --pose 2 --out bunny.glb"""

    meshes: tuple[Path, ...]
    _: KW_ONLY
    out: Path | None = None
    pose: int = 1
    facet: int | None = None
    random: bool = False
    seed: int = 0
    format: str | None = None
    up: Literal["z", "y"] = "z"
    one_of = ("pose", "facet", "random")


@dataclass
class ScatterArguments(WithJson, WithFiles):
    help_text = """Scatter the meshes of a folder on a floor in random resting poses.

    Poses are drawn by their probabilities, angles uniformly. Convex hulls seen from above do not
    overlap. The meshes take turns.

    Options:
    folder (FOLDER): folder of meshes
    out (FILE): scene to write: .glb, with the meshes' materials, y upward
    count (N): number of bodies (default: 30)
    seed (S): random seed (default: 0)
    floor (W,D): width and depth of the floor in the meshes' unit (default: as large as needed)
    size (L): scale each mesh to this length of its longest side (default: no scaling)
    figure (FILE): draw the scene, as .pdf, .svg or .png
    json: print file, pose and transform of each body as JSON

    Example: dicedesign scatter meshes --out scene.glb --count 50"""

    folder: Path
    _: KW_ONLY
    out: Path
    count: int = 30
    seed: int = 0
    floor: str | None = None
    size: float | None = None
    figure: Path | None = None


@dataclass
class FigureArguments(WithRests, WithFiles):
    help_text = """Draw a figure of a mesh, a finished die or a recipe.

    Options:
    kind (KIND): one of the kinds above
    subject (INPUT): a mesh file, a folder written by `dicedesign run`, or a recipe to design
    out (FILE): .pdf, .svg or .png; for history also .csv (default: INPUT_KIND.png in this folder)
    width (W): width in inches (default: 3.3, one column of a paper)
    down (x,y,z): for paths and drop: direction in the body's frame that points down at release
    before (MESH): for before_after: the mesh from which the body was made

    Example: dicedesign figure complex bunny.obj --out complex.pdf"""

    kind: str
    subject: Path
    _: KW_ONLY
    out: Path | None = None
    width: float | None = None
    down: str | None = None
    before: Path | None = None
    extensions = "dicedesign.report.body_figures:BODY_FIGURES"


@dataclass
class RepairArguments(WithItem, WithFiles):
    help_text = """Repair a mesh into the closed surface of one solid.

    A mesh that is open, non-manifold, in several pieces or self-intersecting becomes the surface of
    the largest solid that it encloses. A sound mesh is written unchanged.

    Options:
    mesh (IN): STL, OBJ, PLY, OFF, GLB, ...
    file (OUT): same as --out
    out (OUT): file, in the unit of IN, or folder to write (default: IN_repaired in this folder);
        the ending gives the format, stl, 3mf, obj or glb; a figure of before and after is written
        as *_repair.png

    Example: dicedesign repair scan.obj --out scan_repaired.stl"""

    mesh: Path
    file: Path | None = None
    _: KW_ONLY
    out: Path | None = None


@dataclass
class BalanceArguments(WithItem, WithJson, WithFiles):
    help_text = """Move the center of mass of a mesh until it rests as you want.

    Adds a cavity, or infill of two densities. Give one goal: --equal, --stand, --stand-down,
    --fewest or --target. The files are checked; the exit code is 1 if the goal is not reached.

    Options:
    mesh (MESH): closed surface of one solid: STL, OBJ, ...
    equal (N): make the N most probable poses equally probable
    stand (K): maximize the probability of pose K, numbered as by `dicedesign rest`
    stand_down (x,y,z): maximize the probability of the pose with this direction down
    fewest: minimize the number of resting poses
    target (p,q,...): give the most probable poses, or --poses, these probabilities
    poses (K,L,...): pose numbers for --target
    by (cavity|infill): how to move it (default: the first that works)
    size_mm (X): scale to this largest distance between two points (default: coordinates are mm)
    wall_mm (W): minimum wall thickness (default: 1.2)
    drain_mm (D): add a drain hole of this diameter to the cavity
    infill (p,q): two infill densities from 0 to 1 (default: 0.1,0.6)
    tolerance (T): largest error of a probability (default: 0.005)
    out (FILE.stl|FOLDER): file to write, with further files next to it, or a folder for all

    Example: dicedesign balance bunny.obj --stand 1 --size-mm 80 --out bunny_balanced.stl"""

    mesh: Path
    _: KW_ONLY
    out: Path
    equal: int | None = None
    stand: int | None = None
    stand_down: str | None = None
    fewest: bool = False
    target: str | None = None
    poses: str | None = None
    by: str | None = None
    size_mm: float | None = None
    wall_mm: float | None = None
    drain_mm: float | None = None
    infill: str | None = None
    tolerance: float | None = None
    one_of = ("equal", "stand", "stand_down", "fewest", "target")


@dataclass
class ThrowArguments(WithItem, WithJson, WithWorkers):
    help_text = """Simulate throws of a die onto a table.

    Compares the frequency of each rest with its probability without momentum.

    Options:
    die (DIE): mesh, or folder written by `dicedesign run`
    drops (N): number of throws (default: 10000)
    engine (NAME): simulator from the list above (default: native)
    table (NAME|FILE.json): board-game, hard-wood, carpet (no momentum), paper (as in the paper) or
        a table file (default: board-game)
    hand (NAME): throw distribution: cup, hand or tower (default: the table's own)
    size (MM): diameter of the die, twice its largest radius about the center of mass (default: the
        die's own size; 25 for a mesh)
    com (x,y,z|hull): center of mass, as in rest (default: the design's, or the uniform solid)
    seed (S): random seed (default: 0)
    jobs (J): parallel tasks (default: one per core); does not change the results

    Example: dicedesign throw outputs/d7 --drops 20000"""

    die: Path
    _: KW_ONLY
    drops: int = 10_000
    engine: str = "native"
    table: str = "board-game"
    hand: str | None = None
    size: float | None = None
    com: str | None = None
    seed: int = 0
    extensions = "dicedesign.throws.engines:ENGINES"


@dataclass
class RollsArguments(WithItem, WithJson, WithPage, WithFiles):
    help_text = """Test your own throws of a die.

    Compares counts with the die's probabilities: exact intervals, a test, the total variation, and
    how many more throws would settle it. With --log, type what comes up; each line is saved at
    once. `undo` removes the last throw, an empty line prints the table, `done` or Ctrl-D ends.
    With --page, tap it on a page instead; Ctrl-C ends it and prints the verdict.

    Options:
    die (DIE): folder written by `dicedesign run`, tested for its target; or a mesh, whose labels
        are the numbers of its rests in `dicedesign rest`
    counts (COUNTS.csv): columns label,count; or one column label with a throw on each line
    log (ROLLS.csv): file for typed or tapped throws; an existing one is continued
    confidence (C): level of the intervals; the test's level is 1 - C (default: 0.95)
    figure (FILE): draw frequencies next to probabilities, as .pdf, .svg or .png
    page: tap what comes up on a page in the browser; needs the extra 'view'
    phone: open the page to devices in the local network, at a secret address

    Example: dicedesign rolls outputs/d7 counts.csv"""

    die: Path
    counts: Path | None = None
    _: KW_ONLY
    log: Path | None = None
    confidence: float = 0.95
    figure: Path | None = None
    page: bool = False
    phone: bool = False
    one_of = ("counts", "log")


@dataclass
class ViewArguments(WithPage):
    help_text = """View and edit a body or a die in the browser.

    Shows the body, its hull and its resting poses with their probabilities. Drag the center of
    mass, a corner or a facet, and everything follows. Needs the extra 'view'. Ctrl-C ends it.

    Options:
    path (MESH|RECIPE|FOLDER): a mesh, a recipe to design, or a folder of a finished die or of
        meshes (default: a page on which to design a die)

    Example: dicedesign view bunny.obj"""

    path: Path | None = None
