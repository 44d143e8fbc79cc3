"""The interface of trainers: a job goes in, events come out."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pkgutil import resolve_name
from typing import Any, Generic, TypeVar

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Event
from jumping_ant.base.errors import InputError, told
from jumping_ant.sim.world import World

NO_MEMORY = "can't allocate memory"  # PyTorch's words
# Settings that memory grows with.
SIZES = {
    *("batch_size", "buffer_size", "n_steps", "num_envs", "net_arch", "n_quantiles", "n_critics"),
    *("population_size", "episodes", "episode_steps", "total_steps"),
}
Settings = TypeVar("Settings", bound=AgentBlock, covariant=True)


@dataclass(frozen=True)
class Job(Generic[Settings]):
    """A training of one seed of an agent."""

    world: World
    agent: Settings
    seed: int  # that determines the run
    evaluations: int = 1  # number of snapshots, spread evenly over the budget
    num_threads: int = 1  # that step the simulations; results do not depend on it
    demonstrations: bytes | None = None  # content of their file, for agents that learn from them
    checkpoint: bytes | None = None  # of an earlier run to resume from; None starts a new run
    is_checkpoint_due: Callable[[], bool] = bool  # False; called after every round of work


# Trains, and yields Progress, a Snapshot for each evaluation, Checkpoints when they are due, and
# finally Finished.
Trainer = Callable[[Job[Any]], Iterator[Event]]


def trainer_of(agent: AgentBlock) -> Trainer:
    """Return the function `train` of an agent's trainer, which imports its libraries.

    It raises an InputError if a checkpoint holds something else, or settings, which it names, need
    more memory than there is.
    """
    return partial(_trained, resolve_name(f"{row(agent).trainer}:train"))


def _trained(train: Trainer, job: Job[Any]) -> Iterator[Event]:
    has_begun = not job.checkpoint
    try:
        for event in train(job):
            has_begun = True
            yield event
    except Exception as error:
        if not isinstance(error, MemoryError) and NO_MEMORY not in str(error):
            if has_begun or isinstance(error, InputError | OSError):
                raise
            raise InputError(
                f"seed {job.seed}: given a checkpoint that it cannot resume from ({told(error)}), "
                "allowed: its own; remove the agent's folder in .checkpoints"
            ) from error
        settings = {name: value for name, value in job.agent if name in SIZES}
        given = ", ".join(f"{name} {value}" for name, value in settings.items())
        raise InputError(
            f"{job.agent.algorithm}: given {given}, which need more memory than there is; allowed: "
            "less"
        ) from error
