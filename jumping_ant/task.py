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
hip_2, ankle_2, hip_3, ankle_3, the robot's actuator order. 0-3 move the two legs at x > 0, ahead of
the torso (`right_back_leg` and `front_left_leg` in the source), 4-7 the two at x < 0 behind it. The
ankles of the two pairs have opposite signs.

The state's noise, observation and termination are those of Gymnasium's Ant-v5 without contact
forces, but for the upper height limit, which a jumping Ant must not have.
"""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.params import ActionParams

NUM_ACTIONS = 8

# The source article's five commands, one a row, in the actuators' order, as signs of the torques:
# none, all forward, all backward, front legs forward and back legs backward, and the reverse.
COMMAND_SIGNS: NDArray[np.float32] = np.array(
    [
        [0.0] * 8,
        [1.0] * 8,
        [-1.0] * 8,
        [1.0] * 4 + [-1.0] * 4,
        [-1.0] * 4 + [1.0] * 4,
    ],
    dtype=np.float32,
)
COMMAND_SIGNS.flags.writeable = False


@dataclass(frozen=True)
class ActionSet:
    """What an agent chooses from at each decision, and how long a choice lasts.

    Attributes:
        table: Torques over peak torques of each command, shape (num_commands, 8); None where any
            torques may be chosen.
        amplitude: Factor on chosen torques, where there is no table.
        hold: Control steps that a choice is held for.
    """

    table: NDArray[np.float32] | None = None
    amplitude: float = 1.0
    hold: int = 1

    @classmethod
    def of(cls, params: ActionParams) -> "ActionSet":
        """Return the set that an agent's parameters describe."""
        if params.kind == "commands":
            return cls(np.float32(params.amplitude) * COMMAND_SIGNS, 1.0, params.hold)
        return cls(None, params.amplitude, params.hold)

    def space(self) -> gym.Space[Any]:
        """Return the space of one choice."""
        if self.table is not None:
            return gym.spaces.Discrete(len(self.table))
        return gym.spaces.Box(-1.0, 1.0, (NUM_ACTIONS,), np.float32)

    def torques(self, choices: NDArray[Any]) -> NDArray[Any]:
        """Return the torques over peak torques of each choice.

        Args:
            choices: Numbers of commands, shape (n,), or torques in [-1, 1], shape (n, 8).

        Returns:
            Torques in [-amplitude, amplitude], shape (n, 8).
        """
        if self.table is not None:
            return self.table[choices]
        return choices if self.amplitude == 1.0 else self.amplitude * choices

    def sample(self, generator: np.random.Generator) -> NDArray[np.float64]:
        """Draw a choice uniformly, and return its torques, shape (8,)."""
        if self.table is not None:
            return self.table[generator.integers(len(self.table))].astype(np.float64)
        return self.amplitude * generator.uniform(-1.0, 1.0, NUM_ACTIONS)


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
    model: mujoco.MjModel, noise_scale: float, generator: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw a start state, as Ant-v5 draws it.

    Args:
        model: The robot.
        noise_scale: Half width of the positions' uniform noise, and deviation of the velocities'.
        generator: Where the noise comes from; it is advanced by one episode.

    Returns:
        Positions, shape (15,), and velocities, shape (14,).
    """
    qpos = model.qpos0 + generator.uniform(-noise_scale, noise_scale, model.nq)
    qvel = noise_scale * generator.standard_normal(model.nv)
    return qpos, qvel
