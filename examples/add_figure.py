"""Add a figure to the report: a strip with a piece for each outcome.

`draw` gets a `FinishedDie` and returns the bytes of a PNG or GIF. Import what draws inside the
function.
"""

import dicedesign as dd
from dicedesign.report.figures import FIGURES, Figure


def strip(die):
    from dicedesign.report.sheet import Sheet

    sheet, left = Sheet(1000, 60), 0.0
    for number, share in enumerate(die.result.probabilities):
        sheet.drawing.barh(30, share * 1000, 60, left, color=("#4477aa", "#ccddee")[number % 2])
        left += share * 1000
    return sheet.png()


FIGURES.register(
    Figure(
        name="strip",
        line="a strip with a piece for each outcome",
        title="Shares",
        caption="As long as they are probable.",
        wanted=lambda die: True,
        draw=strip,
    )
)

result = dd.run({"name": "d4", "target": {"binomial": 3}}, out="outputs/d4")
print(result.files["strip"])
