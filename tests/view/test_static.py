"""Files of the pages: scripts find what they import."""

from __future__ import annotations

import re

from dicedesign.view.server import STATIC


def test_the_page_has_what_it_uses_of_three() -> None:
    used = set(re.findall(r"THREE\.(\w+)", (STATIC / "stage.js").read_text()))
    exported = set(
        re.findall(r"\w+", (STATIC / "three.entry.mjs").read_text().split("export", 1)[1])
    )
    bundle = (STATIC / "three.mjs").read_text().rpartition("export{")[2]
    assert len(used) > 20
    assert used <= exported
    assert used <= set(re.findall(r"(\w+)[,}]", bundle))


def test_scripts_find_each_element() -> None:
    for page, scripts in {
        "die.html": ("die.js", "experts.js"),
        "rolls.html": ("rolls.js",),
    }.items():
        ids = set(re.findall(r'\bid="([\w-]+)"', (STATIC / page).read_text()))
        for script in scripts:
            text = (STATIC / script).read_text()
            found = set(re.findall(r"\$\('([\w-]+)'\)", text))
            assert found <= ids, script
