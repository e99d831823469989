"""Add a stage to a run: it writes the probabilities as a CSV file.

A stage reads what earlier stages left in `work` and adds its own: `work.files` (bytes by file
name), `work.notes` (sentences) or `work.extra` (plain data for result.json). `wanted`
returns whether a run needs it; `after` names the stage that it follows. Without `after` it is the
last.
"""

import dicedesign as dd
from dicedesign.extensions import STAGES, Stage


def probabilities_table(work):
    result = work.result()
    rows = zip(result.labels, result.target, result.probabilities, strict=True)
    text = "label,target,probability\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows)
    work.files["probabilities.csv"] = text.encode()


STAGES.register(
    Stage(
        name="probabilities table",
        line="writes the probabilities as probabilities.csv",
        after="tolerances",
        wanted=lambda work: work.folder is not None,
        run=probabilities_table,
    )
)

result = dd.run({"name": "d5", "target": {"fair": 5}, "figures": False}, out="outputs/d5")
print((result.folder / "probabilities.csv").read_text())
