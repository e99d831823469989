"""Rows of bars as HTML: what each rest or outcome is worth, set down and thrown."""

from __future__ import annotations

import html
from typing import Final

from dicedesign.report.charts.palette import BASINS
from dicedesign.runtime.arrays import Floats
from dicedesign.view.bodies.viewed_body import ViewedBody

__all__ = ["odds_html"]

MOST_ROWS: Final = 24


def odds_html(viewed: ViewedBody, thrown: Floats | None, chosen: int = -1) -> str:
    """A table of the rows of a body: label, bar, odds in percent.

    thrown: (rows,) odds on a table, or None; chosen: the row that is marked.
    """
    rows = viewed.rows
    shown = range(min(len(rows), MOST_ROWS))
    wanted = [row.wanted or 0.0 for row in rows]
    odds = [row.odds for row in rows]
    longest = max(1e-9, *odds, *wanted, *([] if thrown is None else thrown.tolist()))
    head = "<th>shows</th>" if viewed.outcomes is not None else "<th>rest</th>"
    head += "<th></th>"
    if any(wanted):
        head += "<th>wanted %</th>"
    head += "<th>set down %</th>" + ("" if thrown is None else "<th>thrown %</th>")
    lines = []
    for place in shown:
        row = rows[place]
        bar = _bar(row.odds, row.wanted, longest, BASINS[row.color % len(BASINS)])
        numbers = [row.odds]
        if any(wanted):
            numbers.insert(0, wanted[place])
        if thrown is not None:
            numbers.append(float(thrown[place]))
            bar += (
                f'<div class="thrown" style="width:{100.0 * thrown[place] / longest:.2f}%"></div>'
            )
        cells = "".join(f"<td>{100.0 * number:.3f}</td>" for number in numbers)
        mark = ' class="chosen"' if place == chosen else ""
        lines.append(
            f'<tr{mark} tabindex="0" role="button" data-action="stand:{place}" '
            f'title="stand it like this"><td>{html.escape(row.label)}</td>'
            f'<td class="bar">{bar}</td>{cells}</tr>'
        )
    more = len(rows) - len(shown)
    rest = sum(odds[MOST_ROWS:])
    note = f"<p class='note'>and {more} others, {100.0 * rest:.3f} % together</p>" if more else ""
    return (
        f'<div class="dd"><table id="odds"><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table>{note}</div>"
    )


def _bar(odds: float, wanted: float | None, longest: float, color: str) -> str:
    mark = (
        ""
        if wanted is None
        else f'<div class="wanted" style="left:{100.0 * wanted / longest:.2f}%"></div>'
    )
    fill = f'<div class="fill" style="width:{100.0 * odds / longest:.2f}%;background:{color}">'
    return f'<div class="track">{fill}</div>{mark}</div>'
