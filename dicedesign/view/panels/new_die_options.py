"""The folded part of a new die: method, start, seed, and a slider for each weight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from dicedesign.optimize.options import legible
from dicedesign.optimize.paper_options import PaperWeights
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.starts.start import STARTS, StartKind
from dicedesign.runtime.numbers import Number
from dicedesign.view.dice.request import DieRequest
from dicedesign.view.page.page import Page

__all__ = ["DieOptions"]

METHODS: Final = {"exact": "exact", "the paper's descent": "paper"}

BY_METHOD: Final = "as the method likes"
"""The start of who does not care."""

LEAST_LARGEST: Final = 2.0
"""A slider goes at least so far, and to four times its number's default."""

FASTEST: Final = 200
"""Steps a second, from which on none is held back."""


class DieOptions:
    """Fields of what a hobbyist need not know.

    on_weights: called when a weight or the method has changed, in the page's thread.
    """

    def __init__(self, page: Page, on_weights: Callable[[], None], on_speed: Callable[[], None]):
        gui = page.gui
        self._starts: dict[str, Mapping[str, Any] | None] = {BY_METHOD: None} | {
            kind.name: {kind.name: {}} for kind in STARTS if _is_plain(kind)
        }
        with gui.add_folder("More", expand_by_default=False):
            self._seed = gui.add_text("Seed", "0", hint="another seed gives another shape")
            self._method = gui.add_dropdown(
                "Method",
                tuple(METHODS),
                hint="exact: odds to rounding, then the preferences below; the paper's: vertices "
                "go down an energy, then an exact finish",
            )
            self._start = gui.add_dropdown(
                "Start", tuple(self._starts), hint="the shape to begin with"
            )
            self._speed = gui.add_slider(
                "Steps a second", 1, FASTEST, 1, 30, hint=f"{FASTEST}: as fast as they come"
            )
            with gui.add_folder("Preferences", expand_by_default=False):
                self._prefer = _sliders(page, Preferences.declared(), legible(), on_weights)
            self._energy = gui.add_folder(
                "Weights of the paper's energy", expand_by_default=False, visible=False
            )
            with self._energy:
                self._weights = _sliders(page, PaperWeights.declared(), PaperWeights(), on_weights)
        self._on_weights = on_weights
        self._method.on_update(lambda _: page.soon(self._take_method, "method"))
        self._speed.on_update(lambda _: page.soon(on_speed, "speed"))

    def _take_method(self) -> None:
        self._energy.visible = METHODS[self._method.value] == "paper"
        self._on_weights()

    @property
    def least_seconds(self) -> float:
        """That a step takes."""
        return 0.0 if self._speed.value >= FASTEST else 1.0 / self._speed.value

    def request(self, target: Mapping[str, Any]) -> DieRequest:
        """What the fields say. Raises InputError where a number cannot be."""
        seed = self._seed.value.strip()
        return DieRequest(
            target=target,
            # The recipe says what is wrong with another text.
            seed=int(seed) if seed.isdecimal() else seed,  # type: ignore[arg-type]
            method=METHODS[self._method.value],
            start=self._starts[self._start.value],
            prefer=Preferences(**{name: float(s.value) for name, s in self._prefer.items()}),
            weights=PaperWeights(**{name: float(s.value) for name, s in self._weights.items()}),
        )


def _is_plain(kind: StartKind) -> bool:
    """True for a kind of shape that needs nothing to be said of it."""
    if kind.make is None and kind.search is None:
        return False
    try:
        kind.options()
    except TypeError:
        return False
    return True


def _sliders(
    page: Page, declared: Mapping[str, Number], now: Any, on_change: Callable[[], None]
) -> dict[str, Any]:
    """A slider for each number, by its name."""
    sliders = {}
    for name, number in declared.items():
        value = float(getattr(now, name))
        most = max(LEAST_LARGEST, 4.0 * value)
        # No slider goes where a number is not allowed.
        while not number.allows(most):
            most /= 2.0
        least = 0.0 if number.allows(0.0) else most / 100.0
        slider = page.gui.add_slider(
            name.replace("_", " "), least, most, most / 200.0, value, hint=number.line
        )
        slider.on_update(lambda _: page.soon(on_change, "weights"))
        sliders[name] = slider
    return sliders
