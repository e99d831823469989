"""The surface to make a die of, from whatever mesh came."""

from __future__ import annotations

from typing import Final

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.repair.repair import RepairedMesh, repaired
from dicedesign.geometry.surfaces.closed_surface import make_surface, one_shell
from dicedesign.geometry.surfaces.remeshing import decimated, thinned
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["FINEST", "MOST_POINTS", "input_surface"]

MOST_POINTS: Final = 20_000
"""Points that a surface is decimated to where nobody asked for more: what takes longer with each
shows no more of the shape."""

FINEST: Final = 60_000
"""The same where a surface is not bent as it is, but written, or decimated once more."""

FIRST: Final = 2
"""As many times the wanted points are left where it is not yet looked for triangles that meet."""


def input_surface(
    body: Body, points: int = MOST_POINTS, *, repair: bool = False
) -> tuple[Surface, tuple[str, ...], RepairedMesh | None]:
    """The closed surface of one solid, of no more than so many points.

    Larger meshes are decimated before anything is done that takes long.

    Parameters
    ----------
    body: a mesh of any size.
    points: most of them, at least 4.
    repair: whether to repair a mesh that is none of one solid (`repaired`).

    Returns
    -------
    The surface; what was done, one sentence each; and the repair, where one was made.

    Raises
    ------
    InputError, DegenerateBodyError: as `make_surface`, or, to be repaired, as `repaired`; the extra
        `concave` is not installed and the mesh is larger; no decimation gives a good surface.
    """
    made = None
    try:
        surface, notes = _taken(body, points)
    except InputError:
        if not repair:
            raise
        made = repaired(body)
        surface, notes = made.surface, made.notes
    else:
        if repair:
            notes += ("the mesh needed no repair",)
    if len(surface.points) > points:
        surface, note = decimated(surface, points)
        notes += (note,)
    return surface, notes, made


def _taken(body: Body, points: int) -> tuple[Surface, tuple[str, ...]]:
    """The surface of a body that needs no repair, thinned out where it is large."""
    most = FIRST * points
    if len(body.points) <= most:
        return make_surface(body)
    surface, notes = one_shell(body)
    fewer = Body(*thinned(surface.points, surface.triangles, 2 * most), body.name, False, ())
    try:
        thin, more = make_surface(fewer)
    except InputError:
        # That may be due to the thinning alone: the mesh itself is judged, which takes longer.
        return make_surface(body)
    return thin, (
        *notes,
        f"thinned out the surface from {len(surface.points)} to {len(thin.points)} points "
        "(fast-simplification)",
        *more,
    )
