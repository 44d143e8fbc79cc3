"""What a trainer tells the world while it runs.

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
        return_mean: Mean return of the training episodes that ended since the row before, NaN
            where none did.
        return_std: Their standard deviation (of the population), NaN where none ended.
        extra: What the algorithm has beside these: losses, exploration rate and so on.
    """

    env_steps: int
    updates: int
    episodes: int
    return_mean: float
    return_std: float
    extra: dict[str, float]


@dataclass(frozen=True)
class Snapshot:
    """The policy as it stands, for periodic evaluation.

    Attributes:
        env_steps: Control steps simulated so far.
        policy: A policy file's content (see `jumping_ant.policies`).
    """

    env_steps: int
    policy: bytes


@dataclass(frozen=True)
class Finished:
    """The last event: training is complete.

    Attributes:
        env_steps: Control steps simulated in all.
        policy: The trained policy file's content.
    """

    env_steps: int
    policy: bytes


@dataclass(frozen=True)
class Checkpoint:
    """All that training resumes from, as if it had never stopped.

    Attributes:
        env_steps: Control steps simulated so far.
        content: What the trainer of this agent takes to resume.
    """

    env_steps: int
    content: bytes


Event = Progress | Snapshot | Checkpoint | Finished
