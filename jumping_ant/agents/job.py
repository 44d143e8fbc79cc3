"""What a trainer is: a job goes in, events come out."""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Event
from jumping_ant.params.blocks import EnvParams

Settings = TypeVar("Settings", bound=AgentBlock, covariant=True)


@dataclass(frozen=True)
class Job(Generic[Settings]):
    """A training of one seed of an agent.

    Attributes:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seed: Determines the run.
        evaluations: Number of snapshots, spread evenly over the budget.
        num_threads: Threads that step the simulations; results do not depend on it.
        checkpoint: Where to resume from, as an earlier run yielded it; None begins.
        is_checkpoint_due: Asked after every round of work.
    """

    xml: str
    env: EnvParams
    agent: Settings
    seed: int
    evaluations: int = 1
    num_threads: int = 1
    checkpoint: bytes | None = None
    is_checkpoint_due: Callable[[], bool] = lambda: False


class Trainer(Protocol):
    """What the package of every family has as `train` in its `trainer` module."""

    def __call__(self, job: Job[Any]) -> Iterator[Event]:
        """Train, and tell what happens.

        Yields:
            Progress, a snapshot for each evaluation, checkpoints when they are due, and at last
            Finished.
        """


def trainer_of(agent: AgentBlock) -> Trainer:
    """Return what trains an agent; its libraries are imported now."""
    trainer: Trainer = resolve(f"jumping_ant.agents.{agent.trainer}.trainer:train")
    return trainer


def resolve(place: str) -> Any:
    """Import what a place names, `module:name`."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)
