"""What every jumping Ant has in common: observation, action, start state and commands.

Observation, `Box(27,)` float64:

| index | what | unit |
|---|---|---|
| 0 | height of the torso | m |
| 1-4 | orientation of the torso, quaternion (w, x, y, z) | |
| 5-12 | angles of hip_1, ankle_1, ..., hip_4, ankle_4 | rad |
| 13-15 | velocity of the torso in the world frame | m/s |
| 16-18 | angular velocity of the torso in its own frame | rad/s |
| 19-26 | angular velocities of the joints, in the order of the angles | rad/s |

Action, `Box(-1, 1, (8,))` float32: torque over peak torque of hip_4, ankle_4, hip_1, ankle_1,
hip_2, ankle_2, hip_3, ankle_3, the robot's actuator order. 0-3 move the two front legs, 4-7 the two
back legs, where x is forward:

| motors | leg in the source | its hip at x, y |
|---|---|---|
| 0, 1 | `right_back_leg` | 0.2, -0.2 |
| 2, 3 | `front_left_leg` | 0.2, 0.2 |
| 4, 5 | `front_right_leg` | -0.2, 0.2 |
| 6, 7 | `back_leg` | -0.2, -0.2 |

The source's names of two legs do not fit this; their places do. A positive torque on an ankle
pushes a front foot down and lifts a back one. So command 3 below pushes all four feet down, command
4 lifts them, and commands 1 and 2, the same torque on all, tilt the body.

The state's noise, observation and termination are those of Gymnasium's Ant-v5 without contact
forces, but for the upper height limit, which a jumping Ant must not have.
"""

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.actions import NUM_ACTIONS, ActionSet

DROP_HEIGHT = 1.3  # [m] of a tumbled start: no outstretched leg reaches the floor


def action_space(actions: ActionSet) -> gym.Space[Any]:
    """Return the space of one choice from an action set."""
    if actions.table is not None:
        return gym.spaces.Discrete(len(actions.table))
    return gym.spaces.Box(-1.0, 1.0, (NUM_ACTIONS,), np.float32)


def observation_space() -> gym.spaces.Box:
    """Return the space of one observation."""
    return gym.spaces.Box(-np.inf, np.inf, (27,), np.float64)


def observe(qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the observation of each state.

    Args:
        qpos: Positions, shape (num_envs, 15).
        qvel: Velocities, shape (num_envs, 14).

    Returns:
        Observations, shape (num_envs, 27). Entries that are not finite read zero: such a state
        ends its episode, and learners must not be fed what it holds.
    """
    observations = np.concatenate([qpos[:, 2:], qvel], axis=1)
    if not np.isfinite(observations).all():
        observations[~np.isfinite(observations)] = 0.0
    return observations


def start_state(
    model: mujoco.MjModel,
    noise_scale: float,
    generator: np.random.Generator,
    tumbled: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw a start state, as Ant-v5 draws it, or a tumbled one.

    Args:
        model: The robot.
        noise_scale: Half width of the positions' uniform noise, and deviation of the velocities'.
        generator: Where the noise comes from; it is advanced by one episode.
        tumbled: Chance that the robot starts in the air in any orientation, all of them equally
            likely, so that it lands on its back as often as on its feet.

    Returns:
        Positions, shape (15,), and velocities, shape (14,).
    """
    qpos = model.qpos0 + generator.uniform(-noise_scale, noise_scale, model.nq)
    qvel = noise_scale * generator.standard_normal(model.nv)
    if tumbled > 0 and generator.random() < tumbled:
        quaternion = generator.standard_normal(4)
        qpos[3:7] = quaternion / np.linalg.norm(quaternion)
        qpos[2] = DROP_HEIGHT
    return qpos, qvel
