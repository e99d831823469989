"""The part of a report that is about the attempts at a concave die."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dicedesign.report.pages.html_parts import number, table_section
from dicedesign.results.parts import Draft, Search, Status
from dicedesign.results.result import Result

__all__ = ["attempt_sections"]

_MOST_ROWS: Final = 12
"""Attempts that are listed."""

_FLAWS: Final = {
    Status.OFF_TARGET: "odds",
    Status.SELF_INTERSECTING: "meets itself",
    Status.TOO_NEAR: "outcomes near",
    Status.TIPPY: "margin",
}


def attempt_sections(result: Result, search: Search) -> Iterator[str]:
    """What was wanted of a concave die and what was reached, and what each attempt led to."""
    trade_off = search.trade_off
    meeting = 0 if result.concave is None else result.concave.self_intersections
    yield table_section(
        "Wanted and reached",
        ["", "wanted", "as it came", "this die"],
        [
            [
                "error of the odds, rests elsewhere included",
                f"at most {number(trade_off.tolerance, 3)}",
                number(result.error_before, 2),
                number(max(result.max_abs_error, result.elsewhere), 2),
            ],
            [
                "angle between outcomes",
                f"at least {trade_off.apart_deg:g}°",
                "-",
                f"{result.least_angle_deg:.1f}°",
            ],
            [
                "angle at which an outcome is left",
                f"at least {trade_off.margin_deg:g}°",
                "-",
                f"{result.least_margin_deg:.1f}°",
            ],
            ["pairs of triangles that meet", "0", "0", str(meeting)],
        ],
        "By die_plain.stl as it was read back.",
    )
    if not trade_off.drafts:
        return
    listed = sorted(trade_off.drafts, key=lambda draft: _rank(draft, search))
    count, done = len(listed), search.attempts
    note = f"{count} of {done} attempts led to a die"
    if count > _MOST_ROWS:
        note += f"; the best {_MOST_ROWS} are listed, result.json has all"
    yield table_section(
        "Attempts",
        ["attempt", "displacement (%)", "error", "apart (°)", "margin (°)", "meet", "s", "off"],
        [_row(draft, search) for draft in listed[:_MOST_ROWS]],
        f"{note}. Displacement is the mean over the points, in percent of the diagonal; meet are "
        "pairs of triangles that should not.",
    )


def _rank(draft: Draft, search: Search) -> tuple[bool, int, float, float]:
    """The die itself first, then what lacks least, is nearest to the odds and was moved least."""
    missed = max(draft.error - search.trade_off.tolerance, 0.0)
    lacks = len(list(search.trade_off.flaws(draft)))
    return draft.attempt != search.attempt, lacks, missed, draft.displacement


def _row(draft: Draft, search: Search) -> list[str]:
    chosen = ", this die" if draft.attempt == search.attempt else ""
    return [
        f"{draft.attempt}{chosen}",
        f"{100.0 * draft.displacement:.2f}",
        f"{draft.error:.1e}",
        f"{draft.apart_deg:.1f}",
        f"{draft.margin_deg:.1f}",
        str(draft.self_intersections),
        number(draft.seconds, 3),
        ", ".join(_FLAWS[status] for status in search.trade_off.flaws(draft)) or "nothing",
    ]
