"""Dice of the page: from a target to candidates, a dressed die, throws and files.

The page keeps its own state and sends it with each request. So two tabs are independent, and what
is kept here, designs and finished dice, only saves time: it is made anew when it is missing.
"""

from __future__ import annotations

import json
import threading
from base64 import b64encode
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.fabricate.file_formats import FILE_FORMATS, file_bytes
from dicedesign.fabricate.finish_options import ICON_NAMES
from dicedesign.fabricate.printers import PRINTERS
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.optimize.targets import Target
from dicedesign.palette import outcome_colors
from dicedesign.recipe.callbacks import Callbacks
from dicedesign.recipe.output import die_contents, draw_figures, make_finished_die, write_page
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe, parse_target, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.report.discs import basin_of_directions
from dicedesign.report.pages import rests_of_triangles
from dicedesign.rest.poses import RestPoses
from dicedesign.results.parts import READINGS, Candidate, Status
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.throws.simulation import DieOnTable, throw_film
from dicedesign.throws.tables import TABLE_NAMES
from dicedesign.view.motion import film_motion, release_motion

__all__ = ["Shop", "Stopped", "mesh_data", "packed"]

CANDIDATES = 6
"""Dice that are offered for a target."""

MAX_PROBABILITIES = 40
"""Outcomes of a die on the page; more are for recipes."""

KEPT_DIES = 24
"""Designs, and finished dice, that are kept in memory."""

SHAPE_NORMAL_COSINE = 0.9999
"""Cosine of the largest angle between a triangle and the facet that it is part of; others are on
rounded edges."""

ANY_HAND = 5e-4
"""Total variation for nine in ten hands below which a die is right in any hand."""

EDGE_CODE, BLANK_CODE, LABEL_CODE = 63, 62, 128
"""Codes of triangles: rounded edge, facet without an outcome, and the bit of labels."""

MAX_OUTCOME_CODE = 61
"""Outcome codes are at most this; outcomes beyond share it."""

FEW_THROWS = 20
"""Number of throws from which on they are judged."""

UNUSUAL, WRONG = 0.05, 1e-3
"""Probabilities of a chi-square test below which throws are unusual, or contradict the target."""

T = TypeVar("T")


class Stopped(BaseException):
    """The page no longer wants a design. It is no `Exception`, so that nothing catches it."""


def packed(values: Any, kind: str) -> str:
    """Base64 text of numbers in a little-endian type of numpy, such as "<f4"."""
    return b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


class Recent(Generic[T]):
    """Values of the latest keys; a missing one is made, by one thread at a time."""

    def __init__(self, make: Callable[[str], T], most: int) -> None:
        self._make, self._most = make, most
        self._values: OrderedDict[str, T] = OrderedDict()
        self._lock = threading.RLock()

    def put(self, key: str, value: T) -> None:
        """Keep a value."""
        with self._lock:
            self._values[key] = value
            self._values.move_to_end(key)
            while len(self._values) > self._most:
                self._values.popitem(last=False)

    def get(self, key: str) -> T:
        """Return the value of a key."""
        with self._lock:
            if key not in self._values:
                self.put(key, self._make(key))
            self._values.move_to_end(key)
            return self._values[key]


@dataclass(frozen=True, eq=False)
class FinishedWork:
    """A dressed die, and what is only computed on demand."""

    work: Work

    @cached_property
    def printed(self) -> Work:
        """The work after the checks for printing."""
        work = self.work.copy()
        run_stages(work, after="throws", last="tolerances")
        return work

    def on_table(self, table: str) -> DieOnTable:
        """The die on a table."""
        work = self.work
        return DieOnTable.of(work.final.body, None, work.die.directions, table, work.die.outcome_of)


class Shop:
    """Functions behind the page. All take and return JSON values, and may run in any thread."""

    def __init__(self) -> None:
        self._designs = Recent(self._design, KEPT_DIES)
        self._finished = Recent(self._finish, KEPT_DIES)

    def target(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Outcomes of a text, with their colors. An error has a text that may be meant, if any."""
        text = str(query["text"]).strip()
        try:
            target = self._recipe(text).target.target()
        except DiceError as error:
            return {"error": _short(error, text), "fix": self._correction(text)}
        if len(target.labels) > MAX_PROBABILITIES:
            return {
                "error": f"That has {len(target.labels)} outcomes. This page makes dice of up to "
                f"{MAX_PROBABILITIES}; a recipe can have more.",
                "fix": None,
            }
        return {
            "labels": target.labels,
            "probabilities": target.probabilities.tolist(),
            "colors": outcome_colors(len(target.labels)),
        }

    def _recipe(self, text: str, **entries: Any) -> Recipe:
        """Recipe of the text of a target. Raises DiceError."""
        target = parse_target(text.replace(";", ","), None)
        return parse_recipe({"name": "die", "target": target, **entries})

    def _correction(self, text: str) -> str | None:
        """Text near a wrong one that can be read, or None."""
        parts = text.replace(",", " ").replace(";", " ").replace(":", " ").split()
        with_sign = [part if part.endswith("%") else f"{part}%" for part in parts]
        shares = [_percent(part) for part in with_sign]
        tries = [", ".join(with_sign), ", ".join(parts)]
        if shares and None not in shares:
            missing = 100.0 - sum(share for share in shares if share is not None)
            if "%" in text and missing > 0.0:
                tries.append(", ".join([*with_sign, f"{missing:.6g}%"]))
            tries.append(":".join(part.rstrip("%") for part in parts))
        for guess in tries if len(parts) > 1 or "%" in text else ():
            try:
                self._recipe(guess)
            except DiceError:
                continue
            return guess
        return None

    def find_dice(
        self, query: Mapping[str, Any], emit: Callable[[dict[str, Any]], None], check: Callable
    ) -> None:
        """Design dice for a target, and emit each when it is ready, and their order at the end.

        query: "text", and "purpose" as in a recipe. emit: receives {"progress": [done, whole]},
        {"die": ...}, {"order": [ids]} or {"error": text}. check: raises `Stopped`.
        """
        text, purpose = str(query["text"]).strip(), query.get("purpose", "both")

        def on_candidate(facts: Candidate, target: Target, design: Any) -> None:
            check()
            faces = "one" if facts.name.startswith("one face") else facts.faces
            key = _key({"text": text, "purpose": purpose, "faces": faces})
            one = work.copy()
            one.recipe = self._recipe(text, purpose=purpose, faces=faces)
            one.die, one.target = design, target
            one.candidates, one.candidate_designs = (facts,), ()
            one.callbacks = Callbacks()
            self._designs.put(key, one)
            try:
                emit({"die": self._card(key, facts)})
            except DiceError:
                # Its labels do not fit.
                return
            ids[facts] = key

        def on_part(done: int, whole: int, unit: str) -> None:
            check()
            if unit == "dice":
                emit({"progress": len(ids)})

        ids = dict[Candidate, str]()
        callbacks = Callbacks(
            on_start=lambda _: check(),
            on_step=lambda _: check(),
            on_part=on_part,
            on_candidate=on_candidate,
        )
        try:
            recipe = self._recipe(text, purpose=purpose, candidates=CANDIDATES)
            work = Work(recipe, callbacks=callbacks, enlarge=True)
            run_stages(work, last="design")
            order = [ids[facts] for facts in work.candidates if facts in ids]
            if not order:
                raise InputError(
                    "labels: expected room for them on a die of up to 200 mm, got none; take "
                    "fewer outcomes"
                )
            emit({"order": order})
        except DiceError as error:
            emit({"error": str(error)})

    def _card(self, key: str, facts: Candidate) -> dict[str, Any]:
        """What a candidate looks like, and what distinguishes it."""
        work = self._finished.get(_key({"die": key, "dress": {}})).work
        style, hands = _thrown_style(work)
        return {
            "id": key,
            "name": facts.name[:1].upper() + facts.name[1:],
            "faces": facts.faces,
            "is_read_on_top": work.reading is None or work.reading.way != "down",
            "hands": hands,
            "style": style,
            "size_mm": work.recipe.size_mm,
            "stretch": facts.quotient,
            "lacks": facts.lacks,
            "mesh": mesh_data(work),
        }

    def _design(self, key: str) -> Work:
        """Design one die anew."""
        entries = json.loads(key)
        text = entries.pop("text")
        work = Work(self._recipe(text, **entries), enlarge=True)
        run_stages(work, last="design")
        return work

    def _finish(self, key: str) -> FinishedWork:
        """Dress a die: labels, edges, size, and printer."""
        query = json.loads(key)
        work, dress = self._designs.get(query["die"]).copy(), query["dress"]
        entries = work.recipe.as_dict() | {"print": {"printer": dress.get("printer", "fdm")}}
        labels = _labels(dress, work.target.labels)
        names = dict(zip(work.target.labels, labels, strict=True))
        if len(set(labels)) < len(labels):
            raise InputError(
                "labels: expected a different one for each outcome, got some twice; change them"
            )
        faces = tuple(names[label] for label in work.target.face_labels)
        work.target = Target(faces, work.target.face_probabilities, work.target.keeps_shares)
        if labels != work.target.labels or dress.get("labels"):
            entries["target"] = entries["target"] | {"labels": list(labels)}
        engrave: dict[str, Any] = {"font": dress["font"]} if dress.get("font") else {}
        if dress.get("style") == "raised":
            engrave["style"] = "raised"
        if dress.get("labels") == "pips":
            engrave["content"] = "pips"
        if dress.get("labels") == "icons":
            engrave["icons"] = dict(zip(labels, ICON_NAMES, strict=False))
        if engrave:
            entries["engrave"] = engrave
        edges = dress.get("edges", "sharp")
        if edges != "sharp":
            entries["edges"] = {"shape": edges}
        size = dress.get("size_mm")
        if size is not None:
            entries["size_mm"] = size
        work.recipe, work.enlarge = parse_recipe(entries), size is None
        run_stages(work, after="design", last="throws")
        return FinishedWork(work)

    def _find(self, query: Mapping[str, Any]) -> FinishedWork:
        dress = {key: value for key, value in query["dress"].items() if value is not None}
        return self._finished.get(_key({"die": query["die"], "dress": dress}))

    def work(self, query: Mapping[str, Any]) -> Work:
        """The finished die of a request. query: "die", its number, and "dress"."""
        return self._find(query).work

    def dress(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """A die with its labels and edges: its mesh, labels, verdict and probabilities."""
        work = self._find(query).work
        result = work.result()
        style, hands = _thrown_style(work)
        forecast = work.forecast
        return {
            "mesh": mesh_data(work),
            "labels": work.target.labels,
            "size_mm": work.recipe.size_mm,
            "style": style,
            "hands": hands,
            "message": result.message.splitlines()[0],
            "reading": READINGS["down" if work.reading is None else work.reading.way],
            "is_read_on_top": work.reading is not None and work.reading.way != "down",
            "target": result.target,
            "set_down": result.printed_probabilities,
            "thrown": None if forecast is None else forecast.probabilities,
            "table": None if forecast is None else forecast.table,
            "margin_deg": result.least_margin_deg,
            "notes": result.notes,
        }

    def printing(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Whether a die prints well: style, short sentences, and its weight in g."""
        work = self._find(query).printed
        printability, tolerances = work.printability, work.tolerances
        assert printability is not None
        assert work.recipe.print is not None
        name = PRINTERS[work.recipe.print.printer].line.partition(",")[0]
        strokes = [label.stroke_mm for label in printability.labels if label.stroke_mm]
        least = f"Strokes of {min(strokes):.1f} mm. " if strokes else ""
        if work.status not in (Status.CONVERGED, Status.OFF_TABLE):
            style, title, text = "bad", "It is not right yet.", work.message.splitlines()[0]
        elif printability.warnings:
            style, title = "bad", "Details are too fine."
            text = " ".join(f"{one[:1].upper()}{one[1:]}." for one in printability.warnings[:2])
        elif tolerances is None:
            style, title, text = "ok", "It prints.", least
        elif tolerances.allowed_mm is not None and (
            tolerances.allowed_mm < tolerances.assumed.get("dimensional_mm", 0.0)
        ):
            style, title = "warn", "It prints, but print it with care."
            text = (
                f"Faces must be within {tolerances.allowed_mm:.2g} mm; this printer ({name}) "
                f"usually keeps {tolerances.assumed['dimensional_mm']:.2g} mm. A larger die helps."
            )
        else:
            style, title = "ok", "It prints well."
            text = f"{least}1,000 rolls will rarely show the printer’s errors."
        return {
            "style": style,
            "title": title,
            "text": text,
            "weight_g": printability.weight_g,
        }

    def throw(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Throw a die, or set it down: counts by outcome, and the motion of the last time.

        query: "die", "dress", "count" from 1, "seed", and "table", None to set it down.
        """
        finished, count, seed = self._find(query), int(query["count"]), int(query["seed"])
        if not 1 <= count <= 1000 or seed < 0:
            raise InputError(f"count: expected 1 to 1,000, got {count}; change it")
        work, table = finished.work, query["table"]
        counts = np.zeros(len(work.target.labels), dtype=np.int64)
        if table is None:
            poses, outcomes = work.final.poses, work.final.outcomes
            downs = unit_vectors(np.random.default_rng(seed).normal(size=(count, 3)))
            motion, rest = release_motion(poses, downs[-1])
            rests = [*basin_of_directions(poses, downs[:-1]).tolist(), rest]
            counts += outcomes.sums(np.bincount(rests, minlength=len(poses.facets))).astype(int)
        else:
            if table not in TABLE_NAMES:
                raise InputError(
                    f"table: expected {', '.join(TABLE_NAMES)}, got {table!r}; take one of these"
                )
            die = finished.on_table(table)
            outcomes, poses = die.outcomes, die.poses
            rng = np.random.default_rng(seed)
            on = die.tables[int(rng.integers(len(die.tables)))]
            film = throw_film(die.body, on, seed, candidates=1)
            rest = film.rest
            motion = film_motion(film)
            if rest >= 0:
                counts[outcomes.outcome_of_rest[rest]] += 1
            if count > 1:
                throws = die.simulate(count - 1, seed)
                counts += die.counts(throws).sum(axis=0)[:-1]
        last = -1 if rest < 0 else int(outcomes.outcome_of_rest[rest])
        return {
            "counts": counts.tolist(),
            "outcome": last,
            "down": None if rest < 0 else poses.normals[rest].tolist(),
            "motion": {
                "seconds": motion.seconds.tolist(),
                "positions": packed(motion.positions, "<f4"),
                "quaternions": packed(motion.quaternions, "<f4"),
            },
        }

    def judge(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """One sentence on counted throws. query: as for `throw`, with "counts"."""
        work = self._find(query).work
        counts = np.array(query["counts"], dtype=np.int64)
        target, labels = work.target.probabilities, work.target.labels
        throws = int(counts.sum())
        if throws == 0:
            return {"style": "info", "text": "No throws yet. The marks show what to expect."}
        if throws < FEW_THROWS:
            times = "throw" if throws == 1 else "throws"
            return {
                "style": "info",
                "text": f"{throws} {times} so far: too few to tell. Throw 100.",
            }
        p_value = chi_square(counts, target).p_value
        rate = 100.0 * p_value
        worst = int(np.argmax(np.abs(counts - throws * target) / np.sqrt(throws * target)))
        if p_value < WRONG:
            advice = (
                ""
                if query["table"] is None
                else (" Set it down gently, or pick a die that is right on a table.")
            )
            return {
                "style": "bad",
                "text": f"Not as designed: {labels[worst]} came up {counts[worst]} times; expect "
                f"{throws * target[worst]:.0f}.{advice}",
            }
        forecast = work.forecast
        if (
            query["table"] is not None
            and forecast is not None
            and forecast.is_off(tuple(target.tolist()))
        ):
            got, wanted = np.array(forecast.probabilities), target
            most = int(np.argmax(np.abs(got / wanted - 1.0)))
            return {
                "style": "warn",
                "text": "Too few throws to show it, but thrown, this die is off: expect "
                f"{labels[most]} in {100 * got[most]:.2g} %, not {100 * wanted[most]:.2g} %, of "
                "many throws.",
            }
        if p_value < UNUSUAL:
            often = "less than 1" if rate < 1.0 else f"only {rate:.0f}"
            return {
                "style": "warn",
                "text": f"Unusual: a perfect die strays this far in {often} of 100 such series. "
                "Throw 100 more to be sure.",
            }
        often = "nearly all" if rate >= 99.0 else f"{rate:.0f} of 100"
        return {
            "style": "ok",
            "text": f"As expected: even a perfect die strays this far in {often} such series.",
        }

    def file(self, query: Mapping[str, Any]) -> tuple[str, bytes]:
        """Name and content of a file of a die. query: "kind" is an ending of `FILE_FORMATS`, "yaml"
        or "html"; "colors": of body and labels, for formats that have them."""
        finished, kind = self._find(query), query["kind"]
        work = finished.work
        name = f"{work.recipe.name}.{kind}"
        if kind == "yaml":
            return name, recipe_text(work.recipe).encode()
        if kind == "stl":
            return name, work.files[f"{work.stem}.stl"]
        if kind == "html":
            report = finished.printed.copy()
            draw_figures(report)
            write_page(report)
            return "report.html", report.files["report.html"]
        contents = die_contents(work)
        if query.get("colors"):
            body, label = map(str, query["colors"])
            parts = [
                replace(part, color=label if part.name == "labels" else body, label_color=label)
                for part in contents.parts
            ]
            contents = replace(contents, parts=parts)
        return name, file_bytes(contents, FILE_FORMATS[kind], name)


def _key(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


def _percent(text: str) -> float | None:
    try:
        return float(text.rstrip("%"))
    except ValueError:
        return None


def _short(error: DiceError, text: str) -> str:
    """Message about the text of a target, for somebody who has just typed it."""
    if not text:
        return "Write what to roll: dice such as 2d6, or chances such as 50%, 30%, 20%."
    message = str(error).removeprefix("target: ").removeprefix("probabilities: ")
    return message[:1].upper() + message[1:] + "."


def _labels(dress: Mapping[str, Any], labels: tuple[str, ...]) -> tuple[str, ...]:
    """Labels of the outcomes by the choice of the page."""
    choice = dress.get("labels")
    if choice == "letters":
        return tuple(_letters(number) for number in range(len(labels)))
    if choice == "own":
        own = [str(one).strip() for one in dress.get("texts", ())]
        if len(own) != len(labels) or not all(own):
            raise InputError(
                f"labels: expected {len(labels)}, one for each outcome, got "
                f"{len([one for one in own if one])}; write them with commas between"
            )
        return tuple(own)
    if choice == "pips" and not all(label.isdecimal() for label in labels):
        return tuple(str(number + 1) for number in range(len(labels)))
    return labels


def _letters(number: int) -> str:
    """A, B, ..., Z, AA, AB, ... for a number from 0."""
    tens, ones = divmod(number, 26)
    return (_letters(tens - 1) if tens else "") + chr(ord("A") + ones)


def _thrown_style(work: Work) -> tuple[str, str]:
    """Style of a die's badge, and the hands in which it is right."""
    if work.status is not Status.CONVERGED:
        return "bad", "Not right yet"
    forecast = work.forecast
    if forecast is None:
        return "warn", "Only set down"
    if forecast.nine_in_ten < ANY_HAND:
        return "ok", "Right in every hand"
    if forecast.is_off(tuple(work.target.probabilities.tolist())):
        return "warn", "Only when set down"
    return "ok", "Right on a table"


def mesh_data(work: Work) -> dict[str, Any]:
    """Mesh of the finished die about its center of mass, with a code for each triangle, and its
    rests."""
    contents = die_contents(work)
    finished = make_finished_die(work)
    outcome_of_rest = np.append(work.plain.outcomes.outcome_of_rest, -1)
    points, triangles, codes = [], [], []
    first = 0
    for part in contents.parts:
        rests = rests_of_triangles(part, finished)
        outcomes = outcome_of_rest[rests]
        code = np.where(outcomes < 0, BLANK_CODE, np.minimum(outcomes, MAX_OUTCOME_CODE))
        labels = part.labels if part.labels is not None else np.zeros(len(rests), dtype=bool)
        if part.name == "labels":
            labels = np.ones(len(rests), dtype=bool)
        normals = doubled_area_vectors(part.points, part.triangles)
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        facets = np.append(work.plain.poses.normals, np.zeros((1, 3)), axis=0)[rests]
        is_edge = ~labels & ((normals * facets).sum(axis=1) < SHAPE_NORMAL_COSINE)
        if work.die.reshaped is None:
            code = np.where(is_edge, EDGE_CODE, code)
        points.append(part.points)
        triangles.append(part.triangles + first)
        codes.append(code + np.where(labels, LABEL_CODE, 0))
        first += len(part.points)
    poses = work.final.poses
    return {
        "points": packed(np.concatenate(points) - poses.center_of_mass, "<f4"),
        "triangles": packed(np.concatenate(triangles), "<u4"),
        "codes": packed(np.concatenate(codes), "<u1"),
        "rests": [
            {"down": normal, "outcome": outcome}
            for normal, outcome in zip(
                poses.normals.tolist(), work.final.outcomes.outcome_of_rest.tolist(), strict=True
            )
        ],
        "show": _nicest_rest(poses, work),
    }


def _nicest_rest(poses: RestPoses, work: Work) -> int:
    """Rest in which a die is shown: that of the most probable outcome."""
    outcome = int(work.target.probabilities.argmax())
    return int(np.argmax(work.final.outcomes.outcome_of_rest == outcome))
