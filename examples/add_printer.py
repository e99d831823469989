"""Add a printer: your own limits, with their source."""

from dataclasses import replace

import dicedesign as dd
from dicedesign.extensions import PRINTERS

mine = PRINTERS["fdm"].with_nozzle(0.25)
PRINTERS.register(
    replace(mine, name="workshop", line="the one downstairs", overhang_deg=35.0, sources=("tried",))
)

result = dd.run({"name": "d6", "target": {"fair": 6}, "print": "workshop"}, out="outputs/d6")
print(result.printability.best, result.printability.warnings)
