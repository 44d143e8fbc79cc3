"""The training of one seed, as a worker runs it: its trainer's events, and their evaluation.

A worker touches no file. It plays the validation episodes of each snapshot, which have start states
of their own: neither training nor the held-out episodes use them.
"""

import itertools
import math
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any
from zipfile import BadZipFile

from jumping_ant.agents.events import Checkpoint, Event, Finished, Snapshot
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.params.blocks import TrainingParams
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout

# What reading a checkpoint of wrong content raises; not the memory or a file that is lacking.
WRONG_CONTENT = (ValueError, TypeError, LookupError, AttributeError, RuntimeError, BadZipFile)


@dataclass(frozen=True)
class Rejected:
    """Instead of events: the trainer cannot resume from its checkpoint."""

    reason: str


@dataclass(frozen=True)
class Report:
    """An event as a worker sends it."""

    event: Event | Rejected
    seconds: float  # of this seed's training so far, without evaluations
    returns: tuple[float, ...] = ()  # of a snapshot's evaluation, (episodes,)
    machine: dict[str, Any] | None = None  # with the last event: where the seed was trained


def run(
    job: Job[Any],
    training: TrainingParams,
    stop: threading.Event,
    seconds: float = 0.0,
    checkpoint_seconds: float = math.inf,
) -> Iterator[Report]:
    """Train one seed, and evaluate its snapshots; `stop` ends it with a last checkpoint.

    `seconds` is the training time before the checkpoint that the job resumes from.
    """
    episode_seeds = [training.evaluation_seed + i for i in range(training.evaluation_episodes)]
    started = last = time.perf_counter()
    paused = -seconds

    def is_checkpoint_due() -> bool:
        return stop.is_set() or time.perf_counter() - last >= checkpoint_seconds

    events = trainer_of(job.agent)(replace(job, is_checkpoint_due=is_checkpoint_due))
    try:
        first = next(events)
    except WRONG_CONTENT as error:
        if job.checkpoint is None:
            raise
        yield Report(Rejected(f"{type(error).__name__}: {error}"), 0.0)
        return
    for event in itertools.chain([first], events):
        now = time.perf_counter()
        report = Report(event, now - started - paused)
        if isinstance(event, Snapshot):
            policy = policy_file.parse(event.policy)
            episodes = rollout.run(job.world, policy, episode_seeds, job.num_threads)
            returns = tuple(float(episode.rewards.sum()) for episode in episodes)
            report = replace(report, returns=returns)
        elif isinstance(event, Finished):
            report = replace(report, machine=machine.describe())
        yield report
        if isinstance(event, Checkpoint):
            if stop.is_set():
                return
            last = time.perf_counter()
        paused += time.perf_counter() - now
