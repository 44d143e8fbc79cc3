"""What a control step of one robot costs, in time and in memory."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import psutil  # type: ignore[import-untyped]

from benchmarks.measure import rate
from benchmarks.settings import CORES, default_world
from jumping_ant.sim.vector import RobotVectorEnv

MIN_ENV_STEPS = 6000  # for a figure; work is repeated until there are as many
EPISODE_STEPS = 5  # control steps from the start, whatever the number of environments


@dataclass(frozen=True)
class Cost:
    """What work of one size costs.

    Attributes:
        work: What is done.
        size: How many environments, or policies in a population.
        microseconds_one_thread: Time of a control step of one robot, on one thread.
        microseconds_all_threads: The same on every core.
        mebibytes: Resident memory of the whole process, after work on every core.
    """

    work: str
    size: int
    microseconds_one_thread: float
    microseconds_all_threads: float
    mebibytes: float


def cost(work: str, size: int, env_steps_per_second: Callable[[int], float]) -> Cost:
    """Measure work of one size.

    Args:
        work: What is done.
        size: How many environments or policies.
        env_steps_per_second: Does the work on a number of threads and returns its rate.
    """
    all_threads = 1e6 / env_steps_per_second(CORES)
    mebibytes = psutil.Process().memory_info().rss / 2**20
    return Cost(work, size, 1e6 / env_steps_per_second(1), all_threads, mebibytes)


def environments(size: int) -> Callable[[], Cost]:
    """Set up measuring the cost of `size` environments stepped together."""
    return partial(cost, "environments", size, partial(_env_steps_per_second, size))


def _env_steps_per_second(num_envs: int, num_threads: int) -> float:
    envs = RobotVectorEnv(default_world(), num_envs, num_threads)
    torques = envs.action_space.sample()
    seconds, env_steps = 0.0, 0
    while env_steps < MIN_ENV_STEPS:
        envs.reset(seed=env_steps)
        seconds += sum(1 / rate(partial(envs.step, torques), 1) for _ in range(EPISODE_STEPS))
        env_steps += num_envs * EPISODE_STEPS
    return env_steps / seconds
