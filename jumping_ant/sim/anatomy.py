"""The anatomy of a compiled robot: its torso and how it moves, its motors, its sizes.

A robot is a tree of bodies on a floor. Its first body that moves relative to the world is its
torso, which moves either freely (Ant, Humanoid) or in the x-z plane (Hopper, Walker2d, HalfCheetah:
slides along x and z, and a hinge that tilts it). All its motors drive joints.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import mjtJoint
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError

Array = NDArray[np.float64]

_PLANAR = [mjtJoint.mjJNT_SLIDE, mjtJoint.mjJNT_SLIDE, mjtJoint.mjJNT_HINGE]


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
        """Return the anatomy of a compiled robot, or raise an InputError."""
        torso = _torso(model)
        joints = np.flatnonzero(model.jnt_bodyid == torso)
        kinds = model.jnt_type[joints].tolist()
        axes = np.abs(model.jnt_axis[joints[:2]]).round(6).tolist()
        if kinds == [mjtJoint.mjJNT_FREE]:
            horizontal, height, orientation, level, offset = 2, 2, slice(3, 7), 0.0, 0.0
        elif kinds == _PLANAR and axes == [[1, 0, 0], [0, 0, 1]]:
            _, height, tilt = model.jnt_qposadr[joints].tolist()
            horizontal, orientation, level = 1, slice(tilt, tilt + 1), float(model.qpos0[tilt])
            offset = float(model.body_pos[torso, 2] - model.qpos0[height])
        else:
            names = ", ".join(model.joint(joint).name or "a nameless one" for joint in joints)
            raise InputError(
                f"robot: given a torso on the joints {names}, allowed: a free joint, or slides "
                "along x and z and a hinge, in this order"
            )
        limits = _control_limits(model)
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
            motor_joints=model.actuator_trnid[:, 0].astype(np.int64),
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
    if len(moving) != 1:
        raise InputError(
            f"robot: given {len(moving)} bodies that move relative to the world, allowed: one, "
            "the torso"
        )
    if model.body_jntadr[moving[0]] != 0:
        first = model.joint(0).name or "a nameless one"
        raise InputError(
            f"robot: given the joint {first} before those of the torso, allowed: after them"
        )
    return int(moving[0])


def _control_limits(model: mujoco.MjModel) -> Array:
    if model.nu == 0:
        raise InputError("robot: given no motor, allowed: one or more")
    is_limited = model.actuator_ctrllimited[:, None] == 1
    low, high = np.where(is_limited, model.actuator_ctrlrange, [-1.0, 1.0]).T.copy()
    for number in range(model.nu):
        name = model.actuator(number).name
        if model.actuator_trntype[number] != mujoco.mjtTrn.mjTRN_JOINT:
            raise InputError(f"robot: the motor {name} drives no joint; allowed: motors of joints")
        if high[number] <= 0 or low[number] != -high[number]:
            raise InputError(
                f"robot: the motor {name} has controls in [{low[number]:g}, {high[number]:g}], "
                "allowed: a range symmetric about zero"
            )
    return high
