"""The choice of the snapshot that a seed publishes: a race of two rounds, in validation.

Every snapshot plays a few episodes. At the end the best of them, the finalists, play more, and the
best mean over all of its episodes is published: successive halving (Karnin, Koren and Somekh 2013,
"Almost optimal exploration in multi-armed bandits") with one cut.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from jumping_ant.params.blocks import TrainingParams


@dataclass(frozen=True)
class Candidate:
    """A snapshot that may be published."""

    env_steps: int
    returns: tuple[float, ...]  # in validation, (episodes,)
    policy: bytes  # content of its file

    @property
    def mean_return(self) -> float:
        """Mean of its returns."""
        return float(np.mean(self.returns))


Candidates = tuple[Candidate, ...]  # the best first; of equal ones the earlier


def entered(candidates: Candidates, new: Candidate, training: TrainingParams) -> Candidates:
    """Return who may be published after a new snapshot, the last one alone if that is asked for."""
    if training.publish == "final":
        return (new,)
    best_first = sorted((*candidates, new), key=lambda one: -one.mean_return)
    return tuple(best_first[: training.finalists])


def finished(
    candidates: Candidates, play: Callable[[Sequence[bytes]], NDArray[np.float64]]
) -> Candidates:
    """Return the candidates with their returns in the final, which a single one needs not.

    `play` returns those of policies' files, (num_policies, episodes).
    """
    if len(candidates) < 2:
        return candidates
    return tuple(
        replace(one, returns=(*one.returns, *more.tolist()))
        for one, more in zip(candidates, play([one.policy for one in candidates]), strict=True)
    )


def winner(candidates: Candidates) -> Candidate:
    """Return the candidate of the best mean return, of equal ones the first."""
    return max(candidates, key=lambda one: one.mean_return)
