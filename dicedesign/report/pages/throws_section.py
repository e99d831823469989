"""The part of a report about throws: how the die is thrown, and what it does then."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from dicedesign.report.pages.html_parts import figure_section, table_section, text_section
from dicedesign.throws.engines.engine import ENGINES

__all__ = ["ROLLING", "table_sections", "throwing_advice"]

ROLLING: Final = (
    "Set it down gently, each time in another orientation: the odds are those of rolling without "
    "momentum. Thrown it has others; the command dicedesign throw shows by how much."
)
"""How to roll a die that was designed for no table."""

_FIGURES: Final = (
    (
        "table",
        "Odds on the table",
        "The wide bar behind each outcome is its target. In front of it is how often the die would "
        "show it if it rolled without momentum, how often the momentum model expects it and, where "
        "throws were simulated, how often it came up, with the interval that chance allows.",
    ),
    (
        "rounds",
        "Round by round",
        "After each round of simulated throws the die was designed anew, to make up for what was "
        "seen. The dashed line is what a perfect die would show by chance in as many throws. "
        "Triangles, if any, are half as many throws onto tables on which it bounces a fifth more "
        "or less, where it is meant to have nearly the same odds.",
    ),
    (
        "throw",
        "A throw",
        "A simulated throw of typical length, in slow motion.",
    ),
    (
        "film",
        "The same throw in pictures",
        "With the time since the die was let go. The camera goes along with the die; the farther "
        "the shadow is below it, the higher it is in the air.",
    ),
)


def table_sections(result: Mapping[str, Any], images: Mapping[str, bytes]) -> list[str]:
    """Sections of a page about a die that is to be thrown.

    Parameters
    ----------
    result: with "labels" (k,), "target" (k,), "probabilities" (k,) without momentum, and "thrown":
        "table" (the fields of a `Table`), perhaps "momentum" (k,) expected odds, perhaps "rounds"
        (the figure is made of them), and perhaps "simulated": "engine", "drops" in all,
        "unresolved" of them, "counts" (k,), "frequencies" (k,), "intervals" (k, 2),
        "total_variation", its "interval" (2,) and "noise_floor".
    images: perhaps PNGs "table", "rounds" and "film", and a GIF "throw".
    """
    thrown = result["thrown"]
    parts = [text_section("On the table", [_manner(thrown["table"]), _judgement(thrown)])]
    for key, title, caption in _FIGURES:
        if key in images:
            parts.append(figure_section(title, images[key], caption))
        if key == "table":
            parts.append(_odds(result))
    return parts


def throwing_advice(table: Mapping[str, Any]) -> str:
    """How to throw a die by hand that was designed for a table."""
    if table["height"] == 0.0:
        return "Set it down on the table and let it tip over, from a random orientation."
    push = " with a little push and spin," if table["speed"] > 0.0 or table["spin"] > 0.0 else ""
    return (
        f"Throw it: let it fall from about {_length(table['height'])} above the table,{push} "
        "each time from another orientation. Set down gently it has other odds."
    )


def _length(metres: float) -> str:
    return f"{100.0 * metres:.3g} cm" if metres < 1.0 else f"{metres:.3g} m"


def _manner(table: Mapping[str, Any]) -> str:
    """What throws the odds are for."""
    fall = (
        f"falls from {_length(table['height'])} above the table, turned at random"
        if table["height"] > 0.0
        else "is set down on the table, turned at random"
    )
    motion = []
    if table["speed"] > 0.0:
        motion.append(f"moves sideways at {_length(table['speed'])} a second")
    if table["spin"] > 0.0:
        motion.append(f"spins {table['spin'] / (2.0 * math.pi):.2g} times a second")
    when = f"; when it is let go it {' and '.join(motion)}" if motion else ""
    bounce = (
        f"A corner that hits the table bounces off with {100.0 * table['restitution']:.3g} % of "
        "its speed"
        if table["restitution"] > 0.0
        else "It does not bounce"
    )
    drag = ", and it turns as slowly as in honey" if table["drag"] > 0.0 else ""
    return (
        f"The odds of this die are for throws in which it {fall}{when}. {bounce}; the coefficient "
        f"of friction is {table['friction']:.3g}{drag}. The die is "
        f'{1000.0 * table["size"]:.3g} mm across. This is the table "{table["name"]}": '
        f"{table['source']}."
    )


def _judgement(thrown: Mapping[str, Any]) -> str:
    """How wrong the die still is."""
    simulated = thrown.get("simulated")
    if simulated is None:
        return (
            "No throws of it were simulated: what it does on the table is what the momentum model "
            "expects."
        )
    return " ".join(_verdict(simulated))


def _verdict(simulated: Mapping[str, Any]) -> Iterator[str]:
    low, high = simulated["interval"]
    engine = ENGINES[simulated["engine"]]
    yield (
        f"In {simulated['drops']:,} throws that the design had not seen, simulated "
        f"by {engine.phrase or engine.title}, the outcomes' frequencies differ from the target by "
        f"a total variation of {simulated['total_variation']:.4f}: no bet on these throws was won "
        "more or less often than it should be by more than that. A perfect die would show "
        f"{simulated['noise_floor']:.4f} on the mean in as many throws, by chance alone."
    )
    if low > 0.0:
        yield f"So its odds are off by {low:.4f} to {high:.4f}, with a confidence of 95 %."
    else:
        yield (
            "So the throws do not tell it from a perfect one; with a confidence of 95 % its odds "
            f"are off by at most {high:.4f}."
        )
    if simulated["unresolved"]:
        yield f"{simulated['unresolved']:,} throws did not come to rest on a facet in time."
    elsewhere = simulated["drops"] - simulated["unresolved"] - sum(simulated["counts"])
    if elsewhere > 0:
        yield f"{elsewhere:,} came to rest on a facet without a label."


def _odds(result: Mapping[str, Any]) -> str:
    thrown = result["thrown"]
    columns: list[tuple[str, list[str]]] = [
        ("outcome", list(result["labels"])),
        ("target", _percentages(result["target"])),
        ("without momentum", _percentages(result["probabilities"])),
    ]
    if "momentum" in thrown:
        columns.append(("momentum model", _percentages(thrown["momentum"])))
    if "simulated" in thrown:
        simulated = thrown["simulated"]
        limits = [
            f"{100.0 * low:.2f} to {100.0 * high:.2f}" for low, high in simulated["intervals"]
        ]
        columns.append(("simulated throws", _percentages(simulated["frequencies"])))
        columns.append(("95 % interval", limits))
    header, cells = zip(*columns, strict=True)
    rows = list(zip(*cells, strict=True))
    return table_section("Odds in numbers (%)", header, rows)


def _percentages(odds: Any) -> list[str]:
    return [f"{100.0 * value:.2f}" for value in odds]
