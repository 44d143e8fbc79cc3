"""The batched environment compared with raw MuJoCo and other ways to run many environments.

Every repeat starts from the same states and plays the same random torques: the cost of a
step depends on what the robot touches.
"""

from collections.abc import Callable
from functools import partial

import envpool
import mujoco
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from numpy.typing import NDArray

from benchmarks.article_ant import ArticleAnt, default_world
from benchmarks.measure import CORES, Row, apart, compare_apart, rate, row
from jumping_ant.sim import robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

UNIT = "env-steps/s"
SEED = 0
REPEATS = 5
ENV_STEPS = 64 * 120  # control steps of all environments together in a repeat


def vector_env_vs_mj_step() -> Row:
    """Compare with `mj_step` alone, on all cores: the cost of MuJoCo itself."""
    ours = partial(batched, default_world(), 64, CORES, AutoresetMode.DISABLED)
    shares = np.array_split(np.arange(64), CORES)
    peers = [partial(raw, default_world(), 64, share) for share in shares]
    with apart(ours) as first, apart(*peers) as second:
        pairs = [(first()[0], ENV_STEPS / max(second())) for _ in range(REPEATS)]
    return row("vector_env_vs_mj_step", UNIT, pairs)


def vector_env_vs_async_gymnasium() -> Row:
    """Compare with Gymnasium's environments, each in a process."""
    ours = partial(batched, default_world(), 8, CORES, AutoresetMode.SAME_STEP)
    peer = partial(asynchronous, 8)
    return compare_apart("vector_env_vs_async_gymnasium", UNIT, ours, peer, REPEATS)


def vector_env_vs_envpool() -> Row:
    """Compare with EnvPool's stock Ant, on two threads."""
    stock = World(robot.source_path("ant").read_text(encoding="utf-8"), default_world().env)
    ours = partial(batched, stock, 64, 2, AutoresetMode.DISABLED)
    return compare_apart("vector_env_vs_envpool", UNIT, ours, partial(pooled, 64, 2), REPEATS)


def batched(
    world: World, num_envs: int, num_threads: int, autoreset: AutoresetMode
) -> Callable[[], float]:
    """Set up the project's batched environment."""
    envs = RobotVectorEnv(world, num_envs, num_threads, autoreset)
    return partial(steps_per_second, partial(envs.reset, seed=SEED), envs.step, num_envs)


def asynchronous(num_envs: int) -> Callable[[], float]:
    """Set up Gymnasium's environments, each in a process, to restart as the batched ones do."""
    envs = AsyncVectorEnv([ArticleAnt] * num_envs, autoreset_mode=AutoresetMode.SAME_STEP)
    return partial(steps_per_second, partial(envs.reset, seed=SEED), envs.step, num_envs)


def pooled(num_envs: int, num_threads: int) -> Callable[[], float]:
    """Set up EnvPool at its fastest: it computes only the 27 observations."""
    envs = envpool.make(
        "Ant-v5",
        env_type="gymnasium",
        num_envs=num_envs,
        batch_size=num_envs,
        num_threads=num_threads,
        seed=SEED,
        use_contact_force=False,
        post_constraint=False,
        terminate_when_unhealthy=False,
    )
    return partial(steps_per_second, envs.reset, envs.step, num_envs)


def raw(world: World, num_envs: int, share: NDArray[np.int64]) -> Callable[[], float]:
    """Set up a process's share of the same simulations, without environments; measure seconds."""
    model = world.model
    data = mujoco.MjData(model)
    envs = RobotVectorEnv(world, num_envs)
    envs.reset(seed=SEED)
    starts = [(envs.qpos[index].copy(), envs.qvel[index].copy()) for index in share]
    controls = random_torques(num_envs).swapaxes(0, 1)[share]
    nstep = world.env.frame_skip

    def simulate() -> None:
        for (qpos, qvel), torques in zip(starts, controls, strict=True):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = qpos, qvel
            mujoco.mj_forward(model, data)
            for ctrl in torques:
                data.ctrl[:] = ctrl
                mujoco.mj_step(model, data, nstep=nstep)

    return lambda: 1 / rate(simulate, 1)


def steps_per_second(
    reset: Callable[[], object], step: Callable[[NDArray[np.float64]], object], num_envs: int
) -> float:
    """Return the rate of the control steps of all environments, without the reset."""
    reset()
    torques = random_torques(num_envs)

    def play() -> None:
        for actions in torques:
            step(actions)

    return rate(play, ENV_STEPS)


def random_torques(num_envs: int) -> NDArray[np.float64]:
    """Return torques over peak torques, shape (ENV_STEPS / num_envs, num_envs, 8)."""
    shape = (ENV_STEPS // num_envs, num_envs, 8)
    return np.random.default_rng(SEED).uniform(-1.0, 1.0, shape)
