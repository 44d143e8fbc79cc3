"""The jumping task: what is rewarded and when an episode ends."""

import numpy as np
from numpy.typing import NDArray

from jumping_ant.params.models import RewardParams


def torso_height_reward(torso_z: NDArray[np.float64], params: RewardParams) -> NDArray[np.float64]:
    """Return the height reward of each simulation.

    Args:
        torso_z: World height of the torso's centre [m], shape (num_envs,).
        params: Floor, span and scale of the reward.

    Returns:
        Reward per control step, shape (num_envs,), in [0, scale]; zero where the height is not
        finite.
    """
    height = np.where(np.isfinite(torso_z), torso_z, params.floor)
    return params.scale * np.clip((height - params.floor) / params.span, 0.0, 1.0)


def is_down(
    qpos: NDArray[np.float64], qvel: NDArray[np.float64], min_torso_height: float
) -> NDArray[np.bool_]:
    """Tell which simulations ended: the torso on the floor, or a state that is not finite.

    Args:
        qpos: Positions, shape (num_envs, 15); `qpos[:, 2]` is the torso's height [m].
        qvel: Velocities, shape (num_envs, 14).
        min_torso_height: Height below which an episode ends [m].

    Returns:
        Whether each episode is terminated, shape (num_envs,).
    """
    finite = np.isfinite(qpos).all(axis=1) & np.isfinite(qvel).all(axis=1)
    return ~finite | (qpos[:, 2] < min_torso_height)
