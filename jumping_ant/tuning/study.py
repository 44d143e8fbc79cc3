"""An Optuna study that resumes where it was killed, with the same trials.

A trial keeps its number and its record. One that was running when its process ended is found again,
with what its trained seeds returned, and finished: no trial is run twice, and none is lost. What is
drawn for a trial depends on its number and on the trials before it, not on the process. So with one
worker the trials are the same however often the study was stopped.

A study in a file is one process's at a time. In a database that several machines share, a trial is
found abandoned if its process has ended on this machine, or was silent on another one for long.
"""

import fcntl
import time
import warnings
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import optuna
from optuna.distributions import BaseDistribution
from optuna.exceptions import ExperimentalWarning, StorageInternalError
from optuna.pruners import WilcoxonPruner
from optuna.samplers import BaseSampler, RandomSampler, TPESampler
from optuna.trial import FrozenTrial, Trial, TrialState
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from jumping_ant.base import databases, process, seeding
from jumping_ant.base.errors import InputError, told

SamplerName = Literal["tpe", "random"]
OWNER, SIGN = "owner", "sign"  # of a running trial: its process, and when that was last heard of
SILENT_SECONDS = 6 * 3600.0  # after which a trial of another machine counts as abandoned
LONGEST_WAIT = 60  # for a connection, or for what another process has locked [s]
FILE = "sqlite:///"


class PerTrial(BaseSampler):
    """A sampler whose draws for a trial depend on the trial's number and the trials before it.

    Args:
        name: `tpe` for the tree-structured Parzen estimator (Bergstra et al. 2011), `random` for
            independent draws, its control.
        seed: Seed of the study.
    """

    def __init__(self, name: SamplerName, seed: int = 0) -> None:
        self._kind = {"tpe": TPESampler, "random": RandomSampler}[name]
        self._seed = seed
        self._own: BaseSampler = self._kind(seed=seed)

    def before_trial(self, study: optuna.Study, trial: FrozenTrial) -> None:
        """Start a stream of random numbers for a trial."""
        self._own = self._kind(seed=seeding.derive(self._seed, "search", trial.number, bits=32))
        self._own.before_trial(study, trial)

    def infer_relative_search_space(
        self, study: optuna.Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        """Return the parameters that are drawn together."""
        return self._own.infer_relative_search_space(study, trial)

    def sample_relative(
        self, study: optuna.Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """Draw the parameters that are drawn together.

        Optuna asks for them before it draws others. Of a trial whose process was killed meanwhile,
        others that were drawn are drawn once more, so that the rest follows in the stream.
        """
        together = self._own.sample_relative(study, trial, search_space)
        given = trial.system_attrs.get("fixed_params", {})
        for name, distribution in trial.distributions.items():
            if name not in together and name not in given:
                self._own.sample_independent(study, trial, name, distribution)
        return together

    def sample_independent(
        self,
        study: optuna.Study,
        trial: FrozenTrial,
        param_name: str,
        param_distribution: BaseDistribution,
    ) -> Any:
        """Draw another parameter."""
        return self._own.sample_independent(study, trial, param_name, param_distribution)


@contextmanager
def opened(
    storage: str,
    name: str,
    sampler: SamplerName,
    prune_level: float,
    first: Mapping[str, Any] | None,
) -> Iterator[optuna.Study]:
    """Open a study, which is created with its first trial if there is none.

    Args:
        storage: Address of the storage, as SQLAlchemy writes it: sqlite:///FILE, postgresql://...
        name: Name of the study.
        sampler: Name of the sampler.
        prune_level: Level of the test by which trials are pruned.
        first: Parameters of the first trial; None draws them as well.

    Raises:
        InputError: The storage cannot be used, or another process uses the file.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    databases.limit_waiting(LONGEST_WAIT)
    with _failures_as_input_errors(storage), _alone(storage), warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        with taking_turns(storage):
            study = optuna.create_study(
                storage=_opened(storage),
                study_name=name,
                direction="maximize",
                load_if_exists=True,
                sampler=PerTrial(sampler),
                pruner=WilcoxonPruner(p_threshold=prune_level),
            )
            if first is not None and not study.get_trials(deepcopy=False):
                study.enqueue_trial(dict(first))
        yield study


@contextmanager
def taking_turns(storage: str) -> Iterator[None]:
    """Keep processes that share a database from deciding the same thing at once.

    Two could create the tables, begin a study, begin its last trial, or take over a trial that was
    abandoned. A file has one process anyhow.
    """
    if databases.is_shared(storage):
        with databases.held(storage, "jumping-ant tunes"):
            yield
    else:
        yield


def begin(study: optuna.Study, distributions: Mapping[str, BaseDistribution]) -> Trial:
    """Return a new trial, or one that waits."""
    return _taken(study.ask(), distributions)


def abandoned(
    study: optuna.Study,
    storage: str,
    distributions: Mapping[str, BaseDistribution],
    own: Container[int] = (),
) -> list[Trial]:
    """Return the trials that were running when their process ended, by number, as this process's.

    Those that it runs already are not among them (`own`, their numbers). What had not been drawn
    for one is drawn now, and is the same.
    """
    return [
        _taken(Trial(study, frozen._trial_id), distributions)
        for frozen in study.get_trials(deepcopy=False, states=[TrialState.RUNNING])
        if frozen.number not in own and (storage.startswith(FILE) or _is_silent(frozen))
    ]


def give_sign(trial: Trial) -> None:
    """Note that this process runs a trial."""
    trial.set_user_attr(OWNER, process.this_process())
    trial.set_user_attr(SIGN, time.time())


def sign_of(trial: FrozenTrial) -> str:
    """Return where a trial runs, and when that was last heard of."""
    host = trial.user_attrs.get(OWNER, "unknown").partition(" ")[0]
    return f"trial {trial.number} on {host}, heard of {_silence(trial) / 60:.0f} minutes ago"


def _opened(storage: str) -> optuna.storages.BaseStorage:
    """Open a storage; a RuntimeError of Optuna says that the tables are of something else.

    Trainings take minutes, in which a server may restart: a connection is tried before it is used.
    """
    try:
        return optuna.storages.RDBStorage(
            storage, engine_kwargs={"pool_pre_ping": databases.is_shared(storage)}
        )
    except ImportError as error:
        raise (error.__cause__ or error) from None  # Optuna's own is from that of the driver
    except RuntimeError as error:
        raise InputError(
            f"storage: given {shown(storage)}, whose tables are not this Optuna's ({error}); "
            "allowed: a database of its own, not MLflow's"
        ) from error


def _taken(trial: Trial, distributions: Mapping[str, BaseDistribution]) -> Trial:
    """Return a trial as one of this process, with all its parameters."""
    give_sign(trial)
    for name, distribution in distributions.items():
        trial._suggest(name, distribution)  # as `Study.ask` does
    return trial


def _is_silent(trial: FrozenTrial) -> bool:
    owner = trial.user_attrs.get(OWNER, "")
    if process.is_of_this_host(owner):
        return not process.exists(owner)
    return _silence(trial) > SILENT_SECONDS


def _silence(trial: FrozenTrial) -> float:
    """Return for how long nothing was heard of a trial [s]."""
    begun = trial.datetime_start.timestamp() if trial.datetime_start else 0.0
    return time.time() - float(trial.user_attrs.get(SIGN, begun))


@contextmanager
def _alone(storage: str) -> Iterator[None]:
    """Keep other processes from a study in a file."""
    if not storage.startswith(FILE):
        yield
        return
    path = Path(storage.removeprefix(FILE))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_name(f"{path.name}.lock").open("w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(
                f"{path}: given a study that another process uses, allowed: one process; "
                "its workers run trials side by side (compute.workers)"
            ) from error
        yield


@contextmanager
def _failures_as_input_errors(storage: str) -> Iterator[None]:
    """Convert errors of a storage into one line."""
    try:
        make_url(storage)
    except (ArgumentError, ValueError) as error:
        raise InputError(
            f"storage: given {shown(storage)}, allowed: sqlite:///FILE, postgresql://USER@HOST/NAME"
        ) from error
    try:
        yield
    except ModuleNotFoundError as error:
        raise InputError(
            f"storage: its driver is not installed; run: {databases.installation(error)}"
        ) from error
    except (SQLAlchemyError, StorageInternalError) as error:
        reason = databases.without_secret(told(error.__cause__ or error), storage)
        raise InputError(f"storage: given {shown(storage)}: {reason}") from error


def shown(storage: str) -> str:
    """Return an address without user and password."""
    words = storage.replace(" ", "")  # of a password, too
    return databases.without_password(words) if "://" in words else "no address"
