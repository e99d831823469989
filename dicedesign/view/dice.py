"""Dice of the page: from a target to candidates, a dressed die, throws and files.

The page keeps its own state and sends it with each request. So two tabs are independent, and what
is kept here, designs and finished dice, only saves time: it is made anew when it is missing.
"""

from __future__ import annotations

import json
import math
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np

from dicedesign.errors import DiceError, InputError, LabelRoomError
from dicedesign.fabricate.file_formats import FILE_FORMATS, file_bytes
from dicedesign.fabricate.finish_options import ICON_NAMES
from dicedesign.fabricate.label_reading import Reading
from dicedesign.geometry.meshes.body import body_of
from dicedesign.optimize.targets import Target
from dicedesign.palette import outcome_colors, text_color
from dicedesign.recipe.callbacks import Callbacks
from dicedesign.recipe.output import die_contents, draw_figures, write_page
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe, parse_target, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import Candidate, Status
from dicedesign.results.verdict import ANY_HAND
from dicedesign.view.meshes import CodedMesh, die_mesh
from dicedesign.view.throwing import judge_throws, throw_body
from dicedesign.view.viewed_body import ViewedBody, outcomes_of

__all__ = ["Shop", "Stopped"]

CANDIDATES = 6
"""Dice that are offered for a target."""

MAX_PROBABILITIES = 40
"""Outcomes of a die on the page; more are for recipes."""

KEPT_DIES = 24
"""Designs, and finished dice, that are kept in memory."""

MAX_ADVISED_MM = 100.0
"""Largest size that is advised for the sake of fine labels."""

MAX_NOTICED = 0.1
"""Share of prints that a test of 1,000 rolls may reject, of which 0.05 are perfect ones."""

CHANCE = re.compile(r"(\d{1,6}) (?:in|of|out of) (\d{1,6})")
"""Text of one outcome's chance, such as "1 in 3"."""

NAMED_KEY = re.compile(r"[\w.]+: |expected dice|expected YAML")
"""Start of a message on something that only recipes have."""

WRONG_SUM = "expected a sum of 1, got "
"""Start of the message on probabilities with another sum."""

MANY_ERRORS = 0.03
"""Mean total variation of prints from which a die is better printed in resin."""

T = TypeVar("T")


class Stopped(BaseException):
    """The page no longer wants a design. It is no `Exception`, so that nothing catches it."""


class Recent(Generic[T]):
    """Values of the latest keys; a missing one is made, by one thread at a time. Others that are
    there can be had meanwhile."""

    def __init__(self, make: Callable[[str], T], most: int) -> None:
        self._make, self._most = make, most
        self._values: OrderedDict[str, T] = OrderedDict()
        self._lock, self._making = threading.Lock(), threading.Lock()

    def put(self, key: str, value: T) -> None:
        """Keep a value."""
        with self._lock:
            self._values[key] = value
            self._values.move_to_end(key)
            while len(self._values) > self._most:
                self._values.popitem(last=False)

    def get(self, key: str) -> T:
        """Return the value of a key."""
        value = self._find(key)
        if value is not None:
            return value
        with self._making:
            value = self._find(key)
            if value is None:
                value = self._make(key)
                self.put(key, value)
            return value

    def _find(self, key: str) -> T | None:
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
            return self._values.get(key)


@dataclass(frozen=True, eq=False)
class FinishedWork:
    """A dressed die, and what is only computed on demand."""

    work: Work

    @property
    def reading(self) -> Reading:
        """Way to read the labels, which each die of the page has."""
        assert self.work.reading is not None
        return self.work.reading

    @cached_property
    def printed(self) -> Work:
        """The work after the checks for printing."""
        work = self.work.copy()
        run_stages(work, after="throws", last="tolerances")
        return work

    @cached_property
    def mesh(self) -> CodedMesh:
        """Mesh with the outcomes that the sides show."""
        return die_mesh(self.work)

    @property
    def mesh_data(self) -> dict[str, Any]:
        """The mesh for the page. In pictures the most probable outcome has come up."""
        work = self.work
        outcome_of_rest = work.final.outcomes.outcome_of_rest
        show = int(np.argmax(outcome_of_rest == work.target.probabilities.argmax()))
        return self.mesh.data(work.final.poses, outcome_of_rest, show)

    @cached_property
    def viewed(self) -> ViewedBody:
        """The die as a body that can be thrown."""
        work = self.work
        body = body_of(work.finished, work.recipe.name)
        return ViewedBody.of(body, outcomes=outcomes_of(work), poses=work.final.poses)


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
        colors = outcome_colors(len(target.labels))
        return {
            "labels": target.labels,
            "probabilities": target.probabilities.tolist(),
            "colors": colors,
            "texts": [text_color(color) for color in colors],
        }

    def _recipe(self, text: str, **entries: Any) -> Recipe:
        """Recipe of the text of a target. Raises DiceError."""
        target = parse_target(text.replace(";", ","), None)
        return parse_recipe({"name": "die", "target": target, **entries})

    def _correction(self, text: str) -> str | None:
        """Text near a wrong one that can be read, or None."""
        spaced = text if text.count("/") < 2 or "," in text else text.replace("/", " ")
        parts = spaced.replace(",", " ").replace(";", " ").replace(":", " ").split()
        with_sign = [part if part.endswith("%") else f"{part}%" for part in parts]
        shares = [share for share in map(_percent, with_sign) if share is not None]
        tries = [", ".join(with_sign), ", ".join(parts)]
        if len(shares) == len(parts) > 0:
            missing = 100.0 - sum(shares)
            # A little is missing because of rounding.
            if "%" in text and missing > (min(shares) / 2.0 if len(shares) > 1 else 0.0):
                tries.append(", ".join([*with_sign, f"{missing:.6g}%"]))
            tries.append(":".join(part.rstrip("%") for part in parts))
        chance = CHANCE.fullmatch(text)
        if chance is not None:
            hits, whole = map(int, chance.groups())
            tries = [f"{hits}/{whole}, {whole - hits}/{whole}"]
        elif len(parts) == 1 and "%" not in text:
            tries = ["d2" if text.lower() == "coin" else f"d{text}" if text.isdecimal() else text]
        for guess in tries:
            with suppress(DiceError):
                if len(self._recipe(guess).target.target().labels) <= MAX_PROBABILITIES:
                    return guess
        return None

    def find_dice(
        self,
        query: Mapping[str, Any],
        emit: Callable[[dict[str, Any]], None],
        check: Callable[[], None],
    ) -> None:
        """Design dice for a target, and emit each when it is ready, and their order at the end.

        query: "text", and "count" of dice, `CANDIDATES` by default. emit: receives {"die": ...} for
        each, {"order": [numbers]} at the end, or {"error": text}. check: raises `Stopped`.
        """
        text, wanted = str(query["text"]).strip(), int(query.get("count", CANDIDATES))

        def on_candidate(facts: Candidate, target: Target, design: Any) -> None:
            check()
            faces = "one" if facts.name.startswith("one face") else facts.faces
            key = _key({"text": text, "faces": faces})
            one = work.copy()
            one.recipe = self._recipe(text, faces=faces)
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

        ids = dict[Candidate, str]()
        callbacks = Callbacks(
            on_start=lambda _: check(),
            on_step=lambda _: check(),
            on_part=lambda *_: check(),
            on_candidate=on_candidate,
        )
        try:
            recipe = self._recipe(text, candidates=wanted)
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
        finished = self._finished.get(_key({"die": key, "dress": {}}))
        work = finished.work
        style, hands = _thrown_style(work)
        return {
            "id": key,
            "name": facts.name.partition(" of ")[0].partition(",")[0].capitalize(),
            "faces": facts.faces,
            "is_read_on_top": finished.reading.way != "down",
            "hands": hands,
            "style": style,
            "size_mm": work.recipe.size_mm,
            "weight_g": facts.weight_g,
            "is_sensitive": facts.prints > MANY_ERRORS,
            "mesh": finished.mesh_data,
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
            engrave["icons"] = {label: label for label in labels if label in ICON_NAMES}
        if engrave:
            entries["engrave"] = engrave
        edges = dress.get("edges", "sharp")
        if edges != "sharp":
            entries["edges"] = {"shape": edges}
        size = dress.get("size_mm")
        if size is not None:
            entries["size_mm"] = size
        work.recipe, work.enlarge = parse_recipe(entries), size is None
        try:
            run_stages(work, after="design", last="throws")
        except LabelRoomError as error:
            raise InputError(
                f"labels: expected a die of at least {math.ceil(error.size_mm)} mm for them, got "
                f"{work.recipe.size_mm:g} mm; enlarge it, or shorten the labels"
            ) from error
        return FinishedWork(work)

    def _find(self, query: Mapping[str, Any]) -> FinishedWork:
        dress = {key: value for key, value in query["dress"].items() if value is not None}
        return self._finished.get(_key({"die": query["die"], "dress": dress}))

    def work(self, query: Mapping[str, Any]) -> Work:
        """The finished die of a request with "die" and "dress"."""
        return self._find(query).work

    def viewed(self, query: Mapping[str, Any]) -> tuple[ViewedBody, CodedMesh]:
        """The finished die of a request as a body, and its mesh."""
        finished = self._find(query)
        return finished.viewed, finished.mesh

    def dress(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """A die with its labels and edges: its mesh, labels and verdict."""
        finished = self._find(query)
        work, forecast = finished.work, finished.work.forecast
        style, hands = _thrown_style(work)
        return {
            "mesh": finished.mesh_data,
            "labels": work.target.labels,
            "size_mm": work.recipe.size_mm,
            "style": style,
            "hands": hands,
            "message": work.message.splitlines()[0],
            "reading": finished.reading.sentence,
            "is_read_on_top": finished.reading.way != "down",
            "target": work.target.probabilities.tolist(),
            "table": None if forecast is None else forecast.table,
        }

    def printing(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Whether a die prints well: style, short sentences, and its weight in g."""
        work = self._find(query).printed
        printability, tolerances = work.printability, work.tolerances
        assert printability is not None
        assert work.recipe.print is not None
        printer = work.recipe.print.selected_printer
        strokes = [label.stroke_mm for label in printability.labels if label.stroke_mm]
        ridges = [label.ridge_mm for label in printability.labels if label.ridge_mm]
        least = f"Strokes of {min(strokes):.1f} mm. " if strokes else ""
        size = None
        if work.status not in (Status.CONVERGED, Status.OFF_TABLE):
            style, title, text = "bad", "It is not right yet.", work.message.splitlines()[0]
        elif printability.warnings:
            style, title = "bad", "Details are too fine."
            is_raised = work.recipe.engrave is not None and work.recipe.engrave.style == "raised"
            stroke_mm = printer.raised_mm if is_raised else printer.groove_mm
            needs = [stroke_mm / stroke for stroke in strokes]
            needs += [printer.ridge_mm / ridge for ridge in ridges]
            larger = math.ceil(work.recipe.size_mm * max(needs, default=1.0))
            if work.recipe.size_mm < larger <= MAX_ADVISED_MM:
                size = larger
            text = f"{printability.warnings[0].partition(':')[0]}."
            text = text[:1].upper() + text[1:]
        elif tolerances is None:
            style, title, text = "ok", "It prints.", least
        elif tolerances.noticed > MAX_NOTICED and tolerances.allowed_mm is not None:
            style, title = "warn", "It prints, but print it with care."
            text = (
                f"Faces must be within {tolerances.allowed_mm:.2g} mm; such a printer usually "
                f"keeps {tolerances.assumed['dimensional_mm']:.2g} mm. A larger die helps."
            )
        else:
            style, title = "ok", "It prints well."
            text = f"{least}1,000 rolls will rarely show the printer’s errors."
        return {
            "style": style,
            "title": title,
            "text": text,
            "size_mm": size,
            "weight_g": printability.weight_g,
        }

    def throw(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Throws of a die; see `throw_body`."""
        return throw_body(self._find(query).viewed, query)

    def judge(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Sentence on "counts" of a die thrown on a "table", None if set down."""
        work = self.work(query)
        forecast = None if query["table"] is None else work.forecast
        counts = np.array(query["counts"], dtype=np.int64)
        return judge_throws(counts, work.target.probabilities, work.target.labels, forecast)

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
    message = message.removeprefix("fair: ")
    if message.startswith(WRONG_SUM):
        total = message.removeprefix(WRONG_SUM).partition(";")[0]
        return f"These add up to {total}. Chances add up to 1, or to 100 %."
    if NAMED_KEY.match(message):
        return "This cannot be read. Write dice such as 2d6, or chances such as 50%, 30%, 20%."
    return f"{message[:1].upper()}{message[1:].rstrip('?.')}."


def _labels(dress: Mapping[str, Any], labels: tuple[str, ...]) -> tuple[str, ...]:
    """Labels of the outcomes by the choice of the page."""
    choice = dress.get("labels")
    if choice == "icons":
        return (*ICON_NAMES[: len(labels)], *labels[len(ICON_NAMES) :])
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
