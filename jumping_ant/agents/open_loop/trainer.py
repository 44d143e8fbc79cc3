"""The best open-loop rhythm: a metronome that knows nothing of the state.

It alternates between two of the article's commands, all feet down and all feet up, and holds each
for as many control steps. Trying a handful of rhythms is all of its training. A learner that does
not return more has not learned to use what it observes.
"""

from collections.abc import Callable, Iterator

import numpy as np
from gymnasium.vector import AutoresetMode

from jumping_ant.actions import COMMAND_SIGNS, ActionSet
from jumping_ant.agents.events import Event, Finished, Progress, Snapshot
from jumping_ant.base.seeding import derive_all
from jumping_ant.params.models import EnvParams, OpenLoopParams
from jumping_ant.policies import OpenLoopPolicy
from jumping_ant.sim.vector import JumpingAntVectorEnv

FEET_DOWN, FEET_UP = 3, 4  # rows of COMMAND_SIGNS


def train(
    xml: str,
    env: EnvParams,
    agent: OpenLoopParams,
    seed: int,
    evaluations: int,
    num_threads: int = 1,
    checkpoint: bytes | None = None,
    is_checkpoint_due: Callable[[], bool] = lambda: False,
) -> Iterator[Event]:
    """Try each rhythm on the same start states, and keep the one of the highest mean return.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seed: Determines the start states.
        evaluations: Unused; there is one snapshot, after the search.
        num_threads: Threads that step the simulations; results do not depend on it.
        checkpoint: Unused; the search takes seconds.
        is_checkpoint_due: Unused.

    Yields:
        Progress for each rhythm (with its half-period), and at last the best policy.
    """
    envs = JumpingAntVectorEnv(
        xml,
        env,
        agent.episodes,
        num_threads,
        AutoresetMode.DISABLED,
        episode_steps=np.full(agent.episodes, agent.episode_steps),
    )
    starts = derive_all(seed, "starts", agent.episodes)
    best, best_return, env_steps = OpenLoopPolicy(ActionSet()), -np.inf, 0
    for number, half_period in enumerate(agent.half_periods, start=1):
        policy = metronome(agent.amplitude, half_period)
        returns, steps = _play(envs, policy, starts, agent.episode_steps)
        env_steps += steps
        if returns.mean() > best_return:
            best, best_return = policy, returns.mean()
        yield Progress(
            env_steps=env_steps,
            updates=number,
            episodes=number * agent.episodes,
            return_mean=float(returns.mean()),
            return_std=float(returns.std()),
            extra={"half_period": float(half_period)},
        )
    yield Snapshot(env_steps, best.to_bytes())
    yield Finished(env_steps, best.to_bytes())


def metronome(amplitude: float, half_period: int) -> OpenLoopPolicy:
    """Return the policy that pushes all feet down and lifts them, by turns.

    Args:
        amplitude: Torque over peak torque.
        half_period: Control steps that each of the two is held for.
    """
    table = np.float32(amplitude) * COMMAND_SIGNS[[FEET_DOWN, FEET_UP]]
    return OpenLoopPolicy(ActionSet(table, hold=half_period))


def _play(
    envs: JumpingAntVectorEnv, policy: OpenLoopPolicy, starts: list[int], num_steps: int
) -> tuple[np.ndarray, int]:
    """Play an episode from each start; return the returns, (num_envs,), and the control steps."""
    observations, _ = envs.reset(seed=starts)
    policy.start(starts)
    returns, alive = np.zeros(envs.num_envs), np.ones(envs.num_envs, dtype=np.bool_)
    total = 0
    for step in range(num_steps):
        if step % policy.actions.hold == 0:
            torques = policy.act(observations)
        observations, rewards, terminated, truncated, _ = envs.step(torques)
        returns += rewards * alive
        total += int(alive.sum())
        alive &= ~(terminated | truncated)
        if not alive.any():
            break
    return returns, total
