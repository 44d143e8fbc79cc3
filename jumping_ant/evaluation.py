"""How an agent behaves on the held-out episodes.

Every policy meets the same start states and acts deterministically. Measured beside the return, per
episode:

| column | what | unit |
|---|---|---|
| length | control steps until the end | steps |
| return | sum of the rewards | |
| peak_height | highest torso height | m |
| mean_height | mean torso height | m |
| jumps | airborne phases of at least `min_airborne_seconds` | |
| airborne_seconds | time without any contact | s |
| smoothness | mean squared change of torque over peak torque, step to step; lower is smoother | |
| work | mechanical work of the motors: sum of abs(torque x joint velocity) x dt | J |
| drift | horizontal distance of the torso from its start to its end | m |
| survived | 1 if the episode reached its time limit, else 0 | |

A state that is not finite ends its episode and is left out of the measures.
"""

from typing import Any

import mujoco
import numpy as np
import pandas as pd
from mujoco.batch import Batch
from numpy.typing import NDArray

from jumping_ant import robot, rollout
from jumping_ant.params import Params
from jumping_ant.policies import Policy
from jumping_ant.rollout import Episode
from jumping_ant.trajectory import Trajectory

QUANTITIES = (
    "length",
    "return",
    "peak_height",
    "mean_height",
    "jumps",
    "airborne_seconds",
    "smoothness",
    "work",
    "drift",
    "survived",
)


def evaluate(
    xml: str, params: Params, policies: dict[int, Policy], num_threads: int = 1
) -> tuple[pd.DataFrame, Trajectory]:
    """Run the held-out episodes of an agent's policies.

    Args:
        xml: The robot as MJCF text.
        params: All parameters.
        policies: The policy of each seed.
        num_threads: Threads that step the simulations; results do not depend on it.

    Returns:
        One row an episode (columns `seed`, `episode`, `episode_seed`, then `QUANTITIES`), and the
        trajectory of the episode of median return (the lower one of an even number).
    """
    model = robot.load(xml)
    episode_seeds = [params.evaluate.seed + i for i in range(params.evaluate.episodes)]
    rows: list[dict[str, Any]] = []
    episodes: list[Episode] = []
    for seed, policy in policies.items():
        ran = rollout.run(xml, params.env, policy, episode_seeds, num_threads)
        for number, (episode_seed, episode) in enumerate(zip(episode_seeds, ran, strict=True)):
            ids = {"seed": seed, "episode": number, "episode_seed": episode_seed}
            rows.append(ids | measure(model, params, episode))
        episodes += ran
    table = pd.DataFrame(rows)
    median = int(table["return"].argsort(kind="stable").iloc[(len(table) - 1) // 2])
    row = table.iloc[median]
    trajectory = replay(
        model, params.env.frame_skip, episodes[median], int(row["seed"]), int(row["episode"])
    )
    return table, trajectory


def seed_means(table: pd.DataFrame) -> pd.DataFrame:
    """Return the sample of the statistics: each seed's mean of every quantity over its episodes.

    Args:
        table: Episodes, as `evaluate` returns them.
    """
    return table.groupby("seed", as_index=False)[list(QUANTITIES)].mean()


def summarize(table: pd.DataFrame) -> dict[str, float]:
    """Return the mean over seeds of every quantity.

    Args:
        table: Episodes, as `evaluate` returns them.
    """
    by_seed = seed_means(table)
    return {name: float(by_seed[name].mean()) for name in QUANTITIES}


def measure(model: mujoco.MjModel, params: Params, episode: Episode) -> dict[str, float]:
    """Return the quantities of one episode (see the module's docstring).

    Args:
        model: The robot.
        params: All parameters.
        episode: The episode, of T control steps.
    """
    dt = float(model.opt.timestep) * params.env.frame_skip
    finite = np.isfinite(episode.qpos).all(axis=1) & np.isfinite(episode.qvel).all(axis=1)
    places = np.concatenate([episode.start_qpos[None, :3], episode.qpos[finite, :3]])
    change = np.diff(episode.torques, axis=0)
    return {
        "length": len(episode.rewards),
        "return": float(episode.rewards.sum()),
        "peak_height": float(places[:, 2].max()),
        "mean_height": float(places[:, 2].mean()),
        "jumps": count_phases(episode.airborne, params.evaluate.min_airborne_seconds / dt),
        "airborne_seconds": float(episode.airborne.sum() * dt),
        "smoothness": float(np.square(change).mean()) if len(change) else 0.0,
        "work": float(np.abs(motor_power(model, episode)[finite]).sum() * dt),
        "drift": float(np.hypot(*(places[-1, :2] - places[0, :2]))),
        "survived": int(not episode.terminated),
    }


def count_phases(mask: NDArray[np.bool_], min_length: float) -> int:
    """Return how many runs of true values are at least so long.

    Args:
        mask: Shape (T,).
        min_length: [elements]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    lengths = edges[1::2] - edges[::2]
    return int((lengths >= min_length - 1e-9).sum())


def motor_power(model: mujoco.MjModel, episode: Episode) -> NDArray[np.float64]:
    """Return the power of every motor [W], shape (T, 8), at the end of each control step.

    Where a velocity is not finite, it is zero.
    """
    velocities = episode.qvel[:, model.jnt_dofadr[model.actuator_trnid[:, 0]]]
    velocities = np.where(np.isfinite(velocities), velocities, 0.0)
    return episode.torques * model.actuator_gear[:, 0] * velocities


def replay(
    model: mujoco.MjModel, frame_skip: int, episode: Episode, seed: int, number: int
) -> Trajectory:
    """Simulate an episode again and keep every substep.

    Args:
        model: The robot.
        frame_skip: Substeps of a control step.
        episode: The episode, of T control steps.
        seed: The agent's seed, noted in the trajectory.
        number: The episode's number, noted in the trajectory.

    Returns:
        The trajectory, of T * frame_skip + 1 states.
    """
    batch = Batch(model, 1, 1)
    batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
    batch.bind("qpos")[0], batch.bind("qvel")[0] = episode.start_qpos, episode.start_qvel
    batch.forward()
    control = np.repeat(episode.torques, frame_skip, axis=0)[None]
    states = batch.rollout(control.shape[1], control, record=("qpos", "qvel"))
    return Trajectory(
        qpos=np.concatenate([episode.start_qpos[None], states["qpos"][0]]),
        qvel=np.concatenate([episode.start_qvel[None], states["qvel"][0]]),
        ctrl=episode.torques,
        reward_height=episode.rewards,
        seed=seed,
        episode=number,
        episode_return=float(episode.rewards.sum()),
        timestep=float(model.opt.timestep),
        frame_skip=frame_skip,
    )
