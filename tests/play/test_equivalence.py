"""The verdict on returns in the page against native ones."""

import numpy as np

from jumping_ant.experiment.models import Params
from scripts import parity

SEEDS = np.arange(8.0)


def test_returns_that_differ_little_are_equivalent(known_params: Params) -> None:
    margin = known_params.compare.margins.returns
    noise = margin / 20 * np.array([1, -1, 2, -2, 1, -1, 2, -2])
    told = parity.judge(known_params, {"same": (SEEDS + noise, SEEDS)})
    assert told == {"same": "equivalent"}


def test_returns_that_differ_always_do_not_count_as_equivalent(known_params: Params) -> None:
    margin = known_params.compare.margins.returns
    spread = margin * np.array([3, -3, 4, -4, 3, -3, 4, -4])
    found = {"less": (SEEDS - 2 * margin, SEEDS), "wild": (SEEDS + spread, SEEDS)}
    assert parity.judge(known_params, found) == {"less": "refuted", "wild": "inconclusive"}
