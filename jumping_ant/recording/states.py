"""Poses and contacts in a trajectory's states, computed by the simulator."""

from dataclasses import dataclass

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.recording.parts import limb_names, limbs_of_bodies
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

TIMELINE = "sim_time"


@dataclass(frozen=True)
class States:
    """States of a trajectory, one per row, in the world frame."""

    rows: NDArray[np.int64]  # their numbers in the trajectory, (num_rows,)
    times: NDArray[np.int64]  # [ns], (num_rows,)
    steps: NDArray[np.int64]  # the control step that each belongs to, (num_rows,)
    positions: NDArray[np.float64]  # of the bodies [m], (num_rows, num_bodies, 3)
    quaternions: NDArray[np.float64]  # of the bodies (x, y, z, w), (num_rows, num_bodies, 4)
    normal_forces: NDArray[np.float64]  # sums over each limb's contacts [N], (num_rows, num_limbs)
    contact_forces: NDArray[np.float64]  # sums, with friction [N], (num_rows, num_limbs, 3)
    contact_points: NDArray[np.float64]  # mean of the contacts [m], (num_rows, num_limbs, 3)
    limb_contacts: NDArray[np.int64]  # number of contacts, (num_rows, num_limbs)
    contacts: NDArray[np.int64]  # their number on the whole robot, (num_rows,)


def derive(world: World, trajectory: Trajectory, rows: NDArray[np.int64]) -> States:
    """Compute poses and contacts in some rows of an episode."""
    model = world.model
    trajectory.check(model)
    skip, num_rows = trajectory.frame_skip, len(rows)
    num_limbs = len(limb_names(world))
    steps = np.minimum(rows // skip, len(trajectory.torques) - 1)
    states = States(
        rows=rows,
        times=np.rint(rows * trajectory.timestep * 1e9).astype(np.int64),
        steps=steps,
        positions=np.empty((num_rows, model.nbody, 3)),
        quaternions=np.empty((num_rows, model.nbody, 4)),
        normal_forces=np.zeros((num_rows, num_limbs)),
        contact_forces=np.zeros((num_rows, num_limbs, 3)),
        contact_points=np.zeros((num_rows, num_limbs, 3)),
        limb_contacts=np.zeros((num_rows, num_limbs), dtype=np.int64),
        contacts=np.empty(num_rows, dtype=np.int64),
    )
    data, limbs = mujoco.MjData(model), limbs_of_bodies(world)[model.geom_bodyid]
    controls = trajectory.torques * world.anatomy.control_limits
    for index, row in enumerate(rows):
        data.qpos[:], data.qvel[:] = trajectory.qpos[row], trajectory.qvel[row]
        data.ctrl[:] = controls[steps[index]]
        mujoco.mj_forward(model, data)
        states.positions[index] = data.xpos
        states.quaternions[index] = np.roll(data.xquat, -1, axis=1)
        states.contacts[index] = data.ncon
        _add_contacts(model, data, limbs, states, index)
    np.divide(
        states.contact_points,
        states.limb_contacts[:, :, None],
        out=states.contact_points,
        where=states.limb_contacts[:, :, None] > 0,
    )
    return states


def indexes(times: NDArray[np.int64], steps: NDArray[np.int64]) -> list[rr.TimeColumn]:
    """Return the two time lines of a recording for rows at these times [ns] and control steps."""
    return [
        rr.TimeColumn(TIMELINE, duration=times.astype("timedelta64[ns]")),
        rr.TimeColumn("control_step", sequence=steps),
    ]


def _add_contacts(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    limbs: NDArray[np.int64],
    states: States,
    index: int,
) -> None:
    """Sum up a state's contacts per limb, including the contact points."""
    force = np.empty(6)
    for number, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, number, force)
        # In the contact's frame, whose axes are the rows of `frame`; the second geom is pushed.
        push = force[:3] @ contact.frame.reshape(3, 3)
        for limb, direction in zip(limbs[contact.geom], (-1.0, 1.0), strict=True):
            if limb >= 0:
                states.normal_forces[index, limb] += force[0]
                states.contact_forces[index, limb] += direction * push
                states.contact_points[index, limb] += contact.pos
                states.limb_contacts[index, limb] += 1
