"""Add a figure to the report: a strip with a piece for each outcome.

`draw` gets a `FinishedDie` and returns the bytes of a PNG or GIF. Import what draws inside the
function.
"""

import io

import dicedesign as dd
from dicedesign.extensions import FIGURES, Figure


def strip(die):
    from matplotlib.figure import Figure as Chart

    chart, left, file = Chart(figsize=(10.0, 0.6)), 0.0, io.BytesIO()
    axes = chart.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    for number, share in enumerate(die.result.probabilities):
        axes.barh(0.0, share, left=left, color=("#4477aa", "#ccddee")[number % 2])
        left += share
    chart.savefig(file, format="png")
    return file.getvalue()


FIGURES.register(
    Figure(
        name="strip",
        line="a strip with a piece for each outcome",
        title="Shares",
        caption="The length of each piece is the probability of its outcome.",
        wanted=lambda die: True,
        draw=strip,
    )
)

result = dd.run({"name": "d4", "target": {"binomial": 3}}, out="outputs/d4")
print(result.files["strip"])
