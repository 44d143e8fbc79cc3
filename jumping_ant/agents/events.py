"""Events that a trainer yields while it runs.

A trainer is a generator of these events. It opens no file, talks to no server and reads no clock,
so the same trainer runs inline in a test, in a local worker or on another machine.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One row of the learning curve.

    Attributes:
        env_steps: Control steps simulated so far, over all environments.
        updates: Updates of the learner so far (gradient steps, or generations).
        episodes: Training episodes finished so far.
        return_mean: Mean return of the training episodes that ended since the previous row, NaN
            if none did.
        return_std: Their standard deviation (of the population), NaN if none ended.
        extra: Values specific to the algorithm: losses, exploration rate and so on.
    """

    env_steps: int
    updates: int
    episodes: int
    return_mean: float
    return_std: float
    extra: dict[str, float]


@dataclass(frozen=True)
class Snapshot:
    """The current policy, for periodic evaluation.

    Attributes:
        env_steps: Control steps simulated so far.
        policy: Content of a policy file (see `jumping_ant.policies`).
    """

    env_steps: int
    policy: bytes


@dataclass(frozen=True)
class Finished:
    """The last event: training is complete.

    Attributes:
        env_steps: Control steps simulated in total.
        policy: Content of the trained policy's file.
    """

    env_steps: int
    policy: bytes


@dataclass(frozen=True)
class Checkpoint:
    """The complete state of training, which resumes from it as if it had never stopped.

    Attributes:
        env_steps: Control steps simulated so far.
        content: State that the trainer of this agent resumes from.
    """

    env_steps: int
    content: bytes


Event = Progress | Snapshot | Checkpoint | Finished
