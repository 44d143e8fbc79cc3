"""The driver of the `train` stage, which writes trainers' events to files.

Only the driver accesses files while training runs. For each seed, `curve.csv` grows row by row.
When training ends, `policy.zip` is written in one piece: the snapshot that did best in validation,
or the last policy, as `training.publish` specifies. `final.zip` is always the last policy, and
`machine.json` describes the machine that both were trained on.

Validation episodes have their own start states, which neither training nor the held-out episodes of
`jumping_ant.judging.evaluation` use, and held-out episodes are never used for selection.

Wall-clock times, which differ in every run, are kept separately in `timing.csv`. Checkpoints let a
killed run resume where it stopped (see `jumping_ant.training.checkpoints`); the resulting files are
the same.
"""

import hashlib
import json
import math
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import imports, machine
from jumping_ant.base.errors import StoppedError
from jumping_ant.base.files import write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths, SeedPaths
from jumping_ant.experiment.models import Params
from jumping_ant.params.blocks import EnvParams, TrainingParams
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot, rollout
from jumping_ant.training import compute
from jumping_ant.training.checkpoints import Checkpoints, Saved
from jumping_ant.training.progress import TrainingProgress

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
    """An event as a worker sends it.

    Attributes:
        event: The trainer's event.
        seconds: Training seconds of this seed so far, excluding evaluations.
        returns: Returns of the evaluation of a snapshot, shape (episodes,).
        machine: With the last event, the machine that the seed was trained on.
    """

    event: Event
    seconds: float
    returns: tuple[float, ...] = ()
    machine: dict[str, Any] | None = None


def train(root: Path, params: Params, agent_name: str) -> None:
    """Train every seed of an agent, each from its last checkpoint.

    Args:
        root: The project's folder; a robot in `assets/` is read, and `models/<agent>/` and the
            agent's `timing.csv` are written.
        params: All parameters.
        agent_name: Which agent.

    Raises:
        InputError: There is no such agent, or no robot yet.
        WorkerError: The workers of one seed died repeatedly.
        StoppedError: A signal asked training to stop; another call resumes from there.
        OSError: A file cannot be written, as on a full disk; existing files are unchanged.
    """
    agent = params.agent(agent_name)
    xml = robot.read(root, agent.robot)
    with ExitStack() as stack:
        display = TrainingProgress(agent_name, params.seeds, agent.max_env_steps)
        stack.enter_context(display)
        key = dependencies(xml, params, agent)
        checkpoints = Checkpoints(root, agent_name, key, display.say)
        stack.enter_context(checkpoints.opened(params.seeds))
        paths = Paths(root).agent(agent_name)
        seeds = {
            seed: stack.enter_context(
                _Seed(
                    seed,
                    paths.seed(seed),
                    checkpoints,
                    display,
                    params.training.publish,
                )
            )
            for seed in params.seeds
        }
        untrained = [number for number, seed in seeds.items() if not seed.is_finished]
        threads = compute.num_threads(params.compute.workers, len(untrained))
        num_threads = dict(zip(untrained, threads, strict=True))

        def start(number: int) -> compute.Job:
            return partial(
                train_seed,
                xml,
                params.env,
                agent,
                params.training,
                number,
                num_threads=num_threads[number],
                saved=seeds[number].start(),
                checkpoint_seconds=params.compute.checkpoint_seconds,
            )

        is_trivial = agent.max_env_steps == 0  # not worth starting processes
        workers = 1 if is_trivial else compute.num_workers(params.compute.workers, len(untrained))
        for number, report in compute.stream(
            start, untrained, workers, display.say, "seed {}".format
        ):
            seeds[number].write(report)
        if unfinished := [seed for seed in seeds.values() if not seed.is_finished]:
            places = ", ".join(f"seed {seed.number} at {seed.saved_steps:,}" for seed in unfinished)
            raise StoppedError(f"{agent_name} is not trained yet; the next run resumes: {places}")
        _write_timing(paths.timing, seeds)


def train_seed(
    xml: str,
    env: EnvParams,
    agent: AgentBlock,
    training: TrainingParams,
    seed: int,
    stop: threading.Event,
    num_threads: int = 1,
    saved: Saved | None = None,
    checkpoint_seconds: float = math.inf,
) -> Iterator[Report]:
    """Train one seed, and evaluate its snapshots.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        training: How often and on which episodes snapshots are evaluated.
        seed: Seed that determines the run.
        stop: Once it is set, training ends with a last checkpoint.
        num_threads: Threads that step the simulations; results do not depend on it.
        saved: State to resume from.
        checkpoint_seconds: Interval between checkpoints [s].
    """
    episode_seeds = [training.evaluation_seed + i for i in range(training.evaluation_episodes)]
    started = last = time.perf_counter()
    paused = -saved.seconds if saved else 0.0

    def is_checkpoint_due() -> bool:
        return stop.is_set() or time.perf_counter() - last >= checkpoint_seconds

    job = Job(
        xml,
        env,
        agent,
        seed,
        training.evaluations,
        num_threads,
        saved.content if saved else None,
        is_checkpoint_due,
    )
    for event in trainer_of(agent)(job):
        now = time.perf_counter()
        report = Report(event, now - started - paused)
        if isinstance(event, Snapshot):
            policy = policy_file.parse(event.policy)
            episodes = rollout.run(xml, env, policy, episode_seeds, num_threads)
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


def dependencies(xml: str, params: Params, agent: AgentBlock) -> str:
    """Return a digest of everything that the output files of an agent's seeds depend on.

    It covers the robot, the parameters, the code of training and of the agent's trainer, and the
    machine with its versions.

    Args:
        xml: The robot as MJCF text.
        params: All parameters; only the task and the evaluation of snapshots are included.
        agent: The agent's block.
    """
    families = Path(__file__).parents[1] / "agents"
    own = families / agent.trainer
    files = imports.closure(Path(__file__), own / "trainer.py") | set(own.rglob("*.py"))
    code = [file for file in sorted(files) if _is_of(file, own, families)]
    content = {
        "robot": xml,
        "params": [block.model_dump() for block in (params.env, params.training, agent)],
        "code": [path.read_text() for path in code],
        "machine": machine.describe(),
    }
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def _is_of(file: Path, own: Path, families: Path) -> bool:
    """Return whether a file belongs to the agent's own family, or to no family of agents."""
    return file.is_relative_to(own) or file.parent == families or families not in file.parents


class _Seed:
    """The files and the training progress of one seed."""

    def __init__(
        self,
        number: int,
        paths: SeedPaths,
        checkpoints: Checkpoints,
        display: TrainingProgress,
        publish: Literal["best", "final"],
    ) -> None:
        self.number = number
        self.timing: list[tuple[int, float]] = []
        self.is_finished = False
        self.saved_steps = 0
        self._paths = paths
        self._checkpoints = checkpoints
        self._display = display
        self._publish = publish
        self._curve = ""
        self._best_return: float | None = None
        self._best = b""
        self._file: TextIO

    def __enter__(self) -> "_Seed":
        self._paths.folder.mkdir(parents=True, exist_ok=True)
        # DVC clears the folder; if it did not, no older policy may remain beside the new curve.
        for policy in (self._paths.policy, self._paths.final_policy):
            policy.unlink(missing_ok=True)
        self._file = self._paths.curve.open("w", newline="")
        if saved := self._checkpoints.finished(self.number):
            self._display.say(f"seed {self.number}: trained before, {saved.env_steps:,} steps")
            self._resume_from(saved)
            self._finish(saved)
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def start(self) -> Saved | None:
        """Return the state to resume from, None for a fresh start, and restore the files."""
        saved = self._checkpoints.load(self.number)
        if saved:
            self._display.say(f"seed {self.number}: resumes from {saved.env_steps:,} steps")
        self._resume_from(saved)
        return saved

    def write(self, report: Report) -> None:
        """Record an event."""
        event = report.event
        if isinstance(event, Checkpoint):
            self._checkpoints.save(self.number, self._saved(report, event.content))
            self.saved_steps = event.env_steps
        elif isinstance(event, Finished):
            saved = self._saved(report, event.policy)
            self._checkpoints.finish(self.number, saved)
            self._finish(saved)
            self._display.finish(self.number, event.env_steps, report.seconds)
        else:
            self._write_row(_row(event, report.returns))
            if isinstance(event, Snapshot):
                self._take_if_best(event.policy, float(np.mean(report.returns)))
            self.timing.append((event.env_steps, report.seconds))
            if isinstance(event, Progress):
                latest = None if math.isnan(event.return_mean) else event.return_mean
                self._display.update(self.number, event.env_steps, report.seconds, latest)

    def _saved(self, report: Report, content: bytes) -> Saved:
        return Saved(
            env_steps=report.event.env_steps,
            seconds=report.seconds,
            timing=self.timing,
            machine=report.machine,
            curve=self._curve,
            best_return=self._best_return,
            best=self._best,
            content=content,
        )

    def _take_if_best(self, policy: bytes, mean_return: float) -> None:
        if self._best_return is None or mean_return > self._best_return:
            self._best_return, self._best = mean_return, policy

    def _resume_from(self, saved: Saved | None) -> None:
        self.timing = list(saved.timing) if saved else []
        self.saved_steps = saved.env_steps if saved else 0
        self._best_return = saved.best_return if saved else None
        self._best = saved.best if saved else b""
        self._curve = ""
        self._file.seek(0)
        self._file.truncate()
        self._write(saved.curve if saved else "")

    def _finish(self, saved: Saved) -> None:
        write_json(self._paths.machine, saved.machine)
        published = saved.best if self._publish == "best" and saved.best else saved.content
        write_bytes(self._paths.final_policy, saved.content)
        write_bytes(self._paths.policy, published)
        self.is_finished = True

    def _write_row(self, row: dict[str, float]) -> None:
        if not self._curve:
            columns = [*COLUMNS, *(key for key in row if key not in COLUMNS)]
            self._write(",".join(columns) + "\n")
        columns = self._curve.partition("\n")[0].split(",")
        self._write(",".join(_cell(row.get(column)) for column in columns) + "\n")

    def _write(self, text: str) -> None:
        self._curve += text
        self._file.write(text)
        self._file.flush()  # live tracking reads the file


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
    """Format a number so that it reads back the same; empty for None and NaN."""
    return "" if value is None or math.isnan(value) else repr(value)


def _write_timing(path: Path, seeds: dict[int, _Seed]) -> None:
    lines = ["seed,env_steps,seconds"]
    for number, seed in seeds.items():
        lines += [f"{number},{env_steps},{seconds:.3f}" for env_steps, seconds in seed.timing]
    write_text(path, "\n".join(lines) + "\n")
