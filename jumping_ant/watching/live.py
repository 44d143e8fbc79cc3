"""A recording of live episodes, which grows while they are played.

Scene and series are those of `jumping_ant.recording.episode`; episodes follow each other on
one timeline.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.recording import layout, series, states
from jumping_ant.recording.scene import Scene
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World


@dataclass(frozen=True, eq=False)
class Step:
    """A control step as it is played."""

    qpos: NDArray[np.float64]  # at its start, (num_positions,)
    qvel: NDArray[np.float64]  # at its start, (num_velocities,)
    torques: NDArray[np.float64]  # over peak torques, (num_motors,)
    reward: float
    terms: dict[str, float]  # what each term of the reward added to it


class LiveRecording:
    """A recording that grows by one control step at a time."""

    def __init__(self, stream: rr.RecordingStream, world: World) -> None:
        self._stream, self._world = stream, world
        self._scene = Scene(stream, world)
        self._data = mujoco.MjData(world.model)
        self._num_steps = 0
        self._scene.log_shapes()

    def show(self, step: Step) -> None:
        """Record a control step; an incomplete one is left out."""
        trajectory = self._simulate(step)
        rows, first = trajectory.rows(), self._num_steps
        self._num_steps += 1
        if len(rows) == len(trajectory.qpos):
            found = states.derive(self._world, trajectory, rows, first)
            self._scene.log_states(found)
            series.log_states(self._stream, self._world, found)
            series.log_control(self._stream, self._world, trajectory, len(rows), first)
        if first == 0:
            series.log_styles(self._stream, self._world, list(series.reward_series(trajectory)))
            # Not earlier: a camera can only follow an entity that exists.
            self._stream.flush()
            self._stream.send_blueprint(layout.live_layout(self._world))

    def _simulate(self, step: Step) -> Trajectory:
        """Return the control step with all its simulation steps."""
        world, data, positions, velocities = self._world, self._data, [step.qpos], [step.qvel]
        data.qpos[:], data.qvel[:] = step.qpos, step.qvel
        data.ctrl[:] = step.torques * world.anatomy.control_limits
        for _ in range(world.env.frame_skip):
            mujoco.mj_step(world.model, data)
            positions.append(data.qpos.copy())
            velocities.append(data.qvel.copy())
        return Trajectory(
            qpos=np.array(positions),
            qvel=np.array(velocities),
            torques=step.torques[None],
            rewards=np.array([step.reward]),
            terms={name: np.array([value]) for name, value in step.terms.items()},
            agent="",  # it is shown as it is played, and kept nowhere
            seed=0,
            episode=0,
            episode_return=step.reward,
            timestep=float(world.model.opt.timestep),
            frame_skip=world.env.frame_skip,
        )
