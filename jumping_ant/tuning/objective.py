"""What a training of a trial measures, as a worker runs it.

A worker trains one seed as the pipeline does, publishes the policy that wins in validation, and
plays it. All seeds, start states and validation episodes are of `TUNING_SEEDS`, which no training
and no evaluation uses, and those that judge the outcome are none of those that a search uses.
"""

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jumping_ant.agents.events import Finished, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.base.errors import told
from jumping_ant.experiment import curves
from jumping_ant.experiment.models import TUNING_SEEDS
from jumping_ant.params.blocks import TrainingParams
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.training import racing, seed_run

SEARCH = TUNING_SEEDS[:1_000]  # training seeds of trials, and their start states
VALIDATION = TUNING_SEEDS[100_000]  # the first episode of the choice among snapshots
FRESH = TUNING_SEEDS[500_000:]  # training seeds and start states that judge the outcome

# What is told of a learner whose numbers are no longer finite: by the check of policies, torch's
# distributions, linear algebra, and Python. Another error, as of a lack of memory, is none of it.
DIVERGED = (
    *("not finite", "NaN", "to satisfy the constraint"),
    *("LinAlgError", "FloatingPointError", "OverflowError"),
)


@dataclass(frozen=True)
class Measured:
    """A trained seed.

    Attributes:
        returns: Of the published policy, an episode for each start state.
        seconds: Of training, without evaluations [s].
        onset: Bounds on the seconds of training after which validation returns more than the target
            for good [s]; (0, infinity) without a target.
        bests: Best return in validation so far, at each evaluation.
        is_cut: Whether it was among the worst at the last of them, and ended there.
    """

    returns: tuple[float, ...]
    seconds: float
    onset: tuple[float, float]
    bests: tuple[float, ...] = ()
    is_cut: bool = False

    @property
    def mean_return(self) -> float:
        """Mean of the returns."""
        return float(np.mean(self.returns))


@dataclass(frozen=True)
class Fault:
    """A training that diverged, and how."""

    reason: str


def validated_apart(training: TrainingParams) -> TrainingParams:
    """Return how a trial's trainings are validated: on episodes of their own."""
    return training.model_copy(update={"evaluation_seed": VALIDATION})


def measure(
    job: Job[Any],
    training: TrainingParams,
    starts: Sequence[int],
    target_return: float | None,
    floors: Sequence[float],
    stop: threading.Event,
) -> Iterator[Measured | Fault]:
    """Train a seed, play its policy from start states, and yield what was measured.

    Nothing is yielded if `stop` ended the training. It also ends at an evaluation at which the best
    return in validation so far is below the floor; then the best policy so far is measured.
    """
    try:
        measured = _measured(job, training, starts, target_return, floors, stop)
    except (ArithmeticError, ValueError, RuntimeError) as error:
        measured = Fault(told(error))
        if not any(sign in measured.reason for sign in DIVERGED):
            raise
    if measured:
        yield measured


def _measured(
    job: Job[Any],
    training: TrainingParams,
    starts: Sequence[int],
    target_return: float | None,
    floors: Sequence[float],
    stop: threading.Event,
) -> Measured | Fault | None:
    evaluations: list[tuple[float, float]] = []
    bests: list[float] = []
    best, is_cut = b"", False
    for report in seed_run.run(job, training, stop):
        if isinstance(report.event, Snapshot):
            own = float(np.mean(report.returns))
            evaluations.append((report.seconds, own))
            if not bests or own > bests[-1]:
                best = report.event.policy
            bests.append(max([own, *bests[-1:]]))
            is_cut = len(bests) <= len(floors) and bests[-1] < floors[len(bests) - 1]
            if is_cut:
                break
    if isinstance(report.event, Finished):
        best = racing.winner(report.candidates).policy
    elif not is_cut:
        return None
    policy = policy_file.parse(best)
    returns = rollout.returns(job.world, [(policy, start) for start in starts], job.num_threads)
    if not np.isfinite(returns).all():
        return Fault("returns that are not finite")
    onset = (0.0, np.inf) if target_return is None else _onset(evaluations, target_return)
    return Measured(tuple(returns.tolist()), report.seconds, onset, tuple(bests), is_cut)


def _onset(evaluations: Sequence[tuple[float, float]], target: float) -> tuple[float, float]:
    """Return bounds on when validation returns exceed a target for good [s]."""
    seconds, returns = np.array(evaluations).T
    return curves.onset({"seconds": seconds, "evaluation_return_mean": returns}, target, "seconds")
