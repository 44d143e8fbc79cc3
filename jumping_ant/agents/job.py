"""The interface of trainers: a job goes in, events come out."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any, Generic, TypeVar

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Event
from jumping_ant.sim.world import World

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
    """Return the function `train` of an agent's trainer, which imports its libraries."""
    trainer: Trainer = resolve_name(f"{row(agent).trainer}:train")
    return trainer
