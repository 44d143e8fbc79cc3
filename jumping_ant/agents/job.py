"""The interface of trainers: a job goes in, events come out."""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Event
from jumping_ant.sim.world import World

Settings = TypeVar("Settings", bound=AgentBlock, covariant=True)


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Job(Generic[Settings]):
    """A training of one seed of an agent.

    Attributes:
        world: The robot and the task.
        agent: The agent's block.
        seed: Seed that determines the run.
        evaluations: Number of snapshots, spread evenly over the budget.
        num_threads: Threads that step the simulations; results do not depend on it.
        demonstrations: Content of the file of demonstrations, for agents that learn from them.
        checkpoint: Checkpoint of an earlier run to resume from; None starts a new run.
        is_checkpoint_due: Whether to yield a checkpoint; called after every round of work.
    """

    world: World
    agent: Settings
    seed: int
    evaluations: int = 1
    num_threads: int = 1
    demonstrations: bytes | None = None
    checkpoint: bytes | None = None
    is_checkpoint_due: Callable[[], bool] = _never


# Trains, and yields Progress, a Snapshot for each evaluation, Checkpoints when they are due, and
# finally Finished.
Trainer = Callable[[Job[Any]], Iterator[Event]]


def trainer_of(agent: AgentBlock) -> Trainer:
    """Return the function `train` of an agent's trainer, which imports its libraries."""
    trainer: Trainer = resolve(f"{row(agent).trainer}:train")
    return trainer


def resolve(place: str) -> Any:
    """Import and return the object at `module:name`."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)
