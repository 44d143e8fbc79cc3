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
import itertools
import json
import math
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TextIO
from zipfile import BadZipFile

import numpy as np

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.code import code_of
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.base.errors import InputError, StoppedError
from jumping_ant.base.files import read_bytes, to_json, write_all, write_text
from jumping_ant.base.paths import Paths, SeedPaths
from jumping_ant.experiment.models import Params
from jumping_ant.params.blocks import EnvParams, TrainingParams
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot, rollout
from jumping_ant.training import cluster, compute, curves, memory
from jumping_ant.training.checkpoints import Checkpoints, Saved
from jumping_ant.training.curves import COLUMNS
from jumping_ant.training.forced import is_forced
from jumping_ant.training.progress import TrainingProgress
from jumping_ant.training.workers import Work

# What reading a checkpoint of wrong content raises; not the memory or a file that is lacking.
WRONG_CONTENT = (ValueError, TypeError, LookupError, AttributeError, RuntimeError, BadZipFile)


@dataclass(frozen=True)
class Rejected:
    """Instead of events: the trainer cannot resume from its checkpoint.

    Attributes:
        reason: What is wrong with it.
    """

    reason: str


@dataclass(frozen=True)
class Report:
    """An event as a worker sends it.

    Attributes:
        event: The trainer's event.
        seconds: Training seconds of this seed so far, excluding evaluations.
        returns: Returns of the evaluation of a snapshot, shape (episodes,).
        machine: With the last event, the machine that the seed was trained on.
    """

    event: Event | Rejected
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
        InputError: There is no such agent, no robot yet, or too little memory.
        WorkerError: The workers of one seed died repeatedly.
        StoppedError: A signal asked training to stop; another call resumes from there.
        OSError: A file cannot be written, as on a full disk; another call resumes from the last
            checkpoint.
    """
    agent = params.agent(agent_name)
    xml = robot.read(root, agent.robot)
    demonstrations = _demonstrations(root, agent)
    with ExitStack() as stack:
        display = TrainingProgress(agent_name, params.seeds, agent.max_env_steps)
        stack.enter_context(display)
        key = dependencies(xml, params, agent, demonstrations)
        checkpoints = Checkpoints(root, agent_name, key, display.say)
        stack.enter_context(checkpoints.opened(params.seeds))
        if is_forced():
            for seed in params.seeds:
                checkpoints.forget(seed)
        paths = Paths(root).agent(agent_name)
        seeds = {
            seed: stack.enter_context(
                _Seed(
                    agent_name,
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
        is_trivial = agent.max_env_steps == 0  # not worth starting processes
        workers = 1 if is_trivial else compute.num_workers(params.compute.workers, len(untrained))
        if untrained and not is_trivial and not cluster.address():
            memory.check(xml, agent_name, agent, min(workers, len(untrained)), display.say)
        while untrained:  # once, unless a checkpoint is rejected
            threads = compute.num_threads(params.compute.workers, len(untrained))
            num_threads = dict(zip(untrained, threads, strict=True))

            def start(number: int, num_threads: dict[int, int] = num_threads) -> Work:
                return partial(
                    train_seed,
                    xml,
                    params.env,
                    agent,
                    params.training,
                    number,
                    num_threads=num_threads[number],
                    demonstrations=demonstrations,
                    saved=seeds[number].start(),
                    checkpoint_seconds=params.compute.checkpoint_seconds,
                )

            rejected = []
            for number, report in compute.stream(
                start, untrained, workers, display.say, "seed {}".format
            ):
                if not seeds[number].take(report):
                    rejected.append(number)
            untrained = rejected
        if unfinished := [seed for seed in seeds.values() if not seed.is_finished]:
            places = ", ".join(f"seed {seed.number} at {seed.saved_steps:,}" for seed in unfinished)
            raise StoppedError(f"{agent_name} is not trained yet; the next run resumes: {places}")
        timing = {number: seed.timing for number, seed in seeds.items()}
        write_text(paths.timing, _timing_table(agent_name, timing))


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
    demonstrations: bytes | None = None,
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
        demonstrations: What the agent learns from, if it learns from demonstrations.
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
        demonstrations,
        saved.content if saved else None,
        is_checkpoint_due,
    )
    events = trainer_of(agent)(job)
    try:
        first = next(events)
    except WRONG_CONTENT as error:
        if saved is None:
            raise
        yield Report(Rejected(f"{type(error).__name__}: {error}"), 0.0)
        return
    for event in itertools.chain([first], events):
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


def dependencies(
    xml: str, params: Params, agent: AgentBlock, demonstrations: bytes | None = None
) -> str:
    """Return a digest of everything that the output files of an agent's seeds depend on.

    It covers the robot, the parameters, demonstrations, the code of training and of the agent's
    trainer, and the machine with its versions.

    Args:
        xml: The robot as MJCF text.
        params: All parameters; only the task and the evaluation of snapshots are included.
        agent: The agent's block.
        demonstrations: What the agent learns from, if it learns from demonstrations.
    """
    code = sorted(code_of(agent.trainer, Path(__file__)))
    content = {
        "robot": xml,
        "params": [block.model_dump() for block in (params.env, params.training, agent)],
        "code": [path.read_text(encoding="utf-8") for path in code],
        "machine": machine.describe(),
    }
    if demonstrations is not None:
        content["demonstrations"] = hashlib.sha256(demonstrations).hexdigest()
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def _demonstrations(root: Path, agent: AgentBlock) -> bytes | None:
    """Return what an agent learns from, if it learns from demonstrations."""
    if not agent.learns_from_demonstrations:
        return None
    return read_bytes(Paths(root).demonstrations(agent.trainer), f"demonstrate@{agent.trainer}")


class _Seed:
    """The files and the training progress of one seed."""

    def __init__(
        self,
        agent: str,
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
        self._owner = curves.owner(agent, number)
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
        # DVC clears the folder; if it did not, no older policy may remain beside the new curve, and
        # what may be a link into DVC's cache is not written through.
        for path in (self._paths.policy, self._paths.final_policy, self._paths.curve):
            path.unlink(missing_ok=True)
        self._file = self._paths.curve.open("x", newline="", encoding="utf-8")
        if saved := self._trained_before():
            self._display.say(f"seed {self.number}: trained before, {saved.env_steps:,} steps")
            self._resume_from(saved)
            self._finish(saved)
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _trained_before(self) -> Saved | None:
        saved = self._checkpoints.finished(self.number)
        try:
            for policy in (saved.content, saved.best) if saved else ():
                if policy:
                    policy_file.parse(policy)
        except InputError as error:
            self._display.say(f"seed {self.number}: trained before, but not used ({error})")
            self._checkpoints.forget(self.number)
            return None
        return saved

    def start(self) -> Saved | None:
        """Return the state to resume from, None for a fresh start, and restore the files."""
        saved = self._checkpoints.load(self.number)
        if saved:
            self._display.say(f"seed {self.number}: resumes from {saved.env_steps:,} steps")
        self._resume_from(saved)
        return saved

    def take(self, report: Report) -> bool:
        """Record an event; return False if the seed must be started again."""
        event = report.event
        if isinstance(event, Rejected):
            self._checkpoints.reject(self.number, event.reason)
            return False
        if isinstance(event, Checkpoint):
            self._checkpoints.save(self.number, self._saved(report, event.env_steps, event.content))
            self.saved_steps = event.env_steps
        elif isinstance(event, Finished):
            saved = self._saved(report, event.env_steps, event.policy)
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
        return True

    def _saved(self, report: Report, env_steps: int, content: bytes) -> Saved:
        return Saved(
            env_steps=env_steps,
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
        published = saved.best if self._publish == "best" and saved.best else saved.content
        write_all(
            {
                self._paths.machine: to_json(saved.machine),
                self._paths.final_policy: policy_file.owned(saved.content, self._paths.owner),
                self._paths.policy: policy_file.owned(published, self._paths.owner),
            }
        )
        self.is_finished = True

    def _write_row(self, row: dict[str, float]) -> None:
        if not self._curve:
            others = [key for key in row if key not in COLUMNS]
            self._write(",".join([*self._owner, *COLUMNS, *others]) + "\n")
        columns = self._curve.partition("\n")[0].split(",")[len(self._owner) :]
        cells = [*map(str, self._owner.values()), *(_cell(row.get(name)) for name in columns)]
        self._write(",".join(cells) + "\n")

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
    fields = {name: getattr(event, name) for name in COLUMNS if hasattr(event, name)}
    return fields | event.extra


def _cell(value: Any) -> str:
    """Format a number so that it reads back the same; empty for none, and for no finite one."""
    return "" if value is None or not math.isfinite(value) else repr(value)


def _timing_table(agent: str, timing: Mapping[int, Sequence[tuple[int, float]]]) -> str:
    """Return the content of `timing.csv`, from control steps and seconds by seed."""
    lines = [",".join(["agent", *curves.TIMING_COLUMNS])]
    for number, rows in timing.items():
        lines += [f"{agent},{number},{env_steps},{seconds:.3f}" for env_steps, seconds in rows]
    return "\n".join(lines) + "\n"
