"""A short episode, simulated by MuJoCo alone."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.sim.trajectory import Trajectory


def simulate(
    model: mujoco.MjModel,
    ctrl: NDArray[np.float64],
    height: float = 0.75,
    upward_speed: float = 0.0,
) -> Trajectory:
    """Let the robot go from a height [m] at a speed [m/s] while `ctrl` drives its motors."""
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[2] = height, upward_speed
    qpos, qvel = [data.qpos.copy()], [data.qvel.copy()]
    for torques in ctrl:
        data.ctrl[:] = torques
        for _ in range(5):
            mujoco.mj_step(model, data)
            qpos.append(data.qpos.copy())
            qvel.append(data.qvel.copy())
    rewards = np.arange(len(ctrl), dtype=np.float64) / 7
    return Trajectory(
        qpos=np.array(qpos),
        qvel=np.array(qvel),
        torques=ctrl,
        rewards=rewards,
        terms={"torso_height": rewards},
        agent="sac",
        seed=4,
        episode=11,
        episode_return=1.0,
        timestep=0.01,
        frame_skip=5,
    )
