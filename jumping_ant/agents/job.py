"""The interface of trainers: a job goes in, events come out."""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Event
from jumping_ant.compute.parts import Spread
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
        spread: What puts shares of a population on other machines; None keeps them in threads.
    """

    world: World
    agent: Settings
    seed: int
    evaluations: int = 1
    num_threads: int = 1
    demonstrations: bytes | None = None
    checkpoint: bytes | None = None
    is_checkpoint_due: Callable[[], bool] = _never
    spread: Spread | None = None


class Trainer(Protocol):
    """The function `train` in the `trainer` module of each family's package."""

    def __call__(self, job: Job[Any]) -> Iterator[Event]:
        """Train, and yield events.

        Yields:
            Progress, a snapshot for each evaluation, checkpoints when they are due, and finally
            Finished.
        """


def trainer_of(agent: AgentBlock) -> Trainer:
    """Return the trainer of an agent, which imports its libraries.

    From then on this process computes as anywhere (see `jumping_ant.agents.kernels`).
    """
    if not agent.is_baseline:  # these do without PyTorch, which takes seconds to import
        from jumping_ant.agents import kernels

        kernels.use()
    trainer: Trainer = resolve(f"{row(agent).trainer}:train")
    return trainer


def resolve(place: str) -> Any:
    """Import and return the object at `module:name`."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)
