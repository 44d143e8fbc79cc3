"""The cost of checkpoints: the time of one relative to the interval between them."""

import tempfile
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from benchmarks.article_ant import default_world
from benchmarks.measure import CORES, Row, row
from jumping_ant.agents.events import Checkpoint
from jumping_ant.agents.job import Job
from jumping_ant.agents.off_policy.algorithms import DQNParams
from jumping_ant.agents.sb3 import trainer
from jumping_ant.compute import jobs
from jumping_ant.params import params_file
from jumping_ant.training.checkpoints import Checkpoints, Saved

AGENT = "dqn"  # has the largest state
REPEATS = 5


def checkpoint_overhead() -> Row:
    """Compare training with checkpoints and without, at the end of the agent's budget.

    Training waits while its state is gathered and handed over. The time in which the driver then
    writes the file is counted in full too, although other cores may do it meanwhile.
    """
    settings = params_file.load()
    agent = settings.agents[AGENT]
    assert isinstance(agent, DQNParams)
    # The replay memory fills as in training, but without learning, which would take minutes.
    full = agent.model_copy(update={"learning_starts": agent.total_steps})
    seconds: dict[int, list[float]] = {seed: [] for seed in range(CORES)}
    with tempfile.TemporaryDirectory() as folder:
        checkpoints = Checkpoints(Path(folder), AGENT, "benchmark", print)
        Path(folder, ".checkpoints", AGENT, "benchmark").mkdir(parents=True)
        for seed, item in jobs.stream(lambda seed: partial(_train, full, seed), [*seconds], CORES):
            if isinstance(item, float):
                seconds[seed].append(item)
                continue
            started = time.perf_counter()
            checkpoints.save(seed, Saved(item.env_steps, 0.0, [], None, "", (), item.content))
            seconds[seed].append(time.perf_counter() - started)
    interval = settings.compute.checkpoint_seconds
    pairs = [
        (interval + writing + blocked, interval)
        for own in seconds.values()
        for writing, blocked in zip(own[::2], own[1::2], strict=True)
    ]
    return row("checkpoint_overhead", "s", pairs)


def _train(agent: DQNParams, seed: int, stop: threading.Event) -> Iterator[Checkpoint | float]:
    """Fill the replay memory, then yield checkpoints, each with the seconds that it took."""
    rounds = agent.total_steps // (agent.num_envs * agent.train_freq * agent.actions.hold)
    remaining = [rounds]
    asked = [0.0]

    def is_checkpoint_due() -> bool:
        remaining[0] -= 1
        asked[0] = time.perf_counter()
        return remaining[0] < REPEATS

    job = Job(default_world(), agent, seed, is_checkpoint_due=is_checkpoint_due)
    events = trainer.train(job)
    for event in events:
        if isinstance(event, Checkpoint):
            yield event
            yield time.perf_counter() - asked[0]
