"""Add an energy term to the paper's method: it draws all corners to one distance.

A term is a function of the current shape and of all weights. It returns its value without the
weight, as a scalar tensor that autograd differentiates in `state.rests.vertices`. Terms should not
depend on the size of the shape: divide lengths by their mean, as here. Where the term is undefined,
return a positive constant. With zero, the descent could lower the energy by losing an outcome.

The weight is the recipe key `method.paper.weights.evenness`. `options=` of `Term` declares further
numbers, which `evaluate` reads from `weights`. Only the descent has energy terms. With
`finish: exact`, the default, the exact method follows and optimizes its preferences instead, so
this example ends with `finish: none`.
"""

import numpy as np

import dicedesign as dd
from dicedesign.extensions import TERMS, Term


def evenness(state, weights):
    import torch

    lengths = torch.linalg.vector_norm(state.rests.vertices - state.rests.center_of_mass, dim=1)
    return ((lengths / lengths.mean() - 1.0) ** 2).mean()


TERMS.register(Term(name="evenness", line="draws all corners to one distance", evaluate=evenness))

for weight in (0.0, 8.0):
    paper = {"weights": {"evenness": weight}, "steps": 100, "finish": "none"}
    die = dd.design({"fair": 5}, start={"prism": {}}, method={"paper": paper})
    distances = np.linalg.norm(die.vertices, axis=1)
    print(weight, distances.std() / distances.mean(), die.message)
