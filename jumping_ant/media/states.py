"""The parts of a robot, and their poses and contacts in a trajectory, computed by the simulator."""

from dataclasses import dataclass
from itertools import cycle, islice

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.sim.robot import body_names
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Color = tuple[int, ...]

TIMELINE = "sim_time"
TORSO_COLOR: Color = (232, 222, 204)
# One colour a leg, in the order of the bodies; its shapes, arrows and series share it.
LEG_COLORS: dict[str, Color] = {
    "coral": (240, 120, 90),
    "yellow": (250, 195, 80),
    "green": (90, 190, 170),
    "violet": (130, 140, 245),
}


@dataclass(frozen=True)
class States:
    """States of a trajectory, one per row, in the world frame."""

    times: Indices  # [ns], (num_rows,)
    steps: Indices  # the control step that each belongs to, (num_rows,)
    positions: Array  # of the bodies [m], (num_rows, num_bodies, 3)
    quaternions: Array  # of the bodies (x, y, z, w), (num_rows, num_bodies, 4)
    heights: Array  # of the torso's centre [m], (num_rows,)
    normal_forces: Array  # sums over each limb's contacts [N], (num_rows, num_limbs)
    contact_forces: Array  # sums, with friction [N], (num_rows, num_limbs, 3)
    contact_points: Array  # mean of the contacts [m], (num_rows, num_limbs, 3)
    limb_contacts: Indices  # number of contacts, (num_rows, num_limbs)
    contacts: Indices  # their number on the whole robot, (num_rows,)

    @property
    def columns(self) -> list[rr.TimeColumn]:
        """The time lines of values in every state."""
        return time_columns(self.times, self.steps)

    def peak(self, until: int) -> tuple[float, int]:
        """Return the torso's greatest height [m] up to a time [ns], and when it is there [ns]."""
        row = int(np.argmax(self.heights[self.times <= until]))
        return float(self.heights[row]), int(self.times[row])


def motor_names(world: World) -> list[str]:
    """Return the motors' names."""
    return [world.model.actuator(motor).name for motor in range(world.anatomy.num_motors)]


def limbs(world: World) -> dict[str, Color]:
    """Return the limbs, which are the torso and the legs that begin at it, and their colours."""
    names, roots = body_names(world.model), _limb_roots(world)
    legs = islice(cycle(LEG_COLORS.values()), len(roots) - 1)
    return dict(zip([names[root] for root in roots], [TORSO_COLOR, *legs], strict=True))


def limbs_of_bodies(world: World) -> Indices:
    """Return the number of each body's limb, -1 for the world, shape (num_bodies,)."""
    model, roots = world.model, _limb_roots(world)
    numbers = np.full(model.nbody, -1)
    for body in range(1, model.nbody):  # a parent comes before its children
        numbers[body] = roots.index(body) if body in roots else numbers[model.body_parentid[body]]
    return numbers


def time_columns(times: Indices, steps: Indices | None = None) -> list[rr.TimeColumn]:
    """Return the time lines of values at some times [ns] and in some control steps, if any."""
    columns = [rr.TimeColumn(TIMELINE, duration=times.astype("timedelta64[ns]"))]
    return columns if steps is None else [*columns, rr.TimeColumn("control_step", sequence=steps)]


def derive(world: World, trajectory: Trajectory, stride: int = 1) -> States:
    """Compute poses and contacts in every `stride`-th state of an episode."""
    model = world.model
    trajectory.check(model)
    rows = trajectory.rows(stride)
    steps = np.minimum(rows // trajectory.frame_skip, len(trajectory.torques) - 1)
    shape = (len(rows), len(_limb_roots(world)))
    states = States(
        times=np.rint(rows * trajectory.timestep * 1e9).astype(np.int64),
        steps=steps,
        positions=np.empty((len(rows), model.nbody, 3)),
        quaternions=np.empty((len(rows), model.nbody, 4)),
        heights=np.empty(len(rows)),
        normal_forces=np.zeros(shape),
        contact_forces=np.zeros((*shape, 3)),
        contact_points=np.zeros((*shape, 3)),
        limb_contacts=np.zeros(shape, dtype=np.int64),
        contacts=np.empty(len(rows), dtype=np.int64),
    )
    data, numbers = mujoco.MjData(model), limbs_of_bodies(world)[model.geom_bodyid]
    controls = trajectory.torques * world.anatomy.control_limits
    for index, row in enumerate(rows):
        data.qpos[:], data.qvel[:] = trajectory.qpos[row], trajectory.qvel[row]
        data.ctrl[:] = controls[steps[index]]
        mujoco.mj_forward(model, data)
        states.positions[index] = data.xpos
        states.quaternions[index] = np.roll(data.xquat, -1, axis=1)
        states.contacts[index] = data.ncon
        _add_contacts(model, data, numbers, states, index)
    states.heights[:] = states.positions[:, world.anatomy.torso, 2]
    states.contact_points[:] /= np.maximum(states.limb_contacts, 1)[:, :, None]
    return states


def _add_contacts(
    model: mujoco.MjModel, data: mujoco.MjData, limbs: Indices, states: States, index: int
) -> None:
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


def _limb_roots(world: World) -> list[int]:
    torso = world.anatomy.torso
    return [torso, *np.flatnonzero(world.model.body_parentid == torso).tolist()]
