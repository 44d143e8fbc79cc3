"""What is tuned, and what a training of it measures.

A worker trains one seed as the pipeline does, and plays the policy that wins in validation. All
seeds, start states and validation episodes are of `TUNING_SEEDS`, which no training and no
evaluation uses; those that judge the outcome are none of those of a search.
"""

import hashlib
import json
import math
import re
import threading
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Finished, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import effective_code
from jumping_ant.base.errors import told
from jumping_ant.base.files import PROJECT_ROOT, digest, read_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.comparison.estimates import estimate_iqm
from jumping_ant.params.model import TUNING_SEEDS, Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot, rollout
from jumping_ant.sim.world import World
from jumping_ant.training import curves, model_selection, seed_run
from jumping_ant.tuning.space import Space, space_of

SEARCH = TUNING_SEEDS[:1_000]  # training seeds of trials, and their start states
VALIDATION = TUNING_SEEDS[100_000]  # the first episode of the choice among snapshots
FRESH = TUNING_SEEDS[500_000:]  # training seeds and start states that judge the outcome
LOCK = PROJECT_ROOT / "requirements.lock"  # the versions of all libraries
# Settings of a search that its trials depend on.
RULES = ("seeds", "share", "episodes", "target_return", "spread_penalty", "prune_level")
# What errors say of a learner whose numbers are no longer finite: those of the check of policies,
# torch's distributions, linear algebra, and Python.
DIVERGED = "not finite|NaN|to satisfy the constraint|LinAlgError|FloatingPointError|OverflowError"

Note = dict[str, Any]
"""Of a trained seed, as a study keeps it in JSON: `returns` of its policy from each start state and
their mean, `return`; `seconds` of training; bounds on the seconds after which validation returns
more than the target for good, `onset`. Of one that diverged, `fault` says how."""


@dataclass(frozen=True)
class SearchSettings:
    """How much is tried, and how it is judged."""

    trials: Annotated[int, Field(ge=1)] = 40  # settings that are tried, first the present ones
    seeds: Annotated[int, Field(ge=1)] = 2  # trainings of a trial
    share: Annotated[float, Field(gt=0, le=1)] = 0.4  # of the budget of steps, for each of them
    episodes: Annotated[int, Field(ge=1, le=1000)] = 12  # of a policy, the same in all trials
    target_return: float | None = None  # trials compete for the seconds to it; None: for the return
    # Times the mean distance of seeds from their median, off a trial's value.
    spread_penalty: Annotated[float, Field(ge=0)] = 0.5
    # A trial ends early if its returns would be so unlikely were it the best.
    prune_level: Annotated[float, Field(ge=0, lt=1)] = 0.05
    # Trainings with the whole budget of the best settings, and of the present ones.
    fresh_seeds: Annotated[int, Field(ge=1, le=100)] = 8


@dataclass(frozen=True)
class Task:
    """An agent in its world, what may be chosen for it, and by which parameters that is judged."""

    name: str
    params: Params
    settings: SearchSettings
    world: World
    space: Space
    demonstrations: bytes | None  # content of the file that the agent learns from

    @property
    def content(self) -> list[Any]:
        """Robot, task, validation and the agent as it is, as JSON has them."""
        blocks = (self.world.env, self.params.training, self.space.agent)
        demonstrations = hashlib.sha256(self.demonstrations or b"").hexdigest()
        return [self.world.xml, *(block.model_dump() for block in blocks), demonstrations]

    @property
    def rules(self) -> dict[str, Any]:
        """What two searches must share to be set beside each other."""
        ranges = {name: asdict(range_) for name, range_ in self.space.ranges.items()}
        fixed = {"task": short_digest(self.content), "ranges": json.loads(json.dumps(ranges))}
        return fixed | {name: getattr(self.settings, name) for name in RULES}

    def study_name(self, sampler: str) -> str:
        """Return the name of a study: that of everything which its trials depend on."""
        code = training_code(self.space.agent.algorithm, Path(seed_run.__file__))
        sources = [effective_code.read(path) for path in sorted(code)]
        versions = digest(LOCK) if LOCK.is_file() else ""
        content = [self.content, self.rules, sources, versions]
        return f"{self.name}-{sampler}-{short_digest(content)}"

    def measure(
        self, agent: AgentBlock, seed: int, starts: range, num_threads: int, stop: threading.Event
    ) -> Iterator[Note]:
        """Train a seed, play its policy, and yield the note; nothing if `stop` ended it."""
        evaluations, known = self.params.training.evaluations, self.demonstrations
        job = Job(self.world, agent, seed, evaluations, num_threads, demonstrations=known)
        try:
            yield from self._measured(job, starts, stop)
        except (ArithmeticError, ValueError, RuntimeError) as error:
            reason = told(error)
            if not re.search(DIVERGED, reason):
                raise
            yield {"fault": reason}

    def _measured(self, job: Job[Any], starts: range, stop: threading.Event) -> Iterator[Note]:
        training = self.params.training
        validation = range(VALIDATION, VALIDATION + len(training.block(0)))
        evaluations = []
        for report in seed_run.run(job, training, validation, stop):
            if isinstance(report.event, Snapshot):
                evaluations.append((report.seconds, float(np.mean(report.returns))))
        if not isinstance(report.event, Finished):
            return
        policy = policy_file.parse(model_selection.winner(report.candidates).policy)
        plays = [rollout.Play(policy, start) for start in starts]
        returns = rollout.returns(job.world, plays, job.num_threads)
        if not np.isfinite(returns).all():
            raise ValueError("returns that are not finite")
        onset = (0.0, math.inf)
        if self.settings.target_return is not None:
            seconds, means = np.array(evaluations).T
            curve = {"seconds": seconds, "evaluation_return_mean": means}
            onset = curves.onset(curve, self.settings.target_return, "seconds")
        measured = {"returns": returns.tolist(), "return": float(returns.mean())}
        yield measured | {"seconds": report.seconds, "onset": onset}

    def gain(self, note: Note) -> float:
        """Return a seed's return, or minus its seconds to the target; -infinity if it failed."""
        if "fault" in note:
            return -math.inf
        return float(note["return"] if self.settings.target_return is None else -note["onset"][1])

    def value(self, notes: Sequence[Note]) -> float | None:
        """Return the interquartile mean over seeds less a penalty for their spread.

        None if there are none or one failed. Of three seeds or fewer it is the mean. The spread is
        the mean distance from the median, as in comparisons (Brown and Forsythe 1974).
        """
        gains = np.array([self.gain(note) for note in notes])
        if not len(gains) or not np.isfinite(gains).all():
            return None
        spread = np.abs(gains - np.median(gains)).mean()
        iqm = estimate_iqm(gains, self.params.compare.confidence).value
        return float(iqm - self.settings.spread_penalty * spread)


def task_of(root: Path, params: Params, name: str, settings: SearchSettings) -> Task:
    """Return what is tuned; an InputError says that there is no such agent or what it lacks."""
    agent = params.agent(name)
    space = space_of(name, agent)
    build = robot.build if agent.robot == "edited" else robot.unedited
    demonstrations = None
    if agent.learns_from_demonstrations:
        path = Paths(root).demonstrations(agent.algorithm)
        demonstrations = read_bytes(path, f"demonstrate@{agent.algorithm}")
    world = World(build(params.robot, root), params.env)
    return Task(name, params, settings, world, space, demonstrations)


def short_digest(content: Any) -> str:
    """Return eight hexadecimal digits that stand for a content of JSON's types."""
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:8]
