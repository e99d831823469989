"""What a new die shows and does, as tables of HTML."""

from __future__ import annotations

import html
from collections.abc import Iterable

from dicedesign.report.charts.palette import BASINS
from dicedesign.results.parts import Status
from dicedesign.view.dice.design_session import DesignSession
from dicedesign.view.dice.finishing import PrintableDie

__all__ = ["printed_table", "sentence", "session_html"]


def sentence(name: str, text: str, *, wrong: bool = False) -> str:
    """A sentence of an element of its own, or nothing for no text. name: the element's id."""
    look = "wrong" if wrong else "note"
    return f'<div class="dd"><p id="{name}" class="{look}">{html.escape(text)}</p></div>' * bool(
        text
    )


def session_html(session: DesignSession, chosen: int | None) -> str:
    """Where a design is, in a sentence with its state as an attribute, and a row for each outcome:
    label, bar with its target, odds, and whether its facet is pinned.

    chosen: the outcome whose label is to change places with the next that is clicked.
    """
    return _status(session) + _facet_table(session, chosen)


def _status(session: DesignSession) -> str:
    shape, state = session.shape, session.state
    said = []
    if state == "running":
        said.append("designing")
    elif state == "paused":
        said.append("paused" if shape is not None else "nothing designed yet")
    if session.message:
        said.append(session.message)
    if state == "running" and session.starts > 1:
        said.append(f"starting shape {session.starts}")
    if shape is not None:
        said.append(f"step {len(session.shapes) - 1}")
        said.append(f"farthest from the odds by {100.0 * shape.error:.3g} %")
    is_off = session.status not in (None, Status.CONVERGED)
    look = "wrong" if state == "failed" or is_off else "note"
    return (
        f'<div class="dd"><p id="design" class="{look}" data-state="{state}">'
        f"{html.escape('; '.join(said))}</p>{_terms(session)}</div>"
    )


def _terms(session: DesignSession) -> str:
    """What the steps lower: the terms of an energy, or preferences."""
    shape = session.shape
    if shape is None or not shape.terms:
        return ""
    terms = ", ".join(f"{name} {value:.3g}" for name, value in shape.terms.items())
    return f'<p id="terms" class="note">lowered: {html.escape(terms)}</p>'


def _facet_table(session: DesignSession, chosen: int | None) -> str:
    shape = session.shape
    if shape is None:
        return ""
    odds, target = shape.outcomes.odds.tolist(), shape.target.tolist()
    longest = max(*odds, *target)
    rows = []
    for place, (label, has, wanted) in enumerate(zip(session.labels, odds, target, strict=True)):
        color = BASINS[place % len(BASINS)]
        bar = (
            f'<div class="track"><div class="fill" style="width:{100.0 * has / longest:.2f}%;'
            f'background:{color}"></div><div class="wanted" '
            f'style="left:{100.0 * wanted / longest:.2f}%"></div></div>'
        )
        is_pinned = label in session.request.pinned
        mark = ' class="chosen"' if place == chosen else ""
        rows.append(
            f'<tr{mark}><td data-action="label:{place}" role="button" tabindex="0" '
            f'title="change places with another label">{html.escape(label)}</td>'
            f'<td class="bar">{bar}</td><td>{100.0 * wanted:.3f}</td><td>{100.0 * has:.3f}</td>'
            f'<td data-action="pin:{place}" role="button" tabindex="0" '
            f'aria-pressed="{str(is_pinned).lower()}" title="keep this facet where it is">'
            f"{'&#9679;' if is_pinned else '&#9675;'} pin</td></tr>"
        )
    stray = shape.outcomes.elsewhere
    if stray > 0.0:
        rows.append(
            f"<tr><td>other</td><td></td><td>0.000</td><td>{100.0 * stray:.3f}</td><td></td></tr>"
        )
    hint = (
        "Click two labels to let them change places."
        if chosen is None
        else (f"Click the label that changes places with {session.labels[chosen]}.")
    )
    return (
        '<div class="dd"><table id="facets"><thead><tr><th>shows</th><th></th><th>wanted %</th>'
        f"<th>has %</th><th></th></tr></thead><tbody>{''.join(rows)}</tbody></table>"
        f"<p class='note'>{html.escape(hint)}</p></div>"
    )


def printed_table(die: PrintableDie) -> str:
    """The odds of the file that is printed, as it was read back, and what there is to say."""
    rows = "".join(
        f"<tr><td>{html.escape(label)}</td><td>{100.0 * wanted:.6f}</td><td>{100.0 * has:.6f}</td>"
        "</tr>"
        for label, wanted, has in die.rows()
    )
    size = f"{die.recipe.size_mm:g} mm from corner to corner"
    look = "note" if die.is_converged else "wrong"
    return (
        '<div class="dd"><table id="printed"><thead><tr><th>shows</th><th>wanted %</th>'
        f"<th>in the file %</th></tr></thead><tbody>{rows}</tbody></table>"
        f"<p id='verdict' class='{look}'>{html.escape(die.message)}</p>"
        f"{_paragraphs([size, *die.notes])}</div>"
    )


def _paragraphs(texts: Iterable[str]) -> str:
    return "".join(f"<p class='note'>{html.escape(text)}</p>" for text in texts)
