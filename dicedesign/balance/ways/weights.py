"""The center of mass moved by balls of a heavier metal in pockets.

A pocket is round at its bottom, upright above and flat at its top: a print stops there, when the
pocket is as high as its ball, the ball is put in, and the print goes on over it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from manifold3d import CrossSection, Manifold, OpType

from dicedesign.balance.ways.material import Material
from dicedesign.balance.ways.way import Made, Way, stl_file
from dicedesign.concave.hollow.cavity import least_wall
from dicedesign.concave.result import is_shifted
from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.fabricate.solids.hollow import measured_cavities
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.manifold import mesh_of, solid
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.orientation import shells_of
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.sphere import even_directions, norms
from dicedesign.geometry.surfaces.distances import depth_grid, distances_from_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats

__all__ = ["WEIGHTS"]

PLAY: Final = 0.15
"""Of a ball in its pocket, in mm on each side."""

DIRECTIONS: Final = 40
"""In which the farthest center of mass is found."""

SAFE: Final = 0.9
"""Part of the reach that is relied on."""

MOST: Final = 16
"""Balls."""

SEGMENTS: Final = 48
"""Of a pocket's circle."""

STEPS: Final = 32
"""Of the grid of places for balls, along the longest extent."""

SETTLING: Final = 30
"""Times that places are moved until they have the mean that is wanted."""


@dataclass(frozen=True)
class _Pocket:
    """A pocket for a ball of a radius, centered at the ball; its shape as a solid."""

    ball: float

    @property
    def radius(self) -> float:
        """Of the pocket."""
        return self.ball + PLAY

    @property
    def circumscribed(self) -> float:
        """Radius of the ball about the same center that holds the pocket."""
        return float(np.sqrt(2.0) * self.radius)

    def spacing(self, wall: float) -> float:
        """Of pockets beside each other, or one above the other, with a wall between."""
        return 2.0 * self.radius + wall

    @cached_property
    def solid(self) -> Manifold:
        radius = self.radius
        turns = np.linspace(-0.5 * np.pi, 0.0, SEGMENTS // 4 + 1)
        arc = radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        corners = [(0.0, -radius), *arc[1:].tolist(), (radius, radius), (0.0, radius)]
        return CrossSection([corners]).revolve(SEGMENTS)

    def masses(self, material: Material) -> tuple[float, float, Floats]:
        """Of the ball, and of what the pocket takes away, in mg, and the place (3,) of the center
        of mass of the latter from that of the ball."""
        volume, middle = solid_properties(*mesh_of(self.solid))
        ball = 4.0 / 3.0 * np.pi * self.ball**3 * material.weight_density
        return ball, volume * material.density, middle


def weights_reach(surface: Surface, material: Material) -> ConvexHull:
    """See `Way`. The farthest centers of mass in some directions, with balls of one diameter as far
    that way as they find room."""
    depths, places = _places(surface, material)
    shifts = [np.zeros(3)]
    for diameter in material.weights_mm:
        pocket = _Pocket(0.5 * diameter)
        deep = places[depths >= material.wall_mm + pocket.circumscribed]
        spacing = pocket.spacing(material.wall_mm)
        for direction in even_directions(DIRECTIONS):
            chosen = _far(deep, direction, spacing)
            centers = _centers(surface, chosen, pocket, material)
            if len(centers):
                most = int(np.argmax((centers - surface.centroid) @ direction))
                shifts.append(centers[most] - surface.centroid)
    try:
        return convex_hull(SAFE * np.array(shifts))
    except DegenerateBodyError as error:
        raise InputError(
            f"weights_mm: expected room for balls of {min(material.weights_mm):g} mm within walls "
            f"of {material.wall_mm:g} mm, got a largest depth of {depths.max(initial=0.0):.3g} mm; "
            "take smaller weights_mm, a thinner wall_mm, or a larger size"
        ) from error


def _places(surface: Surface, material: Material) -> tuple[Floats, Floats]:
    """Depths (p,) and places (p, 3) of a grid that are deeper than walls."""
    grid = depth_grid(surface, STEPS)
    nodes = np.argwhere(grid.depths > material.wall_mm)
    return grid.depths[tuple(nodes.T)], grid.places(nodes)


def _far(places: Floats, direction: Floats, spacing: float) -> Floats:
    """Places (n, 3) of some (p, 3) with a spacing, each as far in a direction as can be."""
    left = places[np.argsort(-(places @ direction), kind="stable")]
    chosen: list[Floats] = []
    while len(left) and len(chosen) < MOST:
        chosen.append(left[0])
        left = left[_are_apart(left[0], left, spacing)]
    return np.reshape(chosen, (-1, 3))


def _centers(surface: Surface, places: Floats, pocket: _Pocket, material: Material) -> Floats:
    """(n, 3) centers of mass with the first, the first two, ... of balls at places (n, 3)."""
    ball, gone, middle = pocket.masses(material)
    own = surface.volume * material.density
    number = np.arange(1, len(places) + 1)[:, None]
    moments = np.cumsum((ball - gone) * places - gone * middle, axis=0)
    return (own * surface.centroid + moments) / (own + number * (ball - gone))


def with_weights(surface: Surface, center: Floats, material: Material) -> Made:
    """See `Way`. The fewest balls of one diameter that do, the lightest of these."""
    if not is_shifted(surface, center):
        data, body = stl_file(surface.points, surface.triangles)
        return Made({"": data}, body, surface.centroid, None, {}, ("nothing is to be moved",))
    depths, places = _places(surface, material)
    for count in range(1, MOST + 1):
        for diameter in sorted(material.weights_mm):
            pocket = _Pocket(0.5 * diameter)
            deep = places[depths >= material.wall_mm + pocket.circumscribed]
            mean = _mean_place(surface, center, pocket, count, material)
            found = _settled(deep, mean, pocket.spacing(material.wall_mm), count)
            if found is not None and _fits(surface, found, pocket, material.wall_mm):
                return _file(surface, found, pocket, material)
    away = float(norms(center - surface.centroid))
    raise InputError(
        f"weights_mm: expected balls that lead {away:.3g} mm away, got none of up to {MOST} alike "
        f"that have room in walls of {material.wall_mm:g} mm; take other weights_mm, or ask for "
        "less"
    )


def _mean_place(
    surface: Surface, center: Floats, pocket: _Pocket, count: int, material: Material
) -> Floats:
    """(3,) mean of the places of balls with which the center of mass is where it is wanted."""
    ball, gone, middle = pocket.masses(material)
    # Of all that is there, sums of masses times places about the wanted center vanish.
    own = surface.volume * material.density * (surface.centroid - center)
    return np.asarray(center + (count * gone * middle - own) / (count * (ball - gone)))


def _settled(places: Floats, mean: Floats, spacing: float, count: int) -> Floats | None:
    """Places (count, 3), near to some (p, 3), that have a mean and a spacing (`_are_apart`); None
    where none are found."""
    if count == 1:
        return mean[None]
    if len(places) < count:
        return None
    # Even if balls had no size their mean might be out of reach.
    toward = mean - places.mean(axis=0)
    if np.sort(places @ toward)[-count:].mean() < mean @ toward:
        return None
    places = places[np.argsort(norms(places - mean), kind="stable")]
    picked: list[Floats] = []
    for place in places:
        if not picked or _are_apart(place, np.array(picked), spacing).all():
            picked.append(place)
            if len(picked) == count:
                break
    if len(picked) < count:
        return None
    chosen = np.array(picked)
    for _ in range(SETTLING):
        missing = count * (mean - chosen.mean(axis=0))
        best, most = None, float(norms(missing))
        for number, place in enumerate(chosen):
            others = np.delete(chosen, number, axis=0)
            free = places[_are_apart(places[:, None], others[None], spacing).all(axis=1)]
            left = norms(place + missing - free)
            if len(free) and left.min() < 0.999 * most:
                best, most = (number, free[int(left.argmin())]), float(left.min())
        if best is None:
            break
        chosen[best[0]] = best[1]
    return np.asarray(chosen + mean - chosen.mean(axis=0))


def _are_apart(place: Floats, others: Floats, spacing: float) -> Booleans:
    """Whether pockets have a wall between them: beside each other, or one above the other."""
    away = others - place
    return np.asarray((norms(away[..., :2]) >= spacing) | (np.abs(away[..., 2]) >= spacing))


def _fits(surface: Surface, places: Floats, pocket: _Pocket, wall: float) -> bool:
    """Whether pockets have walls around them."""
    if distances_from_surface(surface, places).min() < pocket.radius + wall:
        return False
    each = [pocket.solid.translate(tuple(place)) for place in places]
    pockets = Manifold.batch_boolean(each, OpType.Add)
    body = solid(surface.points, surface.triangles)
    return (pockets - body).is_empty() and least_wall(surface, Surface(*mesh_of(pockets))) >= wall


def _file(surface: Surface, places: Floats, pocket: _Pocket, material: Material) -> Made:
    body = solid(surface.points, surface.triangles)
    pockets = [pocket.solid.translate(tuple(place)) for place in places]
    data, read = stl_file(*mesh_of(Manifold.batch_boolean([body, *pockets], OpType.Subtract)))
    balls, mass, center = _weighed(read, pocket, material)
    found = measured_cavities(read)
    ball = 4.0 / 3.0 * np.pi * pocket.ball**3 * material.weight_density / 1000.0
    base = float(read.points[:, 2].min())
    stops = sorted({round(float(place[2] - base) + pocket.radius, 2) for place in balls})
    facts: dict[str, Any] = {
        "weights": balls.tolist(),
        "diameter_mm": 2.0 * pocket.ball,
        "weight_g": ball,
        "mass_g": mass / 1000.0,
        "stops_mm": stops,
    }
    number = len(balls)
    notes = (
        f"{number} {'ball' if number == 1 else 'balls'} of {2.0 * pocket.ball:g} mm and "
        f"{ball:.3g} g, of {material.weight_density:g} g/cm3, in a body of "
        f"{material.density:g} g/cm3, printed solid",
        "print it as it lies in the file, stop at "
        f"{', '.join(f'{stop:.2f}' for stop in stops)} mm above the bed, and put them in",
    )
    return Made({"": data}, read, center, found.wall_mm, facts, notes)


def _weighed(body: Body, pocket: _Pocket, material: Material) -> tuple[Floats, float, Floats]:
    """Places (n, 3) of the balls, mass in mg and center of mass (3,), by the pockets in a file."""
    assert body.triangles is not None
    shell = shells_of(body.triangles)
    balls = []
    mass, moment = 0.0, np.zeros(3)
    for number in range(int(shell.max()) + 1):
        triangles = body.triangles[shell == number]
        volume, middle = solid_properties(body.points, triangles)
        mass += material.density * volume
        moment += material.density * volume * middle
        if volume < 0.0:
            corners = body.points[np.unique(triangles)]
            low, high = corners.min(axis=0), corners.max(axis=0)
            balls.append([*(0.5 * (low + high))[:2], low[2] + pocket.radius])
    ball = 4.0 / 3.0 * np.pi * pocket.ball**3 * material.weight_density
    places = np.array(balls)
    mass, moment = mass + len(balls) * ball, moment + ball * places.sum(axis=0)
    return places, mass, moment / mass


WEIGHTS: Final = Way(
    name="weights",
    line="balls of steel in pockets",
    reach=weights_reach,
    make=with_weights,
)
