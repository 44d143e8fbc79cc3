"""The trials of a study, run side by side in the workers that train seeds.

A job is a seed of a trial. As soon as it is measured, the trial is compared with the best one so
far, episode by episode: seeds and start states are the instances of Wilcoxon's signed-rank test. A
trial that is probably worse ends there. The episodes of a seed are alike, so that the test is sure
too early; a low level makes up for it (docs/tuning.md has what it costs).

A seed also ends at an evaluation at which its validation is among the worst that the study has seen
there: the median stopping rule (Golovin et al. 2017, "Google Vizier", section 3.2.2), with a
quarter instead of a half, as some settings learn late.
"""

import hashlib
import json
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np
import optuna
from optuna.trial import FrozenTrial, Trial, TrialState
from tqdm import tqdm

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.job import Job
from jumping_ant.base.errors import StoppedError
from jumping_ant.comparison.estimates import estimate_iqm
from jumping_ant.compute import jobs
from jumping_ant.compute.workers import Work
from jumping_ant.looks.wording import number
from jumping_ant.params.blocks import TrainingParams, TuningParams
from jumping_ant.sim.world import World
from jumping_ant.tuning import objective
from jumping_ant.tuning import study as studies
from jumping_ant.tuning.objective import SEARCH, Fault, Measured
from jumping_ant.tuning.space import RefusedError, Space

COMPLETE, PRUNED = TrialState.COMPLETE, TrialState.PRUNED
# What a trial notes: of each seed, whether one diverged, and why it ended early.
MEASURED, DIVERGED, REASON = "seed {}", "diverged", "reason"
CONFIDENCE = 0.95  # of an interval that nobody reads
WORST = 0.25  # share of the seeds that end at an evaluation
FEWEST = 8  # seeds that got to an evaluation, before any ends there
WARM_UP = 0.25  # share of the evaluations, the first ones, at which none ends
ROUNDS = 4  # at least so many trials follow one another, so that later ones learn from earlier ones

Key = tuple[int, int]
"""A trial's number, and which of its seeds."""


@dataclass(frozen=True)
class Task:
    """What is tuned, and how.

    Attributes:
        name: The agent's name.
        world: Its robot and task.
        space: The agent as it is, and what may be chosen.
        training: How trainings are validated.
        tuning: How trials are run and judged.
        demonstrations: Content of the file that the agent learns from, if it needs one.
    """

    name: str
    world: World
    space: Space
    training: TrainingParams
    tuning: TuningParams
    demonstrations: bytes | None = None

    @property
    def content(self) -> list[Any]:
        """What its trials depend on, but their settings and rules, as JSON has it."""
        blocks = (self.world.env, self.training, self.space.agent)
        return [
            self.world.xml,
            *(block.model_dump() for block in blocks),
            hashlib.sha256(self.demonstrations or b"").hexdigest(),
        ]

    @property
    def digest(self) -> str:
        """A name of robot, task, validation and the agent as it is."""
        return hashlib.sha256(json.dumps(self.content).encode()).hexdigest()[:8]

    def work(
        self,
        agent: AgentBlock,
        seed: int,
        starts: range,
        num_threads: int,
        floors: Sequence[float] = (),
    ) -> Work:
        """Return what a worker runs to train a seed and to measure it from start states.

        The training ends at an evaluation at which its best return so far is below the floor.
        """
        job = Job(
            self.world,
            agent,
            seed,
            evaluations=self.training.evaluations,
            num_threads=num_threads,
            demonstrations=self.demonstrations,
        )
        training, target = objective.validated_apart(self.training), self.tuning.target_return
        return partial(objective.measure, job, training, starts, target, floors)


@dataclass
class Search:
    """The jobs of a study, in the order in which workers should take them.

    Attributes:
        study: The study.
        storage: Its address.
        task: What is tuned.
        num_threads: Threads of a job.
        say: Gets a line for each trial.
    """

    study: optuna.Study
    storage: str
    task: Task
    num_threads: int = 1
    say: Callable[[str], None] = print
    _trials: dict[int, Trial] = field(default_factory=dict)  # those of this process that run
    _idle: deque[int] = field(default_factory=deque)  # those of them whose next seed may start
    _num_ended: int = 0
    _started: float = field(default_factory=time.monotonic)

    def __post_init__(self) -> None:
        self._take_over()

    def __iter__(self) -> "Search":
        return self

    def __next__(self) -> Key:
        """Return the next seed of a trial that runs, else the first of a new one."""
        while not self._idle:
            with studies.taking_turns(self.storage):
                is_last = self._num_trials() >= self.task.tuning.trials
                new = None if is_last else studies.begin(self.study, self.task.space.distributions)
            if new:
                self._open(new)
            elif not self._take_over():
                raise StopIteration
        chosen = self._idle.popleft()
        return chosen, len(seeds_of(self._trials[chosen]))

    def work(self, key: Key) -> Work:
        """Return the job of a trial's seed."""
        trial, seed = self._trials[key[0]], key[1]
        agent = self.task.space.agent_with(trial.params, self.task.tuning.share)
        starts = SEARCH[: self.task.tuning.episodes]
        return self.task.work(agent, SEARCH[seed], starts, self.num_threads, self._floors())

    def take(self, key: Key, found: Measured | Fault) -> None:
        """Note what a job has found, and end its trial or let it continue."""
        trial, tuning = self._trials[key[0]], self.task.tuning
        studies.give_sign(trial)
        if isinstance(found, Fault):
            trial.set_user_attr(DIVERGED, True)
            return self._end(trial, found.reason)
        for step, result in enumerate(self._instances(found)):
            trial.report(result, key[1] * tuning.episodes + step)
        note = asdict(found) | {"return": found.mean_return}
        del note["returns"]  # the reports have them
        trial.set_user_attr(MEASURED.format(key[1]), note)
        self._continue(trial)

    @property
    def num_left(self) -> int:
        """Number of trials that are to begin, or to be ended by this process."""
        return max(0, self.task.tuning.trials - self._num_trials()) + len(self._trials)

    def _instances(self, found: Measured) -> tuple[float, ...]:
        """Return what is compared with the same of the best trial."""
        return found.returns if self.task.tuning.target_return is None else (-found.onset[1],)

    def _num_trials(self) -> int:
        states = [state for state in TrialState if state is not TrialState.WAITING]
        return len(self.study.get_trials(deepcopy=False, states=states))

    def _take_over(self) -> bool:
        """Open the trials whose process has ended; return whether there are any."""
        with studies.taking_turns(self.storage):
            distributions = self.task.space.distributions
            found = studies.abandoned(self.study, self.storage, distributions, self._trials)
        for trial in found:
            self.say(f"trial {trial.number} resumes at seed {len(seeds_of(trial)) + 1}")
            self._open(trial)
        return bool(found)

    def _open(self, trial: Trial) -> None:
        """Let a trial's next seed start, if there can be one."""
        self._trials[trial.number] = trial
        try:
            self.task.space.agent_with(trial.params, self.task.tuning.share)
        except RefusedError as error:
            return self._end(trial, f"refused: {error}")
        self._continue(trial)

    def _continue(self, trial: Trial) -> None:
        """Let a trial's next seed start, or end the trial by what its seeds have measured."""
        seeds, tuning = seeds_of(trial), self.task.tuning
        if reason := trial.user_attrs.get(REASON):  # the process was killed as it ended it
            return self._end(trial, reason)
        if seeds and seeds[-1]["is_cut"]:
            evaluation = f"evaluation {len(seeds[-1]['bests'])} of {self.task.training.evaluations}"
            return self._end(trial, f"seed {len(seeds)} was among the worst at {evaluation}")
        if seeds and tuning.target_return is not None and seeds[-1]["onset"][1] == math.inf:
            return self._end(trial, f"seed {len(seeds)} never returned {tuning.target_return:g}")
        if len(seeds) == tuning.seeds:
            return self._end(trial)
        if seeds and trial.should_prune():
            return self._end(trial, f"less than trial {self.study.best_trial.number}")
        self._idle.append(trial.number)

    def _floors(self) -> list[float]:
        """Return the return in validation below which a seed ends, for each evaluation.

        There are none where trials compete for seconds: the best of these are early, not high.
        """
        if self.task.tuning.target_return is not None:
            return []
        trials = self.study.get_trials(deepcopy=False, states=[COMPLETE, PRUNED])
        courses = [seed["bests"] for trial in trials for seed in seeds_of(trial)]
        count = self.task.training.evaluations
        floors = []
        for place in range(count):
            there = [bests[place] for bests in courses if place < len(bests)]
            is_judged = place >= WARM_UP * count and len(there) >= FEWEST
            floors.append(float(np.quantile(there, WORST)) if is_judged else -math.inf)
        return floors

    def _end(self, trial: Trial, reason: str = "") -> None:
        """End a trial, early if there is a reason, and tell.

        The sampler ranks those that ended early by their last step, and then by what was reported
        there: so at one step for all of them that is their value, not their last episode's return.
        """
        tuning = self.task.tuning
        own = value_of(trial, tuning)
        if reason:
            trial.set_user_attr(REASON, reason)
            trial.report(math.nan if own is None else own, tuning.seeds * tuning.episodes)
            self.study.tell(trial, state=PRUNED)
        else:
            self.study.tell(trial, own)
        del self._trials[trial.number]
        self._num_ended += 1
        self.say(self._line(trial.number, own, reason))

    def _line(self, ended: int, own: float | None, reason: str) -> str:
        best, own_value = best_of(self.study), "no value" if own is None else number(own)
        left = self.num_left
        seconds = left * (time.monotonic() - self._started) / self._num_ended
        parts = [
            f"trial {ended}: {own_value}",
            *([f"ended early, {reason}"] if reason else []),
            f"best {number(best.values[0])} of trial {best.number}"
            if best
            else "none complete yet",
            f"{left} left, {tqdm.format_interval(seconds)}",
        ]
        return "; ".join(parts)


def run(search: Search, workers: int) -> None:
    """Run the trials that are left.

    Raises:
        StoppedError: A signal asked for a stop.
        WorkerError: The workers of a seed died repeatedly.
    """
    name = "trial {0[0]}, seed {0[1]}".format
    for key, found in jobs.stream(search.work, search, workers, search.say, name):
        search.take(key, found)
    if search.num_left:
        raise StoppedError(f"the same command resumes; {search.num_left} trials are left")
    if elsewhere := search.study.get_trials(deepcopy=False, states=[TrialState.RUNNING]):
        signs = "; ".join(map(studies.sign_of, elsewhere))
        raise StoppedError(
            f"{len(elsewhere)} trials run elsewhere ({signs}); "
            "the same command resumes when they end"
        )


def num_workers(requested: int, trials: int) -> int:
    """Return how many trials run at a time."""
    return jobs.num_workers(requested, max(1, trials // ROUNDS))


def seeds_of(trial: Trial | FrozenTrial) -> list[dict[str, Any]]:
    """Return what was measured of a trial's seeds, those that are trained."""
    found: list[dict[str, Any]] = []
    while own := trial.user_attrs.get(MEASURED.format(len(found))):
        found.append(own)
    return found


def value_of(trial: Trial | FrozenTrial, tuning: TuningParams) -> float | None:
    """Return a trial's value by its seeds so far, None if there is none or one diverged."""
    if not (seeds := seeds_of(trial)) or DIVERGED in trial.user_attrs:
        return None
    is_timed = tuning.target_return is not None
    of_seeds = [-own["onset"][1] if is_timed else own["return"] for own in seeds]
    is_finite = all(map(math.isfinite, of_seeds))
    return value(of_seeds, tuning.spread_penalty) if is_finite else None


def value(of_seeds: Sequence[float], spread_penalty: float) -> float:
    """Return the interquartile mean over seeds, less a penalty for their spread.

    Of three seeds or fewer that is the mean. The spread is the mean distance from the median, as in
    comparisons (Brown and Forsythe 1974). More is better: seconds count negative.
    """
    sample = np.array(of_seeds)
    spread = np.abs(sample - np.median(sample)).mean()
    return float(estimate_iqm(sample, CONFIDENCE).value - spread_penalty * spread)


def best_of(study: optuna.Study) -> FrozenTrial | None:
    """Return the complete trial of the greatest value, None if there is none."""
    is_any = study.get_trials(deepcopy=False, states=[COMPLETE])
    return study.best_trial if is_any else None
