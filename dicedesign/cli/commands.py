"""What each subcommand takes: a dataclass whose fields are its arguments, those by keyword its
options, and whose docstring is its help, with the placeholder of each value in brackets."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import ClassVar, Final, Literal


@dataclass(kw_only=True)
class Command:
    """Options of a subcommand."""

    one_of: ClassVar[tuple[str, ...]] = ()
    """Fields of which one at most is given; exactly one, unless one of them has a default."""
    extensions: ClassVar[str] = ""
    """Address "module:NAME" of a registry whose extensions the help lists."""


@dataclass(kw_only=True)
class WithJson(Command):
    """Options:
    json: print JSON instead of a table
    """

    json: bool = False


@dataclass(kw_only=True)
class WithWorkers(Command):
    """Options:
    jobs (J): processes side by side (default: one for each core, or each thread of the cluster)
    scheduler (tcp://HOST:PORT): run on the Dask cluster of this address, tls://HOST:PORT if
        encrypted; needs the extra 'cluster' (default: on this machine)
    """

    jobs: int | None = None
    scheduler: str | None = None


@dataclass(kw_only=True)
class WithRests(Command):
    """Options:
    com (x,y,z|hull): center of mass in the mesh's unit, or that of the uniform solid hull (default:
        of the uniform solid; of its hull for point clouds and open meshes)
    coplanar_tolerance (T): merge hull triangles within this distance of one plane, relative to the
        body's half extent (default: 1e-11, for rounded coordinates such as STL 2e-6)
    """

    com: str | None = None
    coplanar_tolerance: float | None = None


@dataclass(kw_only=True)
class WithBody(WithRests, WithJson):
    """Options:
    mesh (MESH): STL, OBJ, PLY, OFF, GLB, XYZ, ..., or densities of cells, NPY or NPZ
    part (FILE:DENSITY): a closed mesh in the same frame, of another density in units of MESH's own;
        it takes the place of what it overlaps, and 0 is a cavity; more than one may be given, the
        last one counts where they overlap
    """

    part: tuple[str, ...] = ()


@dataclass(kw_only=True)
class WithResults(Command):
    """Options:
    out (DIR): folder for the results (default: outputs/NAME)
    files (FORMATS): formats of the die beside STL, such as 3mf,obj,glb
    data_sheet: add a page to print, as PDF and PNG
    printer (NAME): judge how the die prints by the limits of fdm (filament), sla (resin) or sls
        (powder), and write die_oriented.stl, which lies on the bed as is best
    no_figures: leave out the pictures and the page
    no_clock: leave out run times and memory, so that two runs can be compared byte by byte
    """

    out: Path | None = None
    files: str | None = None
    data_sheet: bool = False
    printer: str | None = None
    no_figures: bool = False
    no_clock: bool = False


@dataclass
class Run(WithResults):
    """Turn a recipe into a printable die.

    The die is engraved, and comes with a report.

    Options:
    recipe (RECIPE): YAML file
    set (key=value): change an entry of the recipe, such as size_mm=40 or target.fair=7
    resume: go on from the checkpoint of a concave die that an interrupted run left in the folder
    """

    recipe: Path
    _: KW_ONLY
    set: tuple[str, ...] = ()
    resume: bool = False


@dataclass(kw_only=True)
class Design(WithResults):
    """Turn probabilities into a printable die.

    The die is engraved, and comes with a report. The shape is found alone, or is that of a mesh,
    bent a little (--mesh); the recipe is written beside the die.

    Options:
    target (p,q,...): probabilities that sum to 1, fractions or decimals, such as 1/2,1/3,1/6; or
        what a recipe says, such as 'fair: 7' or 'sum_of_dice: [6, 6]'
    labels (a,b,...): a label for each of them (default: 1,2,...)
    mesh (FILE): bend this closed surface (OBJ, STL, ...) into a die, as little as can be
    repair: make the mesh the closed surface of one solid first, where it is none
    name (NAME): name of the die (default: die)
    seed (N): another seed gives another shape
    size_mm (X): largest distance between two corners (default: 30, or as much as the labels need,
        and 30 with --mesh)
    """

    target: str
    labels: str | None = None
    mesh: str | None = None
    repair: bool = False
    name: str = "die"
    seed: int = 0
    size_mm: float | None = None


@dataclass
class Search(WithWorkers):
    """Search for a die that prints and rolls better.

    Design many dice of one recipe, with other seeds, assignments of labels and weights of
    preferences, and rank them by the smallest circle in a labeled facet and the momentum margin.
    The same command goes on where an earlier one ended or was killed. Needs the extra 'search';
    --scheduler needs 'cluster'.

    Options:
    recipe (RECIPE): YAML file
    trials (N): how many dice are to be tried in all, those already in the folder included
    jobs (J): how many at a time (default: one for each core, or each thread of the cluster); 1
        makes the search repeatable
    out (DIR): folder for the results (default: outputs/NAME_search)
    """

    recipe: Path
    _: KW_ONLY
    trials: int
    out: Path | None = None


@dataclass
class Rest(WithBody, WithWorkers):
    """List the resting poses of a mesh with their probabilities.

    The mesh may be a point cloud. A folder in place of MESH stands for all meshes in it; their
    rests go to the table --out, and the same command goes on where an earlier one ended.

    Options:
    table (NAME|FILE.json): of a mesh: also the probabilities when it is thrown onto a table, by the
        momentum model: board-game, hard-wood, paper, carpet, or the file of a table; with another
        way to throw after a colon, as in board-game:cup
    prior (PRIOR): of a mesh: its probabilities where not all sides are equally likely to be down at
        first: vmf:x,y,z:CONCENTRATION, half:x,y,z, cap:x,y,z:ANGLE in degrees, or samples:FILE.csv;
        x,y,z point down, in the mesh's frame
    figure (FILE.png): draw the Morse-Smale complex
    heights (FILE.png): draw how high the center of mass is over the directions that may point down
    out (TABLE): of a folder: the table to write or go on, ending in .csv or .parquet, which needs
        the extra 'parquet'
    jobs (J): of a folder: processes side by side (default: one for each core, or each thread of the
        cluster, whose workers see the same files)
    """

    mesh: Path
    _: KW_ONLY
    table: str | None = None
    prior: str | None = None
    figure: Path | None = None
    heights: Path | None = None
    out: Path | None = None


@dataclass
class Drop(WithBody):
    """Follow a body that is let go at one orientation until it rests.

    Options:
    down (x,y,z): direction in the body's frame that points down at first
    max_angle_deg (A): split rotations larger than this
    figure (FILE.png): draw each change of the contact, and the path over the Gauss map
    """

    mesh: Path
    _: KW_ONLY
    down: str
    max_angle_deg: float | None = None
    figure: Path | None = None


@dataclass
class Pose(WithRests, WithJson, WithWorkers):
    """Stand meshes on a plane in the poses in which they come to rest.

    They stand in the most probable pose, or in another, on the plane z = 0 with the center of mass
    on the z axis, in their own unit of length. GLB files keep their materials, PLY files their
    colors; other formats hold the shape alone.

    Options:
    meshes (MESH): STL, OBJ, PLY, OFF, GLB, XYZ, ..., or a folder for all meshes in it
    out (PATH): of one mesh: the file to write, in the format of its ending (default: MESH_posed,
        here); of several or a folder: the folder for their files, which keep their names (default:
        posed)
    pose (N): the N-th most probable (default: 1)
    random: one drawn by the probabilities, turned about the vertical by any angle
    seed (S): of what --random draws (default: 0)
    format (NAME): of a folder's files: stl, obj, ply, off, glb, 3mf, ... (default: each mesh's)
    up: stand on z = 0, or on y = 0 as programs that show GLB files want (default: z)
    """

    meshes: tuple[Path, ...]
    _: KW_ONLY
    out: Path | None = None
    pose: int = 1
    random: bool = False
    seed: int = 0
    format: str | None = None
    up: Literal["z", "y"] = "z"
    one_of = ("pose", "random")


@dataclass
class Scatter(WithJson):
    """Fill a floor with meshes of a folder in poses drawn by their probabilities.

    Each is turned by any angle, such that what they cover on the floor, their convex hulls seen
    from above, does not overlap. The meshes take turns.

    Options:
    folder (FOLDER): of the meshes
    out (FILE): the scene: .glb, with the meshes' materials and y upward as the format wants
    count (N): bodies on the floor (default: 30)
    seed (S): of all chance (default: 0)
    floor (W,D): sides of the floor in the meshes' unit of length (default: as large as they need)
    size (L): scale each mesh until the longest side of its box is L (default: as they are)
    figure (FILE.png): draw a picture of it
    json: print every body's file, pose and transform as JSON
    """

    folder: Path
    _: KW_ONLY
    out: Path
    count: int = 30
    seed: int = 0
    floor: str | None = None
    size: float | None = None
    figure: Path | None = None


@dataclass
class Figure(WithRests):
    """Draw one of the paper's kinds of figures of a mesh, a finished die or a recipe.

    Options:
    kind (KIND): one of these
    subject (INPUT): a mesh file, a folder that `dicedesign run` left, or a recipe to design
    out (FILE.png): the picture (default: INPUT_KIND.png, here)
    down (x,y,z): of paths and drop: direction in the body's frame that points down at first
    before (MESH): of before_after: what the body was made from
    steps (N): of ablation: most of each descent
    """

    kind: str
    subject: Path
    _: KW_ONLY
    out: Path | None = None
    down: str | None = None
    before: Path | None = None
    steps: int | None = None
    extensions = "dicedesign.report.figures:BODY_FIGURES"


@dataclass
class Repair(Command):
    """Make a mesh the closed surface of one solid.

    One that is open, no manifold, of several bodies or meets itself becomes the closed surface of
    the largest solid that it encloses, for a concave die. One that is such a surface already is
    written as it is. Needs the extra 'repair'.

    Options:
    mesh (IN): STL, OBJ, PLY, OFF, GLB, ...
    out (OUT): the file to write, in the unit of IN, in the format of its ending; a picture of
        before and after is written beside it, ending in _repair.png
    """

    mesh: Path
    out: Path


@dataclass
class Balance(WithJson):
    """Move the center of mass of a mesh until it rests as is wanted.

    It is moved by a cavity, or by two densities of infill; the outside stays as it is. The files
    are read back and judged; the exit code is 0 where the goal is reached, else 1.

    Options:
    mesh (MESH): closed surface of one solid: STL, OBJ, ...
    equal (N): equal probabilities of the N most probable poses
    stand (K): the largest probabilities of pose K, numbered from 1 as `dicedesign rest` lists them
    stand_down (x,y,z): the same of the pose in which this direction of the mesh points down
    fewest: as few resting poses as can be
    target (p,q,...): these probabilities of the most probable poses, or of --poses
    poses (K,L,...): numbers of the poses that --target is for
    region (hull|hollow|x,y,z,x,y,z): where the center of mass may be: anywhere, where cavities can
        bring it, or in a box of a least and a largest corner in mm (default: hull)
    by (cavity|infill): how it gets there (default: by the first that does it)
    size_mm (X): largest distance between two points (default: coordinates are in mm)
    wall_mm (W): least thickness of walls (default: 1.2)
    drain_mm (D): drain the cavity by a hole of this diameter
    infill (p,q): two infills from 0 to 1 (default: 0.1,0.6)
    tolerance (T): largest difference of probabilities (default: 0.005)
    out (FILE.stl|FOLDER): where the body goes, with what belongs to it beside it
    """

    mesh: Path
    _: KW_ONLY
    out: Path
    equal: int | None = None
    stand: int | None = None
    stand_down: str | None = None
    fewest: bool = False
    target: str | None = None
    poses: str | None = None
    region: str | None = None
    by: str | None = None
    size_mm: float | None = None
    wall_mm: float | None = None
    drain_mm: float | None = None
    infill: str | None = None
    tolerance: float | None = None
    one_of = ("equal", "stand", "stand_down", "fewest", "target")


@dataclass
class Throw(WithJson, WithWorkers):
    """Throw a die onto a simulated table many times.

    How often each rest comes up is compared with its probability without momentum.

    Options:
    die (DIE): mesh, or folder that `dicedesign run` left
    drops (N): how many throws (default: 10000, of the paper's orientations one of each)
    engine (NAME): simulator, one of the list above (default: native)
    table (NAME|FILE.json): board-game, hard-wood, carpet (no momentum), paper (the paper's drops),
        or a file with the same entries as theirs (default: board-game)
    hand (NAME): throw in another way than the table says: cup, hand or tower
    orientations (KIND): at which the die is let go: uniform, at random; or icosahedron, the
        paper's, each counted by the area around it (default: uniform; on the table paper
        icosahedron)
    size (MM): of the die, twice the largest distance of a point from its center of mass (default:
        of a folder, the die's own; of a mesh, the table's, 25)
    com (x,y,z|hull): center of mass, as in `dicedesign rest` (default: of the uniform solid; of a
        folder, that of its design)
    inertia (xx,yy,zz,xy,xz,yz): tensor of inertia about the center of mass over the mass, in the
        mesh's unit squared (default: of the uniform solid)
    seed (S): of random numbers (default: 0)
    jobs (J): how many tasks at a time (default: one for each core); does not change the results
    """

    die: Path
    _: KW_ONLY
    drops: int | None = None
    engine: str = "native"
    table: str = "board-game"
    hand: str | None = None
    orientations: str | None = None
    size: float | None = None
    com: str | None = None
    inertia: str | None = None
    seed: int = 0
    extensions = "dicedesign.throws.engines:ENGINES"


@dataclass
class Rolls(WithJson):
    """Judge your own throws of a die.

    Compare counts of throws with the probabilities that a die should have: exact intervals, a test,
    the total variation, and how many more throws would settle it. With --log type what comes up,
    one label or several on a line; every line is saved as it ends. `undo` takes the last throw
    back, an empty line shows the table so far, and `done`, Ctrl-D or Ctrl-C ends.

    Options:
    die (DIE): folder that `dicedesign run` left, whose target is tested; or a mesh, whose labels
        are the numbers that `dicedesign rest` gives its rests
    counts (COUNTS.csv): columns label,count; or the column label alone, with one throw on each line
    log (ROLLS.csv): type in throws as they come, and write them here, one on each line; a file that
        exists is continued
    confidence (C): of intervals; the test's level is 1 - C (default: 0.95)
    figure (FILE.png): draw the frequencies beside the probabilities
    """

    die: Path
    counts: Path | None = None
    _: KW_ONLY
    log: Path | None = None
    confidence: float = 0.95
    figure: Path | None = None
    one_of = ("counts", "log")


@dataclass
class Table(WithJson, WithWorkers):
    """Fit a table's throw parameters to counts of real dice.

    Fit restitution, friction and the center of all hands (drop height, speed and spin) to what came
    up with several real dice, each thrown in a session with a hand of its own about that center.
    Each die is then predicted from the others, and tested with fresh drops. The table's file has 32
    equally likely tables beside the fitted one. With --out, the same command goes on where an
    earlier one was interrupted or killed. The exit code is 1 where no table explains the counts of
    a die.

    Options:
    action: the word fit
    throws (CSV): a line for each outcome: columns die, mesh (a file, or a folder that `dicedesign
        run` left, as seen from the CSV), outcome and throws; for mesh files also geometric, the
        outcome's probabilities without momentum; perhaps com (x y z) and size_mm (else 15 to 35)
    rolls (FOLDER ROLLS.csv): a die of a folder that `dicedesign run` left, and its throws, a file
        as of `dicedesign rolls`; with or without --throws, and for several dice
    dice (NAME,...): fit to these dice of the file (default: to all)
    check (NAME,...): predict these dice of the file, without fitting to them
    die (FOLDER): say what the fitted table does to this die, of a folder that `dicedesign run`
        left, and what more throws of it would tell
    evaluations (N): sets of parameters that are simulated (default: 256)
    drops (N): of each die for each set; a twelfth of all as many again test the fit (default: 2000)
    seed (S): default: 0
    jobs (J): how many simulations at a time (default: one for each core, or each thread of the
        cluster); the result does not depend on it
    out (TABLE.json): write the table, for --table elsewhere
    """

    action: Literal["fit"]
    _: KW_ONLY
    throws: Path | None = None
    rolls: tuple[tuple[Path, Path], ...] = ()
    dice: str | None = None
    check: str | None = None
    die: Path | None = None
    evaluations: int = 256
    drops: int = 2000
    seed: int = 0
    out: Path | None = None


@dataclass
class View(Command):
    """Look at a body or a die in the browser, drag it, design one.

    The page has the body, its hull, where it comes to rest and how often. Drag the center of mass,
    a corner or a facet, and all of it follows. Needs the extra 'view'. Ends with Ctrl-C.

    Options:
    path (MESH|RECIPE|FOLDER): a mesh; a recipe, which is designed; the folder of a finished die, or
        one of meshes (default: a page on which to design a die)
    host (ADDRESS): who can open the page: 127.0.0.1, this machine alone; 0.0.0.0, every machine
        that reaches it and knows the address, which then has a secret word (default: 127.0.0.1)
    port (N): port of the page, 0 for any that is free (default: 8080)
    no_browser: print the address and open no browser
    """

    path: Path | None = None
    _: KW_ONLY
    host: str = "127.0.0.1"
    port: int = 8080
    no_browser: bool = False


COMMANDS: Final[dict[str, tuple[type[Command], str]]] = {
    "run": (Run, "dice:run_recipe"),
    "design": (Design, "dice:design"),
    "search": (Search, "dice:search"),
    "rest": (Rest, "rest:list_rests"),
    "drop": (Drop, "rest:drop"),
    "pose": (Pose, "meshes:pose"),
    "scatter": (Scatter, "meshes:scatter"),
    "figure": (Figure, "meshes:draw_figure"),
    "repair": (Repair, "meshes:repair"),
    "balance": (Balance, "meshes:balance"),
    "throw": (Throw, "throws:throw"),
    "rolls": (Rolls, "throws:judge_rolls"),
    "table": (Table, "table_fit:fit"),
    "view": (View, "dice:view"),
}
"""What each takes, and in this folder the module and the function that does it."""
