"""Pages by jinja2, each one HTML file that needs nothing else: a die's report, with what it needs
to show a die that turns, linked with its facets and its Gauss map, and a search's best."""

from __future__ import annotations

import gzip
import hashlib
import zipfile
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import BODY_COLOR, Contents, Part, glb
from dicedesign.fabricate.printers import MATERIALS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.report.discs import MAP_SIZE, RADIUS, basin_outlines
from dicedesign.report.figures import FIGURES
from dicedesign.report.palette import BASINS
from dicedesign.report.raster import Camera, encode_png, tilt_up
from dicedesign.report.renderer import RenderMesh, render
from dicedesign.results.parts import Draft, Search, Status, TableResult
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.tables import Spread, Table, most_of, scale

MAP: Final = "gauss_map"
"""Name of the figure that is linked with the table of facets."""

MOST_ATTEMPTS: Final = 12
"""Attempts at a concave die that are listed."""

POLICY: Final = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; "
    "style-src 'unsafe-inline'"
)
"""A page loads nothing and runs no script but its own, whatever a name or a label in it says."""

FLAWS: Final = {
    Status.OFF_TARGET: "probabilities",
    Status.SELF_INTERSECTING: "meets itself",
    Status.TOO_NEAR: "outcomes near",
    Status.TIPPY: "margin",
}

MOST_TRIANGLES: Final = 60_000
"""A page of more would weigh megabytes more."""

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a triangle and a facet that are compared at a time, to bound the memory."""

TOUCHES: Final = 3e-3
"""Height above the table, over the largest extent, up to which a surface of any shape touches."""

FACES_DOWN: Final = 0.9
"""Cosine of the angle to straight down up to which it may slope there."""

ALONG: Final = 0.999
"""Cosine of the angle to a facet's normal up to which a label lies on the facet."""


@dataclass(frozen=True, eq=False)
class LiveDie:
    """A die for a page.

    Attributes
    ----------
    solid: GLB of the printed die, a node "facet-0" and so on for each rest, in the order of
        `Result.facets`; None where the page has no 3D view.
    left_out: why it has none, in a sentence; else empty.
    colors: "#rrggbb" of each rest.
    heights: (k,) of the center of mass over each rest, in mm.
    upward: for each rest the direction (3,) that is upward on its label, or None.
    center: (3,) center of mass, in mm.
    stands: whether a rest is shown by the die standing on it, as one is that keeps the shape of a
        surface; else its facet is turned to the viewer.
    outlines: of each disc of the Gauss map its middle in pixels, and the basin of each rest as a
        path of SVG, to a tenth of a pixel, see `basin_outlines`; none for a die without a map.
    """

    solid: bytes | None
    left_out: str
    colors: tuple[str, ...]
    heights: tuple[float, ...]
    upward: tuple[Floats | None, ...]
    center: Floats
    stands: bool
    outlines: tuple[tuple[Floats, list[str]], ...]


def live_die(die: FinishedDie, parts: Sequence[Part]) -> LiveDie:
    """A finished die for its page.

    parts: bodies of the printed die, the first being that of its STL.
    """
    solid, left_out = None, ""
    triangles = sum(len(part.triangles) for part in parts)
    if three_script() is None:
        left_out = "The die cannot be turned here: trimesh is installed without its viewer."
    elif triangles > MOST_TRIANGLES:
        left_out = f"The die cannot be turned here: it has {triangles:,} triangles."
    else:
        solid = glb(Contents(die.result.name, facet_parts(parts, die)))
    poses = die.plain.poses
    heights = poses.hull.heights(poses.center_of_mass)[poses.facets]
    upward: list[Floats | None] = [None for _ in heights]
    for label in () if die.engraved is None else die.engraved.placements[::-1]:
        for rest in np.flatnonzero(poses.normals @ label.frame[:3, 2] > ALONG):
            upward[rest] = label.frame[:3, 1]
    outlines = []
    for disc, basins in () if die.reshaped is not None else basin_outlines(poses):
        texts = [
            [" ".join(f"{x:.1f},{y:.1f}" for x, y in ring.tolist()) for ring in own]
            for own in basins
        ]
        outlines.append((disc.middle, ["".join(f"M{ring}Z" for ring in own) for own in texts]))
    return LiveDie(
        solid=solid,
        left_out=left_out,
        colors=tuple(rest_colors(die)),
        heights=tuple(heights.tolist()),
        upward=tuple(upward),
        center=poses.center_of_mass,
        stands=die.reshaped is not None,
        outlines=tuple(outlines),
    )


def rest_colors(die: FinishedDie) -> list[str]:
    """Color "#rrggbb" of each rest, as on the Gauss map; of its outcome for a concave die."""
    rests = range(len(die.plain.poses.facets))
    if die.reshaped is None:
        return [BASINS[rest % len(BASINS)] for rest in rests]
    outcomes = die.plain.outcomes.outcome_of_rest.tolist()
    return [BODY_COLOR if k < 0 else BASINS[k % len(BASINS)] for k in outcomes]


def facet_parts(parts: Sequence[Part], die: FinishedDie) -> list[Part]:
    """Triangles of parts, divided by rest: "facet-0" is the most probable, "body" has no rest,
    inlays are "labels-0" and so on.

    parts: of the printed die; the first is its body, others are inlays.
    """
    colors, facets = rest_colors(die), []
    for part in parts:
        is_body = part is parts[0]
        rests = rests_of_triangles(part.points, part.triangles, die)
        for rest in np.unique(rests).tolist():
            own = rests == rest
            color, labels = part.color, None if part.labels is None else part.labels[own]
            name = "body" if is_body else "labels"
            if rest >= 0:
                name = f"facet-{rest}" if is_body else f"labels-{rest}"
            if is_body:
                color = BODY_COLOR if rest < 0 else colors[rest]
            # The body of a facet that is all label would have no triangle.
            if labels is not None and labels.all():
                name, color, labels = name.replace("facet", "labels"), part.color, None
            triangles = part.triangles[own]
            facets.append(replace(part, name=name, color=color, triangles=triangles, labels=labels))
    return facets


def rests_of_triangles(points: Floats, triangles: Integers, die: FinishedDie) -> Integers:
    """(t,) the rest whose facet each triangle of a printed die belongs to, or -1.

    Labels, and edges that were rounded, belong to the facet whose plane is nearest. A die that
    keeps the shape of a surface has no facets; there it is what touches the table.
    """
    poses, middles = die.plain.poses, points[triangles].mean(axis=1)
    whole = die.plain.body.points if die.engraved is None else die.engraved.points
    normals = poses.hull.normals if die.reshaped is None else poses.normals
    support = np.array([(whole @ normal).max() for normal in normals])
    count = 1 + len(middles) * len(normals) // PAIRS_AT_ONCE
    parts = np.array_split(middles, count)
    nearest = np.concatenate([np.argmin(support - part @ normals.T, axis=1) for part in parts])
    if die.reshaped is None:
        of_facet = np.full(len(normals), -1, dtype=np.int64)
        of_facet[poses.facets] = np.arange(len(poses.facets))
        return of_facet[nearest]
    down, areas = normals[nearest], doubled_area_vectors(points, triangles)
    heights = support[nearest] - (middles * down).sum(axis=1)
    flat = (areas * down).sum(axis=1) >= FACES_DOWN * norms(areas)
    touches = flat & (heights <= TOUCHES * np.ptp(whole, axis=0).max())
    return np.where(touches, nearest, -1)


@lru_cache(maxsize=1)
def three_script() -> str | None:
    """The library that draws the 3D view of a page: three.js as trimesh brings it, without
    trimesh's own viewer; None where no trimesh with one is installed.

    It is under the MIT license, whose notice is its first line.
    """
    package = find_spec("trimesh")
    if package is None or package.origin is None:
        return None
    viewer = Path(package.origin).parent / "resources/templates/viewer.zip"
    try:
        with zipfile.ZipFile(viewer) as archive:
            page = archive.read("viewer.html.template").decode("utf-8")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    # Where trimesh's own viewer follows.
    script, ends, _ = page.partition("var camera,controls,scene,renderer,tracklight;")
    _, begins, script = script.partition("<script>")
    needed = ("THREE.GLTFLoader", "WebGLRenderer", "Raycaster")
    return script if begins and ends and all(name in script for name in needed) else None


def _is_moving(image: bytes) -> bool:
    return image.startswith(b"GIF8")


def _data_uri(image: bytes) -> str:
    kind = "gif" if _is_moving(image) else "png"
    return f"data:image/{kind};base64,{b64encode(image).decode('ascii')}"


@lru_cache(maxsize=1)
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("dicedesign.report"),
        extensions=["jinja2.ext.do"],
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {
        # With a count of significant digits; "-" where there is none.
        "number": lambda value, digits: "-" if value is None else f"{value:.{digits}g}",
        "percent": lambda value: "-" if value is None else f"{100.0 * value:.3f}",
        "vector": lambda values: " ".join(f"{value:.6g}" for value in values),
        "is_moving": _is_moving,
        "data_uri": _data_uri,
        # By a level of gzip above which next to nothing is gained.
        "packed": lambda data: b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii"),
        "recipe_lines": _recipe_lines,
        "most": most_of,
        "lengths": _lengths,
        "ends": _ends,
        "scaled": scale,
    }
    return environment


def _template_file(name: str) -> str:
    return files("dicedesign.report.templates").joinpath(name).read_text("utf-8")


def die_page(result: Result, images: Mapping[str, bytes], live: LiveDie | None = None) -> str:
    """The report of any kind of die as HTML.

    Parameters
    ----------
    result: of the run.
    images: PNG or GIF bytes of figures by name, see `FIGURES`; others are left out.
    live: the die for its 3D view; None for a page that does not move.

    Returns
    -------
    str, a whole document; the same for the same arguments.
    """
    hidden = {MAP} | {figure.instead_of for figure in FIGURES if figure.name in images}
    style, policy, script, data = _template_file("page.css"), POLICY, "", {}
    if live is not None:
        script, three = _template_file("viewer.js"), three_script()
        style += _template_file("viewer.css")
        scripts = [script]
        if live.solid is not None and three is not None:
            data = {"solid": live.solid, "three": three.encode()}
            scripts.append(three)
        sums = [b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
        policy += "; script-src " + " ".join(f"'sha256-{print_facts}'" for print_facts in sums)
    print_facts, search = result.printability, result.search
    simulated = None if result.thrown is None else result.thrown.simulated
    return (
        _environment()
        .get_template("die.html.j2")
        .render(
            title=result.name,
            policy=policy,
            style=style,
            script=script,
            data=data,
            result=result,
            live=live,
            images=images,
            figures=[one for one in FIGURES if one.name in images and one.name not in hidden],
            map=FIGURES[MAP],
            map_image=images.get(MAP),
            map_size=MAP_SIZE,
            map_radius=RADIUS,
            center=", ".join(f"{round(value, 3) + 0.0:.3f}" for value in result.center_of_mass),
            tabletop=None if result.thrown is None else Table(**result.thrown.table),
            engine=None if simulated is None else ENGINES[simulated.engine],
            advice=throwing_advice(result.thrown, result.prior),
            drafts=[] if search is None else _best_drafts(search),
            flaws=partial(_flaws, search),
            material=None if print_facts is None else MATERIALS[print_facts.material].title,
        )
    )


def _best_drafts(search: Search) -> list[Draft]:
    """The draft of the die itself first, then what lacks least, is nearest to the target and was
    moved least."""
    trade_off = search.trade_off

    def rank(draft: Draft) -> tuple[bool, int, float, float]:
        missed = max(draft.error - trade_off.tolerance, 0.0)
        lacks = len(list(trade_off.flaws(draft)))
        return draft.attempt != search.attempt, lacks, missed, draft.displacement

    return sorted(trade_off.drafts, key=rank)[:MOST_ATTEMPTS]


def _flaws(search: Search | None, draft: Draft) -> str:
    assert search is not None
    return ", ".join(FLAWS[status] for status in search.trade_off.flaws(draft)) or "nothing"


def leaderboard_page(
    table: Mapping[str, Any], shapes: Mapping[int, Mapping[str, Any]], picture: bytes
) -> str:
    """The best dice of a search as HTML.

    Parameters
    ----------
    table: as in leaderboard.json: "name", "size_mm", "trials", "converged" and "leaderboard", each
        entry with "rank", "number", "inradius_mm", "margin_deg", "max_abs_error", "asymmetry",
        "on_front", "as_given", "varied" and "recipe_file".
    shapes: by the number of each trial in it, "vertices" (n, 3) of the die in mm and "down" (3,).
    picture: PNG of `dicedesign.report.curve_charts.pareto_chart`.
    """
    numbers = [entry["number"] for entry in table["leaderboard"]]
    pictures = {
        number: lying_die_png(np.array(shape["vertices"]), np.array(shape["down"]))
        for number, shape in shapes.items()
        if number in numbers
    }
    return (
        _environment()
        .get_template("leaderboard.html.j2")
        .render(
            title=f"{table['name']}: search",
            policy=POLICY,
            style=_template_file("page.css"),
            table=table,
            pictures=pictures,
            pareto=picture,
        )
    )


def _recipe_lines(entry: Mapping[str, Any]) -> Iterator[str]:
    """Place of an entry's recipe and the varied values, without zero weights."""
    yield entry["recipe_file"]
    if entry["as_given"]:
        yield "as given"
    for key, value in entry["varied"].items():
        name = key.rpartition(".")[2]
        if isinstance(value, list):
            yield f"{name} {', '.join(value)}"
        elif not isinstance(value, float):
            yield f"{name} {value}"
        elif value > 0.0:
            yield f"{name} {value:.2g}"


def lying_die_png(vertices: Floats, down: Floats) -> bytes:
    """Picture of a die that lies on a table, somewhat from above.

    The frame is as wide as the largest distance between two vertices.

    vertices: (n, 3) in any length unit; down: (3,) the direction of gravity.
    """
    hull = convex_hull(vertices)
    flat = vertices - vertices.mean(axis=0)
    flat = flat - np.outer(flat @ down, down)
    along, across = np.linalg.svd(flat)[2][:2]
    turn = np.radians(25.0)
    direction = tilt_up(np.cos(turn) * across + np.sin(turn) * along, -down, 30.0)
    # In the middle of the picture, the die is nowhere wider than its frame.
    frame = Camera(direction, -down).frame()
    projected = vertices @ frame.T
    middle = (projected.min(axis=0) + projected.max(axis=0)) / 2.0 @ frame
    camera = Camera(direction, -down, middle, 0.53 * hull.diameter)
    return encode_png(render(RenderMesh(hull.vertices, hull.triangles, smooth=False), camera, 220))


def throwing_advice(thrown: TableResult | None, prior: str | None = None) -> str:
    """Instructions to throw a die by hand, for dice of a table or under a prior too."""
    if prior is not None:
        return (
            f"Let it go gently, turned as the prior {prior} says, whose directions point down in "
            "the coordinates of die.stl: the probabilities are those under it, without momentum. "
            "With any "
            "side down alike, or thrown, it has others."
        )
    if thrown is None:
        return (
            "Set it down gently, each time in another orientation: the probabilities are those of "
            "rolling "
            "without momentum. Thrown it has others; the command dicedesign throw shows by how "
            "much."
        )
    table = Table(**thrown.table)
    if most_of(table.height) == 0.0:
        return "Set it down on the table and let it tip over, from a random orientation."
    moving = max(most_of(table.speed), most_of(table.spin)) > 0.0
    push = " with a little push and spin," if moving else ""
    way = "" if table.hand is None else f" {table.hand.phrase}"
    about = "" if isinstance(table.height, tuple) else "about "
    return (
        f"Throw it{way}: let it fall from {about}{_lengths(table.height)} above the table,{push} "
        "each time from another orientation. Set down gently it has other probabilities."
    )


def _lengths(meters: Spread) -> str:
    in_cm = most_of(meters) < 1.0
    return f"{_ends(scale(meters, 100.0 if in_cm else 1.0), 3)} {'cm' if in_cm else 'm'}"


def _ends(spread: Spread, digits: int) -> str:
    ends = spread if isinstance(spread, tuple) else (spread,)
    return " to ".join(f"{end:.{digits}g}" for end in ends)
