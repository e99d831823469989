"""What is known of a body as HTML: its numbers, and rows of bars of its odds."""

from __future__ import annotations

import html
from typing import Final

import numpy as np

from dicedesign.report.charts.palette import BASINS
from dicedesign.runtime.arrays import Floats
from dicedesign.view.bodies.viewed_body import ViewedBody

__all__ = ["MOST_ROWS", "body_html", "odds_html"]

MOST_ROWS: Final = 24
"""Bars of a body with more rests are those of the first."""


def body_html(viewed: ViewedBody, update: int) -> str:
    """Name, counts and center of mass of a body; update: how many changes were shown so far."""
    hull, margin = viewed.hull, float(np.degrees(viewed.poses.margins.min()))
    mesh = viewed.solid.body.triangles
    made = "the hull that was dragged"
    if not viewed.dragged:
        made = "points" if mesh is None else f"a mesh of {len(mesh):,} triangles"
    digits = 6 - int(np.floor(np.log10(float(np.ptp(hull.vertices, axis=0).max()))))
    # Adding zero takes the sign off a zero.
    center = ", ".join(f"{round(float(x), digits) + 0.0:.10g}" for x in viewed.center)
    rests = len(viewed.poses.facets)
    leaves = f", and leaves the easiest when tipped by {margin:.3g}°" if rests > 1 else ""
    wanted = [row for row in viewed.rows if row.wanted is not None]
    off = max((abs(row.odds - (row.wanted or 0.0)) for row in wanted), default=None)
    met = "" if off is None else f"<p>Off the wanted odds by at most {100.0 * off:.3g} %.</p>"
    notes = "".join(f'<p class="note">Note: {html.escape(n)}.</p>' for n in viewed.poses.notes)
    return (
        f'<div class="dd" id="body" data-update="{update}"><h3>{html.escape(viewed.name)}</h3>'
        f'<p class="note">{made}; its hull has {len(hull.vertices):,} corners and '
        f"{len(hull.normals):,} facets.</p>"
        f"{notes}<p>It rests on {rests} of them{leaves}.</p>{met}"
        f'<p>Center of mass: <span id="center">{center}</span></p></div>'
    )


def odds_html(viewed: ViewedBody, thrown: Floats | None) -> str:
    """A table of the rows of a body: label, bar, odds in percent.

    thrown: (rows,) odds on a table, or None.
    """
    rows = viewed.rows
    shown, wanted = rows[:MOST_ROWS], any(row.wanted is not None for row in rows)
    most = [row.odds for row in shown] + [row.wanted or 0.0 for row in shown]
    if thrown is not None:
        most += thrown[:MOST_ROWS].tolist()
    longest = max(1e-9, *most)
    head = ["shows" if viewed.outcomes is not None else "rest", ""]
    head += ["wanted %"] * wanted + ["set down %"] + ["thrown %"] * (thrown is not None)
    lines = []
    for place, row in enumerate(shown):
        numbers = ["" if row.wanted is None else _percent(row.wanted)] * wanted
        numbers.append(_percent(row.odds))
        bar = _bar(row.odds / longest, BASINS[row.color % len(BASINS)], row.wanted, longest)
        if thrown is not None:
            part = float(thrown[place])
            numbers.append(_percent(part))
            bar += f'<div class="thrown" style="width:{100.0 * part / longest:.2f}%"></div>'
        cells = "".join(f"<td>{number}</td>" for number in numbers)
        lines.append(
            f'<tr tabindex="0" role="button" data-action="stand:{place}" title="Stand it like '
            f'this"><td>{html.escape(row.label)}</td><td class="bar">{bar}</td>{cells}</tr>'
        )
    titles = "".join(f"<th>{title}</th>" for title in head)
    rest = sum(row.odds for row in rows[MOST_ROWS:])
    more = len(rows) - len(shown)
    note = f'<p class="note">and {more} others, {_percent(rest)} % together</p>' if more else ""
    return (
        f'<div class="dd"><table id="odds"><thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table>{note}</div>"
    )


def _percent(odds: float) -> str:
    return f"{100.0 * odds:.3f}"


def _bar(part: float, color: str, wanted: float | None, longest: float) -> str:
    fill = f'<div class="fill" style="width:{100.0 * part:.2f}%;background:{color}"></div>'
    if wanted is None:
        return f'<div class="track">{fill}</div>'
    mark = f'<div class="wanted" style="left:{100.0 * wanted / longest:.2f}%"></div>'
    return f'<div class="track">{fill}{mark}</div>'
