"""From trainers' events to files: the driver of the `train` stage.

It alone touches files while training runs. For each seed, `curve.csv` grows row by row, and
`policy.zip` appears whole when training ends. Wall-clock figures, which no two runs share, stand
apart in `results/timing/`.
"""

import csv
import importlib
import math
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from jumping_ant import compute, policies, robot, rollout
from jumping_ant.events import Event, Finished, Progress, Snapshot
from jumping_ant.files import write_bytes, write_text
from jumping_ant.params import AgentParams, EnvParams, Params, TrainingParams
from jumping_ant.progress import TrainingProgress

COLUMNS = (
    "env_steps",
    "updates",
    "episodes",
    "return_mean",
    "return_std",
    "evaluation_return_mean",
    "evaluation_return_std",
)


@dataclass(frozen=True)
class Report:
    """An event as it leaves a worker.

    Attributes:
        event: What the trainer said.
        seconds: Training seconds of this seed so far, evaluations not counted.
        returns: Returns of the evaluation of a snapshot, shape (episodes,).
    """

    event: Event
    seconds: float
    returns: tuple[float, ...] = ()


def train(root: Path, params: Params, agent_name: str) -> None:
    """Train every seed of an agent.

    Args:
        root: The project's folder; `assets/jumping_ant.xml` is read, and `models/<agent>/` and
            `results/timing/<agent>.csv` are written.
        params: All parameters.
        agent_name: Which agent.

    Raises:
        InputError: There is no such agent, or no robot yet.
    """
    agent = params.agent(agent_name)
    xml = robot.read(root)
    threads = compute.num_threads(params.compute.workers, len(params.seeds))
    jobs = {
        seed: partial(train_seed, xml, params.env, agent, params.training, seed, num_threads)
        for seed, num_threads in zip(params.seeds, threads, strict=True)
    }
    is_trivial = agent.max_env_steps == 0  # not worth starting processes
    workers = 1 if is_trivial else compute.num_workers(params.compute.workers, len(jobs))
    with ExitStack() as stack:
        display = TrainingProgress(agent_name, params.seeds, agent.max_env_steps)
        stack.enter_context(display)
        seeds = {
            seed: stack.enter_context(_SeedFiles(root / "models" / agent_name / f"seed-{seed}"))
            for seed in params.seeds
        }
        for seed, report in compute.stream(jobs, workers):
            seeds[seed].write(report)
            _show(display, seed, report)
    _write_timing(root / "results" / "timing" / f"{agent_name}.csv", seeds)


def train_seed(
    xml: str,
    env: EnvParams,
    agent: AgentParams,
    training: TrainingParams,
    seed: int,
    num_threads: int = 1,
) -> Iterator[Report]:
    """Train one seed, evaluating its snapshots on the way.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        training: How often and on which episodes snapshots are evaluated.
        seed: Determines the run.
        num_threads: Threads that step the simulations; results do not depend on it.
    """
    trainer = importlib.import_module(f"jumping_ant.agents.{agent.trainer}.trainer")
    episode_seeds = [training.evaluation_seed + i for i in range(training.evaluation_episodes)]
    started, paused = time.perf_counter(), 0.0
    for event in trainer.train(xml, env, agent, seed, training.evaluations, num_threads):
        now = time.perf_counter()
        returns: tuple[float, ...] = ()
        if isinstance(event, Snapshot):
            episodes = rollout.run(
                xml, env, policies.load(event.policy), episode_seeds, num_threads
            )
            returns = tuple(float(episode.rewards.sum()) for episode in episodes)
        yield Report(event, now - started - paused, returns)
        paused += time.perf_counter() - now


class _SeedFiles:
    """The files of one seed, written while it trains."""

    def __init__(self, folder: Path) -> None:
        self.timing: list[tuple[int, float]] = []
        self._folder = folder
        self._columns: list[str] = []
        self._file: TextIO

    def __enter__(self) -> "_SeedFiles":
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file = (self._folder / "curve.csv").open("w", newline="")
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, report: Report) -> None:
        event = report.event
        if isinstance(event, Finished):
            write_bytes(self._folder / "policy.zip", event.policy)
            return
        row = _row(event, report.returns)
        if not self._columns:
            self._columns = [*COLUMNS, *(key for key in row if key not in COLUMNS)]
            self._write_row(self._columns)
        self._write_row([_cell(row.get(column)) for column in self._columns])
        self.timing.append((event.env_steps, report.seconds))

    def _write_row(self, cells: list[str]) -> None:
        csv.writer(self._file, lineterminator="\n").writerow(cells)
        self._file.flush()  # live tracking reads along


def _row(event: Progress | Snapshot, returns: tuple[float, ...]) -> dict[str, float]:
    if isinstance(event, Snapshot):
        return {
            "env_steps": event.env_steps,
            "evaluation_return_mean": float(np.mean(returns)),
            "evaluation_return_std": float(np.std(returns)),
        }
    fields = {name: getattr(event, name) for name in COLUMNS[:5]}
    return fields | event.extra


def _cell(value: Any) -> str:
    """Show a number so that it reads back the same; nothing where there is none."""
    return "" if value is None or math.isnan(value) else repr(value)


def _show(display: TrainingProgress, seed: int, report: Report) -> None:
    event = report.event
    if isinstance(event, Finished):
        display.finish(seed, event.env_steps, report.seconds)
    elif isinstance(event, Progress):
        latest = None if math.isnan(event.return_mean) else event.return_mean
        display.update(seed, event.env_steps, report.seconds, latest)


def _write_timing(path: Path, seeds: dict[int, _SeedFiles]) -> None:
    lines = ["seed,env_steps,seconds"]
    for seed, files in seeds.items():
        lines += [f"{seed},{env_steps},{seconds:.3f}" for env_steps, seconds in files.timing]
    write_text(path, "\n".join(lines) + "\n")
