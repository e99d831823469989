"""What the differentiable functions refuse."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import torch

from dicedesign import SampledDirections, height
from dicedesign.errors import DegenerateBodyError, InputError, OutsideHullError
from dicedesign.gradient.differentiable_rest import differentiable_rest, differentiable_rest_batch
from dicedesign.gradient.rest_probabilities import evaluate_rests
from tests.reference import solids

BOX = solids.box(1.0, 2.0, 3.0).points
GOOD = torch.tensor(BOX)
ORIGIN = torch.zeros(3).double()
FAR = torch.tensor([2.0, 0.0, 0.0]).double()


@pytest.mark.parametrize(
    ("function", "arguments", "error", "text"),
    [
        (differentiable_rest, [BOX], InputError, "vertices: expected a float32 or float64 tensor"),
        (evaluate_rests, [BOX], InputError, "vertices: expected a float32 or float64 tensor"),
        (differentiable_rest, [GOOD.long()], InputError, "got torch.int64"),
        (differentiable_rest, [GOOD.to("meta")], InputError, "got a meta tensor"),
        (differentiable_rest, [GOOD.to_sparse()], InputError, "got one of layout torch.sparse_coo"),
        (differentiable_rest, [GOOD[:, :2]], InputError, r"got shape \(8, 2\)"),
        (differentiable_rest, [GOOD, ORIGIN[:, None]], InputError, r"got shape \(3, 1\)"),
        (differentiable_rest, [GOOD, FAR], OutsideHullError, "strictly inside"),
        (differentiable_rest, [GOOD, ORIGIN * torch.nan], InputError, "three finite numbers"),
        (differentiable_rest, [GOOD[:3]], DegenerateBodyError, "expected at least 4"),
        (partial(differentiable_rest, table="glass"), [GOOD], InputError, "expected board-game"),
        (
            partial(differentiable_rest, prior=SampledDirections(BOX)),
            [GOOD],
            InputError,
            r"VonMisesFisher\.fitted",
        ),
        (
            partial(differentiable_rest, prior="half:0,0,1", table="paper"),
            [GOOD],
            InputError,
            "table",
        ),
        (
            differentiable_rest_batch,
            [[GOOD, GOOD[:3]]],
            DegenerateBodyError,
            "^body 1: .*at least 4",
        ),
        (
            differentiable_rest_batch,
            [[GOOD] * 2, torch.stack([ORIGIN, FAR])],
            OutsideHullError,
            "^body 1: center of mass: expected a point strictly inside",
        ),
        (differentiable_rest_batch, [[GOOD] * 2, ORIGIN], InputError, r"of shape \(2, 3\), got"),
        (differentiable_rest_batch, [[GOOD, BOX]], InputError, "^body 1: .*got ndarray"),
        (differentiable_rest_batch, [[GOOD, GOOD.float()]], InputError, "^body 1: .*as body 0"),
        (differentiable_rest_batch, [GOOD], InputError, r"^bodies: .*got shape \(8, 3\)"),
        (
            partial(differentiable_rest_batch, counts=[9]),
            [GOOD[None]],
            InputError,
            "from 0 to 8 points, got 9 for body 0",
        ),
        (height, [BOX, [1.0, 0.0]], InputError, r"of shape \(..., 3\), got \(2,\)"),
        (height, [BOX, np.zeros((1, 3))], InputError, "vectors of finite length"),
        (height, [BOX, np.eye(3), [0.0]], InputError, "center of mass: expected three numbers"),
        (height, [GOOD, np.eye(3)], InputError, "directions: expected a float32 or float64 te"),
    ],
)
def test_refused(
    function: Callable[..., object], arguments: list, error: type[InputError], text: str
) -> None:
    with pytest.raises(error, match=text):
        function(*arguments)
