"""Add a preference: a level face on top when the die rests.

Residuals are a tensor that is differentiable in the vertices. Their sum of squares is about 1 for
an ordinary die of any size. `die.rests` are the rests, `die.facets` (k,) the facet of each
outcome. Its weight is the recipe key `method.exact.prefer.level`.
"""

import dicedesign as dd
from dicedesign.extensions import PREFERENCES, Preference


def level(die):
    normals = die.rests.facet_normals(die.facets)
    return 1.0 + (normals @ normals.T).min(dim=1).values


PREFERENCES.register(
    Preference(name="level", line="a face opposite to each that bears a label", residuals=level)
)

die = dd.design([0.1, 0.1, 0.2, 0.2, 0.2, 0.2], method={"exact": {"prefer": {"level": 1.0}}})
print(die.message)
