"""The tab "Body": bars of odds, and what can be done with the body on show."""

from __future__ import annotations

from typing import Any

from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.page.page import Page
from dicedesign.view.panels.odds_bars import odds_html
from dicedesign.view.scenes.exhibit import Exhibit

__all__ = ["BodyPanel"]


class BodyPanel:
    """What a body does, live."""

    title = "Body"

    def __init__(self, exhibit: Exhibit) -> None:
        self._exhibit = exhibit
        self._bars: Any = None

    def build(self, page: Page) -> None:
        """Add the GUI elements; called once, within the tab."""
        self._bars = page.gui.add_html("")
        page.on_action("stand", lambda row: self._stand(int(row)))
        self._exhibit.on_change(self._refresh)

    def _refresh(self, viewed: ViewedBody) -> None:
        self._bars.content = odds_html(viewed, None)

    def _stand(self, row: int) -> None:
        viewed = self._exhibit.viewed
        if viewed is not None and row < len(viewed.rows) and viewed.rows[row].rest >= 0:
            self._exhibit.stand(viewed.rows[row].rest)
