"""The task: a robot's observations, actions, start states, ends of episodes, and rewards.

Observation, float64: the positions except the torso's horizontal ones, then the velocities. For
the Ant, `Box(27,)`:

| index | what | unit |
|---|---|---|
| 0 | height of the torso | m |
| 1-4 | orientation of the torso, quaternion (w, x, y, z) | |
| 5-12 | angles of hip_1, ankle_1, ..., hip_4, ankle_4 | rad |
| 13-15 | velocity of the torso in the world frame | m/s |
| 16-18 | angular velocity of the torso in its own frame | rad/s |
| 19-26 | angular velocities of the joints, in the order of the angles | rad/s |

Action: torque over peak torque of every motor, in the order of the robot's actuators. For the Ant,
`Box(-1, 1, (8,))` float32: hip_4, ankle_4, hip_1, ankle_1, hip_2, ankle_2, hip_3, ankle_3. 0-3 move
the two front legs, 4-7 the two back legs, where x is forward:

| motors | leg in the source | its hip at x, y |
|---|---|---|
| 0, 1 | `right_back_leg` | 0.2, -0.2 |
| 2, 3 | `front_left_leg` | 0.2, 0.2 |
| 4, 5 | `front_right_leg` | -0.2, 0.2 |
| 6, 7 | `back_leg` | -0.2, -0.2 |

The names of two legs do not match their places. A positive torque on an ankle pushes a front foot
down and lifts a back one. So command 3 of the article pushes all four feet down, command 4 lifts
them, and commands 1 and 2, the same torque on all, tilt the body.

Noise of the start state, observation and the lower limit of height are those of Gymnasium's Ant-v5
without contact forces.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import rewards
from jumping_ant.sim.world import World

Array = NDArray[np.float64]


class Outcome(NamedTuple):
    """Result of a control step in n simulations."""

    rewards: Array  # (n,)
    terms: dict[str, Array]  # contribution of each term to the reward, (n,) each
    terminated: NDArray[np.bool_]  # whether the episode ended, (n,)


class Task:
    """The task of a robot, computed from arrays; an InputError if they do not fit.

    Attributes:
        anatomy: Sizes and coordinates of the robot.
        dt: Duration of a control step [s].
    """

    def __init__(self, world: World) -> None:
        self.params = world.env
        self.anatomy = world.anatomy
        self.dt = world.dt
        self._terms = rewards.active(world.env.reward)
        self._start_qpos = world.model.qpos0.copy()
        if (width := len(world.env.commands[0])) != self.anatomy.num_motors:
            raise InputError(
                f"env.commands: given rows of {width} torques, allowed: the robot's "
                f"{self.anatomy.num_motors} motors"
            )

    @property
    def observation_space(self) -> gym.spaces.Box:
        """The space of one observation."""
        return gym.spaces.Box(-np.inf, np.inf, (self.anatomy.num_observations,), np.float64)

    def action_space(self, actions: ActionSet) -> gym.Space[Any]:
        """Return the space of one choice from an action set."""
        if actions.table is not None:
            return gym.spaces.Discrete(len(actions.table))
        if actions.levels is not None:
            return gym.spaces.MultiDiscrete([actions.levels] * self.anatomy.num_motors)
        return gym.spaces.Box(-1.0, 1.0, (self.anatomy.num_motors,), np.float32)

    def observe(self, qpos: Array, qvel: Array) -> Array:
        """Return the observation of each state.

        Args:
            qpos: Positions, shape (n, num_positions).
            qvel: Velocities, shape (n, num_velocities).

        Returns:
            Shape (n, num_observations). Entries that are not finite, which end an episode, are set
            to zero for learners.
        """
        observations = np.concatenate([qpos[:, self.anatomy.num_horizontal :], qvel], axis=1)
        observations[~np.isfinite(observations)] = 0.0
        return observations

    def start_state(
        self, generator: np.random.Generator, tumbled: float = 0.0
    ) -> tuple[Array, Array]:
        """Draw a start state, as in Gymnasium's Ant-v5, or a tumbled one.

        Args:
            generator: Source of the noise; it is advanced by one episode.
            tumbled: Chance that the robot starts in the air in any orientation, all of them equally
                likely.

        Returns:
            Positions, shape (num_positions,), and velocities, shape (num_velocities,).
        """
        anatomy, noise = self.anatomy, self.params.reset_noise_scale
        qpos = self._start_qpos + generator.uniform(-noise, noise, anatomy.num_positions)
        qvel = noise * generator.standard_normal(anatomy.num_velocities)
        if tumbled > 0 and generator.random() < tumbled:
            if anatomy.is_free:
                quaternion = generator.standard_normal(4)
                qpos[anatomy.orientation] = quaternion / np.linalg.norm(quaternion)
            else:
                qpos[anatomy.orientation] = generator.uniform(-np.pi, np.pi)
            qpos[anatomy.height_address] = self.params.drop_height - anatomy.height_offset
        return qpos, qvel

    def judge(
        self, qpos: Array, qvel: Array, torques: Array, travel: Array, contacts: NDArray[np.int32]
    ) -> Outcome:
        """Return the reward of a control step and whether it ended the episode.

        An episode ends if the torso is too low, too high or tilted too far, or the state is not
        finite, which earns nothing.

        Args:
            qpos: Positions after the step, shape (n, num_positions).
            qvel: Velocities after the step, shape (n, num_velocities).
            torques: Torques over peak torques held during the step, shape (n, num_motors).
            travel: Distance that the torsos moved along x [m], shape (n,).
            contacts: Number of contacts of each robot in the last simulation step, shape (n,).
        """
        params = self.params
        heights = self.anatomy.heights(qpos)
        finite = np.isfinite(qpos).all(axis=1) & np.isfinite(qvel).all(axis=1)
        terminated: NDArray[np.bool_] = np.logical_not(finite)
        if params.min_torso_height is not None:
            terminated |= heights < params.min_torso_height
        if params.max_torso_height is not None:
            terminated |= heights > params.max_torso_height
        if params.max_tilt is not None:
            terminated |= self.anatomy.uprightness(qpos) < np.cos(params.max_tilt)
        step = rewards.ControlStep(
            self.anatomy, qpos, qvel, heights, travel / self.dt, torques, contacts, terminated
        )
        terms = rewards.terms(step, self._terms)
        for values in terms.values():
            values[~finite] = 0.0
        total = sum(terms.values(), start=np.zeros(len(qpos)))
        return Outcome(total, terms, terminated)
