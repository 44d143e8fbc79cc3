"""The training of one seed, as a worker runs it: its trainer's events, and their evaluation.

A worker touches no file. It plays the validation episodes of each snapshot, and in the end those of
the finalists (see `jumping_ant.training.model_selection`).
"""

import math
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents.events import Checkpoint, Event, Finished, Snapshot
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.params.blocks import TrainingParams
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import Play
from jumping_ant.training import model_selection
from jumping_ant.training.model_selection import Candidate, Candidates


@dataclass(frozen=True)
class Report:
    """An event as a worker sends it."""

    event: Event
    seconds: float  # of this seed's training so far, without evaluations
    returns: tuple[float, ...] = ()  # of a snapshot's evaluation, (episodes,)
    candidates: Candidates = ()  # with a checkpoint and the last event: who may be published
    machine: dict[str, Any] | None = None  # with the last event: where the seed was trained


def run(
    job: Job[Any],
    training: TrainingParams,
    starts: range,
    stop: threading.Event,
    seconds: float = 0.0,
    candidates: Candidates = (),
    checkpoint_seconds: float = math.inf,
) -> Iterator[Report]:
    """Train one seed, and evaluate its snapshots; `stop` ends it with a last checkpoint.

    `starts` are the seeds of the validation episodes. `seconds` of training and `candidates` are
    those before the checkpoint that it resumes from.
    """
    if not job.agent.is_baseline:  # these do without PyTorch, which takes seconds to import
        from jumping_ant.agents.kernels import use_portable_kernels

        use_portable_kernels()
    train = trainer_of(job.agent)  # its imports are no training
    started = last = time.perf_counter()
    paused = -seconds
    first = training.evaluation_episodes

    def is_checkpoint_due() -> bool:
        return stop.is_set() or time.perf_counter() - last >= checkpoint_seconds

    for event in train(replace(job, is_checkpoint_due=is_checkpoint_due)):
        now = time.perf_counter()
        report = Report(event, now - started - paused)
        if isinstance(event, Snapshot):
            (returns,) = _validate(job, starts[:first], [event.policy]).tolist()
            report = replace(report, returns=tuple(returns))
            new = Candidate(event.env_steps, report.returns, event.policy)
            candidates = model_selection.entered(candidates, new, training)
        elif isinstance(event, Checkpoint):
            report = replace(report, candidates=candidates)
        elif isinstance(event, Finished):
            final = partial(_validate, job, starts[first : first + training.finalist_episodes])
            candidates = model_selection.finished(candidates, final)
            report = replace(report, candidates=candidates, machine=machine.describe())
        yield report
        if isinstance(event, Checkpoint):
            if stop.is_set():
                return
            last = time.perf_counter()
        paused += time.perf_counter() - now


def _validate(job: Job[Any], starts: range, policies: Sequence[bytes]) -> NDArray[np.float64]:
    """Return the returns of policies in validation, (num_policies, num_starts)."""
    plays = [Play(policy, start) for policy in map(policy_file.parse, policies) for start in starts]
    return rollout.returns(job.world, plays, job.num_threads).reshape(len(policies), -1)
