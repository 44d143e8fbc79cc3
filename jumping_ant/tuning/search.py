"""The trials of a search: an Optuna study that any number of processes run side by side.

A trial trains its seeds one after another. After each it is compared with the best trial so far,
episode by episode: seeds and start states are the instances of Wilcoxon's signed-rank test, and a
trial that is probably worse ends there.

A running trial gives signs of life to the storage. One whose process died or was asked to stop is
queued again with what its trained seeds returned.
"""

import math
import sys
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Literal, NoReturn

import optuna
from optuna.exceptions import ExperimentalWarning, StorageInternalError
from optuna.pruners import WilcoxonPruner
from optuna.samplers import TPESampler
from optuna.storages import RDBStorage, RetryHeartbeatStaleTrialCallback, fail_stale_trials
from optuna.trial import FrozenTrial, Trial, TrialState
from sqlalchemy.exc import SQLAlchemyError

from jumping_ant.base import databases, seeding
from jumping_ant.base.errors import InputError, StoppedError, told
from jumping_ant.compute import jobs
from jumping_ant.media.style import number
from jumping_ant.tuning.space import RefusedError
from jumping_ant.tuning.task import SEARCH, Note, Task

SamplerName = Literal["tpe", "random"]
FILE = "sqlite:///"
HEARTBEAT, GRACE = 30, 120  # [s] between signs of life; of silence, after which a trial is dead
SECONDS_BETWEEN_LOOKS = 1.0
LONGEST_WAIT = 60  # [s] for a connection, or for what another process has locked
MAX_RETRIES = 10  # of settings that end their process each time
NUM_RANDOM = 10  # trials before the sampler learns; the control of a search never does
COMPLETE, PRUNED, RUNNING = TrialState.COMPLETE, TrialState.PRUNED, TrialState.RUNNING
ENDED = {COMPLETE: "complete", PRUNED: "pruned"}
BEGUN = {*ENDED, RUNNING}
SEED, REASON = "seed {:03}", "reason"  # what a trial notes: of each seed, and why it ended early


class PerTrial(TPESampler):
    """The tree-structured Parzen estimator (Bergstra et al. 2011), with a seed for each trial.

    So no process repeats another's draws. The first `num_random` trials are random.
    """

    def __init__(self, num_random: int) -> None:
        super().__init__()
        self._num_random = num_random

    def before_trial(self, study: optuna.Study, trial: FrozenTrial) -> None:
        """Start a stream of random numbers for a trial."""
        seed = seeding.derive(0, "search", trial.number, bits=32)
        super().__init__(seed=seed, n_startup_trials=self._num_random)


@contextmanager
def opened(
    storage: str, name: str, sampler: SamplerName, prune_level: float, first: Mapping[str, object]
) -> Iterator[optuna.Study]:
    """Open a study at an address of SQLAlchemy's, created with its first trial if there is none.

    A storage that cannot be used is an InputError.
    """
    _quieten()
    databases.limit_waiting(LONGEST_WAIT)
    wait = {"connect_args": {"timeout": LONGEST_WAIT}} if storage.startswith(FILE) else {}
    turns = databases.held(storage, "jumping-ant tunes") if not wait else nullcontext()
    with _failures_as_input_errors(storage, ImportError, OSError, RuntimeError, ValueError), turns:
        if wait:
            Path(storage.removeprefix(FILE)).parent.mkdir(parents=True, exist_ok=True)
        study = optuna.create_study(
            storage=RDBStorage(
                storage,
                engine_kwargs={"pool_pre_ping": True, **wait},
                heartbeat_interval=HEARTBEAT,
                grace_period=GRACE,
                heartbeat_stale_trial_callback=RetryHeartbeatStaleTrialCallback(MAX_RETRIES),
            ),
            study_name=name,
            direction="maximize",
            load_if_exists=True,
            sampler=PerTrial(sys.maxsize if sampler == "random" else NUM_RANDOM),
            pruner=WilcoxonPruner(p_threshold=prune_level),
        )
        if first and not study.get_trials(deepcopy=False):
            study.enqueue_trial(dict(first))
    with _failures_as_input_errors(storage):
        yield study


def run(
    study: optuna.Study, task: Task, workers: int, num_threads: int, say: Callable[[str], None]
) -> None:
    """Run the trials that are left, and wait for those of others; a signal is a StoppedError."""
    work = partial(trials, study, task, num_threads)
    name = "worker {}".format
    for _, line in jobs.stream(lambda _: work, range(workers), workers, say, name):
        say(line)
    if (left := task.settings.trials - len(ended(study))) > 0:
        raise StoppedError(f"the same command resumes; {left} trials are left")


def trials(
    study: optuna.Study, task: Task, num_threads: int, stop: threading.Event
) -> Iterator[str]:
    """Run trials until the study has all of them, and yield a line for each."""
    _quieten()
    while not stop.is_set():
        fail_stale_trials(study)  # which queues those of dead processes again
        states = Counter(trial.state for trial in study.get_trials(deepcopy=False))
        if sum(states[state] for state in BEGUN) < task.settings.trials:
            yield from _one(study, task, num_threads, stop)
        elif states[RUNNING]:
            stop.wait(SECONDS_BETWEEN_LOOKS)
        else:
            return


def ended(study: optuna.Study) -> list[FrozenTrial]:
    """Return the trials that are complete or ended early."""
    return study.get_trials(deepcopy=False, states=list(ENDED))


def notes_of(trial: FrozenTrial) -> list[Note]:
    """Return what was measured of a trial's seeds."""
    return [note for key, note in sorted(trial.user_attrs.items()) if key.startswith("seed ")]


def best_of(study: optuna.Study) -> FrozenTrial | None:
    """Return the complete trial of the greatest value, None if there is none."""
    return study.best_trial if study.get_trials(deepcopy=False, states=[COMPLETE]) else None


def _one(study: optuna.Study, task: Task, num_threads: int, stop: threading.Event) -> Iterator[str]:
    """Run a trial, and yield a line; queue it again if it is interrupted."""
    begun: list[int] = []

    def value(trial: Trial) -> float:
        before = study.get_trials(deepcopy=False)[: trial.number]
        if sum(other.state in BEGUN for other in before) >= task.settings.trials:
            raise StoppedError("another process began the last trial at the same time")
        begun.append(trial.number)
        return _value(task, num_threads, stop, trial)

    try:
        study.optimize(value, n_trials=1)
    except BaseException as error:
        is_taken_over = bool(begun) and not _queue(study, begun[0])
        if not isinstance(error, StoppedError) and not is_taken_over:
            raise
        return
    trial, best = study.trials[begun[0]], best_of(study)
    result = task.value(notes_of(trial))
    shown = "no value" if result is None else number(result)
    shown += f"; ended early, {trial.user_attrs.get(REASON)}" if trial.state is PRUNED else ""
    shown += f"; best {number(best.values[0])} of trial {best.number}" if best else ""
    left = max(0, task.settings.trials - len(ended(study)))
    yield f"trial {trial.number}: {shown}; {left} left"


def _value(task: Task, num_threads: int, stop: threading.Event, trial: Trial) -> float:
    """Train the seeds that a trial lacks, compare, and return its value."""
    settings, notes, noted = task.settings, list[Note](), trial.user_attrs
    task.space.suggest(trial)
    try:
        agent = task.space.agent_with(trial.params, settings.share)
    except RefusedError as error:
        _prune(trial, f"refused: {error}")
    for seed in range(settings.seeds):
        training = task.measure(agent, SEARCH[seed], SEARCH[: settings.episodes], num_threads, stop)
        note = noted.get(SEED.format(seed)) or next(training, None)
        if note is None:
            raise StoppedError("the same command resumes")
        trial.set_user_attr(SEED.format(seed), note)
        notes.append(note)
        if task.gain(note) == -math.inf:
            _prune(trial, note.get("fault", f"seed {seed + 1} never returned so much"))
        instances = note["returns"] if settings.target_return is None else [task.gain(note)]
        for step, result in enumerate(instances):
            trial.report(result, seed * settings.episodes + step)
        if seed + 1 < settings.seeds and trial.should_prune():
            _prune(trial, f"less than trial {trial.study.best_trial.number}")
    return task.value(notes) or 0.0


def _prune(trial: Trial, reason: str) -> NoReturn:
    trial.set_user_attr(REASON, reason)
    raise optuna.TrialPruned


def _queue(study: optuna.Study, place: int) -> bool:
    """Queue a failed trial again, and return whether that was not done yet."""
    histories = map(RetryHeartbeatStaleTrialCallback.retry_history, study.trials)
    trial = study.trials[place]
    if trial.state is not TrialState.FAIL or any(place in past for past in histories):
        return False
    RetryHeartbeatStaleTrialCallback(MAX_RETRIES)(study, trial)
    return True


def _quieten() -> None:
    """Keep Optuna from printing what is expected: trials that fail, and its newer parts."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    warnings.simplefilter("ignore", ExperimentalWarning)


@contextmanager
def _failures_as_input_errors(storage: str, *others: type[Exception]) -> Iterator[None]:
    """Convert errors of a storage into one line without passwords."""
    try:
        yield
    except (SQLAlchemyError, StorageInternalError, *others) as error:
        words = storage.replace(" ", "")  # of a password, too
        shown = databases.without_password(words) if "://" in words else "no address"
        reason = databases.without_secret(told(error.__cause__ or error), storage)
        allowed = "sqlite:///FILE, postgresql://USER@HOST/NAME, of a database for nothing else"
        raise InputError(f"storage: given {shown}: {reason}; allowed: {allowed}") from error
