"""Which snapshot a seed publishes, after two rounds of validation."""

from collections.abc import Sequence

import numpy as np
import pytest

from jumping_ant.params.blocks import TrainingParams
from jumping_ant.training import model_selection
from jumping_ant.training.model_selection import Candidate, Candidates

RULES = TrainingParams(
    evaluations=5,
    evaluation_episodes=2,
    finalists=3,
    finalist_episodes=4,
    evaluation_seed=0,
    publish="best",
)


def snapshot(number: int, *returns: float) -> Candidate:
    return Candidate(100 * number, returns, b"%d" % number)


def entered(*means: float, rules: TrainingParams = RULES) -> Candidates:
    """Return the candidates after snapshots of these means."""
    candidates: Candidates = ()
    for number, mean in enumerate(means):
        candidates = model_selection.entered(
            candidates, snapshot(number, mean - 1, mean + 1), rules
        )
    return candidates


def numbers(candidates: Candidates) -> list[int]:
    return [int(one.policy) for one in candidates]


@pytest.mark.parametrize(
    ("means", "finalists"),
    [
        ([1, 2, 3, 4, 5], [4, 3, 2]),
        ([5, 1, 4, 2, 3], [0, 2, 4]),
        ([7, 7, 7, 7, 8], [4, 0, 1]),  # of equal ones the earlier
        ([3, 9], [1, 0]),
    ],
)
def test_the_best_so_far_stay_in_the_race(means: list[float], finalists: list[int]) -> None:
    assert numbers(entered(*means)) == finalists
    final = RULES.model_copy(update={"publish": "final"})
    assert numbers(entered(*means, rules=final)) == [len(means) - 1]


def test_all_episodes_of_finalists_count() -> None:
    seen = []

    def play(policies: Sequence[bytes]) -> np.ndarray:
        seen.append(policies)
        return np.repeat([[1.0], [9.0], [4.0]], 4, axis=1)

    candidates = model_selection.finished(entered(10, 6, 8), play)
    assert seen == [[b"0", b"2", b"1"]]
    returns = [(9, 11, 1, 1, 1, 1), (7, 9, 9, 9, 9, 9), (5, 7, 4, 4, 4, 4)]
    assert [one.returns for one in candidates] == returns
    assert int(model_selection.winner(candidates).policy) == 2
    assert model_selection.winner(candidates).mean_return == pytest.approx(52 / 6)
