"""Pages, each one HTML file that needs nothing else: the report of a die, whose 3D view, table of
facets and Gauss map are linked, the dice of a sweep, and a set of dice."""

from __future__ import annotations

import gzip
import hashlib
import zipfile
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import BODY_COLOR, LABEL_COLOR, Contents, Part, glb
from dicedesign.fabricate.printers import MATERIALS
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, join_surfaces
from dicedesign.palette import BASINS, rgb
from dicedesign.report.discs import MAP_SIZE, RADIUS, basin_outlines
from dicedesign.report.figures import FIGURES, MAX_FLAT_TRIANGLES
from dicedesign.report.raster import (
    UP,
    Camera,
    encode_png,
    frame_cameras,
    three_cameras,
    trim,
)
from dicedesign.report.renderer import RenderMesh, color_triangles, render, render_on_table
from dicedesign.results.parts import Draft, Search, Status, TableResult
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.tables import Spread, Table, most_of, scale

MAP = "gauss_map"
"""Name of the figure that is linked with the 3D view and the table of facets."""

MAX_ATTEMPTS = 12
"""Most attempts at a concave die that are listed."""

POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; "
    "style-src 'unsafe-inline'"
)
"""Content security policy: a page loads nothing and runs no other scripts, whatever its text."""

FLAWS = {
    Status.OFF_TARGET: "probabilities",
    Status.SELF_INTERSECTING: "intersects itself",
    Status.TOO_NEAR: "outcomes near",
    Status.TIPPY: "margin",
    Status.FRAGILE: "prints",
}

MAX_TRIANGLES = 60_000
"""Most triangles of a solid in a page; more would add megabytes."""

PAIRS_AT_ONCE = 2_000_000
"""Number of pairs of a triangle and a facet that are compared at a time, to limit memory."""

TOUCHING_HEIGHT = 3e-3
"""Height above the table up to which a concave die touches it, over its largest extent."""

TOUCHING_COSINE = 0.9
"""Cosine of the largest slope of the surface where it touches the table."""

PLATE_PIXELS = 1200
"""Side of the picture of a print bed before it is trimmed."""

LABEL_COSINE = 0.999
"""Cosine of the largest angle between the normals of a label and of its facet."""


def rest_colors(die: FinishedDie) -> list[str]:
    """Colors "#rrggbb" of rests: as on the Gauss map, or by outcome for a concave die."""
    rests = range(len(die.plain.poses.facets))
    if die.reshaped is None:
        return [BASINS[rest % len(BASINS)] for rest in rests]
    outcomes = die.plain.outcomes.outcome_of_rest.tolist()
    return [BODY_COLOR if k < 0 else BASINS[k % len(BASINS)] for k in outcomes]


def facet_parts(parts: Sequence[Part], die: FinishedDie) -> list[Part]:
    """Parts of a printed die, divided by rest.

    Names are "facet-0" for the most probable rest and so on, "body" for triangles without a rest,
    and "labels-0" and so on for inlays.

    parts: the first is the body, others are inlays.
    """
    colors, facets = rest_colors(die), []
    for part in parts:
        is_body = part is parts[0]
        rests = rests_of_triangles(part, die)
        for rest in np.unique(rests).tolist():
            own = rests == rest
            color, labels = part.color, None if part.labels is None else part.labels[own]
            name = "body" if is_body else "labels"
            if rest >= 0:
                name = f"facet-{rest}" if is_body else f"labels-{rest}"
            if is_body:
                color = BODY_COLOR if rest < 0 else colors[rest]
            # A facet that is all label would leave the body without triangles.
            if labels is not None and labels.all():
                name, color, labels = name.replace("facet", "labels"), part.color, None
            triangles = part.triangles[own]
            facets.append(replace(part, name=name, color=color, triangles=triangles, labels=labels))
    return facets


def _in_order(result: Result) -> list[int]:
    """Numbers of the facets in the order of the labels, those of none last."""
    labels = [*result.labels, None]
    return sorted(range(len(result.facets)), key=lambda k: labels.index(result.facets[k].outcome))


def rests_of_triangles(part: Surface, die: FinishedDie) -> Integers:
    """Rest (t,) of each triangle of a printed die, or -1.

    On a convex die it is the one of the nearest facet, also for labels and rounded edges. On a
    concave die it is the rest in which the triangle touches the table.
    """
    poses, middles = die.plain.poses, part.points[part.triangles].mean(axis=1)
    whole = die.printed.points
    normals = poses.hull.normals if die.reshaped is None else poses.normals
    support = np.array([(whole @ normal).max() for normal in normals])
    count = 1 + len(middles) * len(normals) // PAIRS_AT_ONCE
    parts = np.array_split(middles, count)
    nearest = np.concatenate([np.argmin(support - each @ normals.T, axis=1) for each in parts])
    if die.reshaped is None:
        of_facet = np.full(len(normals), -1, dtype=np.int64)
        of_facet[poses.facets] = np.arange(len(poses.facets))
        return of_facet[nearest]
    down, areas = normals[nearest], doubled_area_vectors(part.points, part.triangles)
    heights = support[nearest] - (middles * down).sum(axis=1)
    flat = (areas * down).sum(axis=1) >= TOUCHING_COSINE * norms(areas)
    touches = flat & (heights <= TOUCHING_HEIGHT * np.ptp(whole, axis=0).max())
    return np.where(touches, nearest, -1)


@lru_cache(maxsize=1)
def three_script() -> str | None:
    """Source of three.js, as part of the installed trimesh; None if it is not there.

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
    # The viewer of trimesh follows three.js.
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
        # Number with significant digits; "-" for None.
        "number": lambda value, digits: "-" if value is None else f"{value:.{digits}g}",
        "percent": lambda value: "-" if value is None else f"{100.0 * value:.3f}",
        "vector": lambda values: " ".join(f"{value:.6g}" for value in values),
        "is_moving": _is_moving,
        "data_uri": _data_uri,
        # A higher level of compression gains next to nothing.
        "packed": lambda data: b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii"),
        "most": most_of,
        "lengths": _lengths,
        "ends": _ends,
        "scaled": scale,
        "svg_path": _svg_path,
    }
    return environment


def _svg_path(rings: Sequence[Floats]) -> str:
    """Path of closed polygons (m, 2) in SVG, in whole pixels."""
    texts = (" ".join(f"{x:.0f},{y:.0f}" for x, y in ring.tolist()) for ring in rings)
    return "".join(f"M{text}Z" for text in texts)


def _template_file(name: str) -> str:
    return files("dicedesign.report.templates").joinpath(name).read_text("utf-8")


def die_page(die: FinishedDie, images: Mapping[str, bytes], parts: Sequence[Part]) -> str:
    """HTML of the report of a die.

    Deterministic. Without a 3D view, the page says why.

    Parameters
    ----------
    die: the finished die.
    images: PNG or GIF bytes of figures by name, see `FIGURES`; others are left out.
    parts: solids of the printed die, first the one of the STL file.
    """
    result, poses, style = die.result, die.plain.poses, _template_file("page.css")
    script, three = _template_file("viewer.js"), three_script()
    triangles = sum(len(part.triangles) for part in parts)
    scripts, data, left_out = [script], dict[str, bytes](), ""
    if three is None:
        left_out = "The die cannot be turned here: trimesh is installed without its viewer."
    elif triangles > MAX_TRIANGLES:
        left_out = f"The die cannot be turned here: it has {triangles:,} triangles."
    else:
        solid = glb(Contents(result.name, facet_parts(parts, die)))
        scripts, data = [script, three], {"solid": solid, "three": three.encode()}
    sums = [b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    policy = " ".join([f"{POLICY}; script-src", *(f"'sha256-{each}'" for each in sums)])
    upward: list[Floats | None] = [None] * len(poses.facets)
    for label in () if die.engraved is None else die.engraved.placements[::-1]:
        for rest in np.flatnonzero(poses.normals @ label.frame[:3, 2] > LABEL_COSINE):
            upward[rest] = label.frame[:3, 1]
    hidden = {MAP} | {figure.instead_of for figure in FIGURES if figure.name in images}
    print_facts, search = result.printability, result.search
    simulated = None if result.thrown is None else result.thrown.simulated
    return (
        _environment()
        .get_template("die.html.j2")
        .render(
            title=result.name,
            policy=policy,
            style=style + _template_file("viewer.css") + _template_file("print.css"),
            script=script,
            data=data,
            left_out=left_out,
            result=result,
            colors=rest_colors(die),
            in_order=_in_order(result),
            heights=poses.hull.heights(poses.center_of_mass)[poses.facets],
            upward=upward,
            mass_center=poses.center_of_mass,
            outlines=basin_outlines(poses) if MAP in images else [],
            images=images,
            figures=[one for one in FIGURES if one.name in images and one.name not in hidden],
            map=FIGURES[MAP],
            map_image=images.get(MAP),
            map_size=MAP_SIZE,
            map_radius=RADIUS,
            center=", ".join(f"{round(value, 3) + 0.0:.3f}" for value in result.center_of_mass),
            tabletop=None if result.thrown is None else Table(**result.thrown.table),
            engine=None if simulated is None else ENGINES[simulated.engine],
            advice=throwing_advice(
                result.thrown,
                result.prior,
                can_be_thrown=result.forecast is not None and not result.is_warned,
            ),
            drafts=[] if search is None else _best_drafts(search),
            flaws=partial(_flaws, search),
            material=None if print_facts is None else MATERIALS[print_facts.material].title,
        )
    )


def _best_drafts(search: Search) -> list[Draft]:
    """Drafts in order: the one of the die, then by number of flaws, error and displacement."""
    trade_off = search.trade_off

    def rank(draft: Draft) -> tuple[bool, int, float, float]:
        missed = max(draft.error - trade_off.tolerance, 0.0)
        lacks = len(list(trade_off.flaws(draft)))
        return draft.attempt != search.attempt, lacks, missed, draft.displacement

    return sorted(trade_off.drafts, key=rank)[:MAX_ATTEMPTS]


def _flaws(search: Search | None, draft: Draft) -> str:
    assert search is not None
    return ", ".join(FLAWS[status] for status in search.trade_off.flaws(draft)) or "nothing"


def sweep_page(
    name: str,
    rows: Sequence[Mapping[str, Any]],
    keys: Sequence[str],
    solids: Mapping[str, tuple[Surface, Floats]],
) -> str:
    """HTML of the dice of a sweep, side by side.

    Parameters
    ----------
    name: of the recipe. rows: of sweep.csv. keys: columns of the varied keys.
    solids: surface in mm and direction upward (3,) of each die that was made, by its folder.
    """
    pictures = {}
    for folder, (solid, up) in solids.items():
        is_smooth = len(solid.triangles) > MAX_FLAT_TRIANGLES
        mesh = RenderMesh(solid.points, solid.triangles, smooth=is_smooth)
        pictures[folder] = _small_picture(mesh, up)
    return _table_page(
        "sweep",
        title=f"{name}: sweep",
        rows=rows,
        keys=keys,
        pictures=pictures,
    )


def set_page(plate: Contents, dice: Sequence[Mapping[str, Any]]) -> str:
    """HTML of a set of dice.

    Parameters
    ----------
    plate: the dice on the print bed, z upward. dice: entries of set.json, in the same order.
    """
    whole = _paint(plate.parts)
    (camera,) = frame_cameras([Camera(np.array([0.0, -0.4, 1.0]), UP)], [whole.points])
    (picture,) = trim([render_on_table(whole, UP, camera, PLATE_PIXELS)])
    return _table_page(
        "set",
        title=plate.title,
        dice=dice,
        plate=encode_png(picture),
        pictures=[_small_picture(_paint([part]), UP) for part in plate.parts],
    )


def _paint(parts: Sequence[Part]) -> RenderMesh:
    """Solids with their labels in color."""
    labels = [np.zeros(len(p.triangles), bool) if p.labels is None else p.labels for p in parts]
    body, label = rgb([BODY_COLOR, LABEL_COLOR])
    whole = join_surfaces(*parts)
    colors = np.where(np.concatenate(labels)[:, None], label, body)
    return color_triangles(whole.points, whole.triangles, colors)


def _small_picture(surface: RenderMesh, up: Floats) -> bytes:
    """PNG of a solid at rest, from about 30 degrees above."""
    direction = three_cameras(surface.points, up)[0].direction + 0.3 * up
    (camera,) = frame_cameras([Camera(direction, up)], [surface.points])
    return encode_png(render(surface, camera, 220))


def throwing_advice(
    thrown: TableResult | None, prior: str | None = None, *, can_be_thrown: bool = False
) -> str:
    """Instructions to throw a die by hand, depending on its table or its prior.

    can_be_thrown: whether a die for setting down has its probabilities when thrown too.
    """
    if prior is not None:
        return (
            f"Let it go gently, in orientations drawn from the prior {prior}, whose directions "
            "point down in the coordinates of die.stl: the probabilities hold for these, without "
            "momentum. From uniform orientations, or thrown, the die has other probabilities."
        )
    if thrown is None and can_be_thrown:
        return (
            "Throw it, or set it down gently in any orientation: the probabilities hold for both."
        )
    if thrown is None:
        return (
            "Set it down gently, each time in another orientation: the probabilities hold for "
            "rolling without momentum. A thrown die has other probabilities."
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


def _table_page(name: str, **content: Any) -> str:
    """HTML of a page without scripts, by its template."""
    template = _environment().get_template(f"{name}.html.j2")
    return template.render(policy=POLICY, style=_template_file("page.css"), **content)
