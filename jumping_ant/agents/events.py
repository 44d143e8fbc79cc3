"""Events that a trainer yields while it runs.

A trainer is a generator of these events. It opens no file, talks to no server and reads no clock,
so the same trainer runs inline in a test, in a local worker or on another machine.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One row of the learning curve; its returns are NaN if no episode ended in it."""

    env_steps: int  # control steps simulated so far, over all environments
    updates: int  # of the learner so far: gradient steps, or generations
    episodes: int  # training episodes finished so far
    return_mean: float  # of the episodes that ended since the previous row
    return_std: float  # their standard deviation (of the population)
    extra: dict[str, float]  # specific to the algorithm: losses, exploration rate and so on


@dataclass(frozen=True)
class Snapshot:
    """The current policy, for periodic evaluation."""

    env_steps: int  # so far
    policy: bytes  # content of a policy file (see `jumping_ant.policies`)


@dataclass(frozen=True)
class Finished:
    """The last event: training is complete."""

    env_steps: int  # in total
    policy: bytes  # content of the trained policy's file


@dataclass(frozen=True)
class Checkpoint:
    """The complete state of training, which resumes from it as if it had never stopped."""

    env_steps: int  # so far
    content: bytes  # what the trainer of this agent resumes from


Event = Progress | Snapshot | Checkpoint | Finished
