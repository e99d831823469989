"""The paper's figure 9, cell by cell: what each regularizer of eq. 16 is for.

Each cell can be run on its own after the first, in an editor that knows `# %%`, or all of them:

    python examples/figure_9.py
"""

# %% A body of eleven faces, and how often each is to come up: the total of two dice.

from __future__ import annotations

from pathlib import Path

import numpy as np

import dicedesign as dd
from dicedesign.optimize.result import DesignResult
from dicedesign.report.render.solids import solids_figure

START = dd.hendecahedron("bisymmetric")
LABELS = [2, 3, 6, 5, 4, 7, 10, 9, 8, 11, 12]
TARGET = dd.sum_of_dice([6, 6]).probabilities[np.array(LABELS) - 2]


def designed(*left_out: str) -> DesignResult:
    """The paper's method without a finish, and without some terms."""
    given = {"barycenter": 0.03} | dict.fromkeys(left_out, 0.0)
    weights = dd.PaperWeights(**given)
    return dd.descend_as_paper(START, TARGET, dd.PaperOptions(weights=weights, finish="none"))


def degrees(cosines: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


def tell(name: str, die: DesignResult) -> None:
    """Angles from rests to the most probable one of their outcome, and between those."""
    poses = dd.rest_poses(die.hull.vertices)
    outcome = dd.cluster(poses.normals, die.directions).of_rest
    main = poses.normals[np.unique(outcome, return_index=True)[1]]
    stray = degrees((poses.normals * main[outcome]).sum(axis=1)).max()
    apart = degrees((main @ main.T)[np.triu_indices(len(main), 1)]).min()
    print(
        f"{name:14} max |p - q| {die.error:.1e}, {len(poses.normals)} rests for {len(TARGET)} "
        f"outcomes, strays up to {stray:4.1f} degrees, outcomes {apart:4.1f} degrees apart"
    )


# %% All terms: one rest for each outcome, well apart.

dice = {"all terms": designed()}
tell("all terms", dice["all terms"])

# %% Without one term after the other.

for term in ("coplanar", "barycenter", "neighbor", "apart"):
    dice[f"no {term}"] = designed(term)
    tell(f"no {term}", dice[f"no {term}"])

# %% The dice energy alone leaves rests that nobody asked for.

dice["dice alone"] = designed("coplanar", "barycenter", "neighbor", "apart")
tell("dice alone", dice["dice alone"])

# %% All of them side by side.

solids = [(name, die.hull.vertices, die.hull.triangles) for name, die in dice.items()]
picture = Path("outputs", "figure_9.png")
picture.parent.mkdir(exist_ok=True)
picture.write_bytes(solids_figure([solids], columns=3).png())
print(f"wrote {picture}")
