"""The anatomy of a compiled robot: its torso and how it moves, its motors, its sizes.

A robot is a tree of bodies on a floor. Its first body that moves relative to the world is its
torso, which moves either freely (Ant, Humanoid) or in the x-z plane (Hopper, Walker2d, HalfCheetah:
slides along x and z, and a hinge that tilts it). All its motors drive joints.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Sizes and coordinates of a robot."""

    num_positions: int  # of `qpos`
    num_velocities: int  # of `qvel`
    num_motors: int  # of `ctrl`
    num_horizontal: int  # coordinates of the torso; first in `qpos`, and not observed
    torso: int  # index of the body
    height_address: int  # in `qpos`, of the torso's height minus `height_offset`
    height_offset: float  # [m]
    orientation: slice  # of the torso in `qpos`: a quaternion (w, x, y, z), or an angle [rad]
    level: float  # the angle at which the torso is upright [rad]
    control_limits: Array  # control at peak torque, (num_motors,)
    peak_torques: Array  # [N m], (num_motors,)
    motor_joints: NDArray[np.int64]  # the joint that each motor drives, (num_motors,)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Anatomy":
        """Return the anatomy of a compiled robot; an InputError says what does not fit."""
        torso = _torso(model)
        joints = range(
            model.body_jntadr[torso], model.body_jntadr[torso] + model.body_jntnum[torso]
        )
        kinds = [int(model.jnt_type[joint]) for joint in joints]
        if kinds == [mujoco.mjtJoint.mjJNT_FREE]:
            horizontal, height, orientation, level, offset = 2, 2, slice(3, 7), 0.0, 0.0
        else:
            horizontal, height, orientation = _planar(model, list(joints))
            level = float(model.qpos0[orientation].sum())
            offset = float(model.body_pos[torso, 2] - model.qpos0[height])
        limits, motor_joints = _motors(model)
        return cls(
            num_positions=model.nq,
            num_velocities=model.nv,
            num_motors=model.nu,
            num_horizontal=horizontal,
            torso=torso,
            height_address=height,
            height_offset=offset,
            orientation=orientation,
            level=level,
            control_limits=limits,
            peak_torques=limits * model.actuator_gear[:, 0],
            motor_joints=motor_joints,
        )

    @property
    def num_observed_positions(self) -> int:
        """Number of positions in an observation; the velocities follow them."""
        return self.num_positions - self.num_horizontal

    @property
    def num_observations(self) -> int:
        """Number of values in an observation."""
        return self.num_observed_positions + self.num_velocities

    @property
    def is_free(self) -> bool:
        """Whether the torso moves freely; otherwise it moves in a plane."""
        return self.orientation.stop - self.orientation.start == 4

    def heights(self, qpos: Array) -> Array:
        """Return the torso's height in each state [m], shape (n,), of positions (n, nq)."""
        return qpos[:, self.height_address] + self.height_offset

    def places(self, qpos: Array) -> Array:
        """Return the torso's position in each state [m], shape (n, 3), of positions (n, nq)."""
        places = np.zeros((len(qpos), 3))
        places[:, : self.num_horizontal] = qpos[:, : self.num_horizontal]
        places[:, 2] = self.heights(qpos)
        return places

    def uprightness(self, qpos: Array) -> Array:
        """Return the cosine of the torso's tilt in each state, shape (n,): 1 is upright."""
        turned = qpos[:, self.orientation]
        if self.is_free:
            tipped = np.square(turned[:, 1:3]).sum(axis=1) / np.square(turned).sum(axis=1)
            return np.asarray(1.0 - 2.0 * tipped)
        return np.cos(turned.sum(axis=1) - self.level)


def _torso(model: mujoco.MjModel) -> int:
    moving = np.flatnonzero((model.body_parentid == 0) & (model.body_jntnum > 0))
    if len(moving) != 1 or model.body_jntadr[moving[0]] != 0:
        raise InputError(
            f"robot: given {len(moving)} bodies that move relative to the world, allowed: one, "
            "the torso, whose joints come first"
        )
    return int(moving[0])


def _planar(model: mujoco.MjModel, joints: list[int]) -> tuple[int, int, slice]:
    """Return the number of horizontal coordinates, the height's address, and the tilt's slice."""
    slides = [joint for joint in joints if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE]
    axes = [tuple(np.abs(model.jnt_axis[joint]).round(6)) for joint in slides]
    hinges = joints[len(slides) :]
    is_planar = (
        joints[: len(slides)] == slides
        and axes == [(1, 0, 0), (0, 0, 1)]
        and [int(model.jnt_type[joint]) for joint in hinges] == [mujoco.mjtJoint.mjJNT_HINGE]
    )
    if not is_planar:
        names = ", ".join(model.joint(joint).name or "a nameless one" for joint in joints)
        raise InputError(
            f"robot: given a torso on the joints {names}, allowed: a free joint, or slides along x "
            "and z and a hinge, in this order"
        )
    tilt = int(model.jnt_qposadr[hinges[0]])
    return 1, int(model.jnt_qposadr[slides[1]]), slice(tilt, tilt + 1)


def _motors(model: mujoco.MjModel) -> tuple[Array, NDArray[np.int64]]:
    """Return each motor's control at peak torque, and its joint."""
    if model.nu == 0:
        raise InputError("robot: given no motor, allowed: one or more")
    limits = np.where(model.actuator_ctrllimited == 1, model.actuator_ctrlrange[:, 1], 1.0)
    lowest = np.where(model.actuator_ctrllimited == 1, model.actuator_ctrlrange[:, 0], -1.0)
    for number in range(model.nu):
        name = model.actuator(number).name
        if model.actuator_trntype[number] != mujoco.mjtTrn.mjTRN_JOINT:
            raise InputError(f"robot: the motor {name} drives no joint; allowed: motors of joints")
        if limits[number] <= 0 or lowest[number] != -limits[number]:
            raise InputError(
                f"robot: the motor {name} has controls in [{lowest[number]:g}, "
                f"{limits[number]:g}], allowed: a range symmetric about zero"
            )
    return limits, model.actuator_trnid[:, 0].astype(np.int64)
