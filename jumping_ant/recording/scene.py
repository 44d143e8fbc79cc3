"""The robot in 3-D: its shapes, the poses of its bodies, the torso's trail, the contact forces."""

from dataclasses import dataclass

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.recording.parts import (
    FLOOR_COLOR,
    TORSO_COLOR,
    Color,
    body_names,
    geom_paths,
    limb_color,
    limb_names,
    limbs_of_bodies,
)
from jumping_ant.recording.states import States, indexes
from jumping_ant.sim.world import World

TRAIL_COLOR: Color = (120, 200, 255)
CAMERA_REACH = 1.4  # [m] from the torso's centre, which the camera should show
METRES_PER_NEWTON = 0.01  # length of the arrows of contact forces


@dataclass(frozen=True)
class Scene:
    """One robot in a recording."""

    stream: rr.RecordingStream
    world: World
    root: str = ""  # prefix of its entity paths: empty, or a name and a slash
    torso_color: Color = TORSO_COLOR  # of the torso's shape and arrow
    trail_color: Color = TRAIL_COLOR

    def log_shapes(self) -> None:
        """Log static data: every geom in the frame of its body, and the drawing styles."""
        self.stream.log(self.root or "/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        limbs = limbs_of_bodies(self.world)[self.world.model.geom_bodyid]
        for geom, path in enumerate(geom_paths(self.world)):
            color = FLOOR_COLOR if limbs[geom] < 0 else self._color(limbs[geom])
            self.stream.log(self.root + path, _shape(self.world.model, geom, color), static=True)
        # A camera follows a drawn entity, at a distance that shows all of it: points of zero size.
        reach = [[-CAMERA_REACH] * 3, [CAMERA_REACH] * 3]
        points = rr.Points3D(reach, radii=rr.Radius.ui_points(0.0))
        self.stream.log(self.root + camera_path(self.world), points, static=True)
        trail = rr.LineStrips3D.from_fields(colors=[self.trail_color], radii=[0.012])
        self.stream.log(f"{self.root}trail", trail, static=True)
        for limb, name in enumerate(limb_names(self.world)):
            arrow = rr.Arrows3D.from_fields(colors=[self._color(limb)], radii=[0.03])
            self.stream.log(f"{self.root}contact_arrow/{name}", arrow, static=True)

    def log_states(self, states: States) -> None:
        """Log the poses of all bodies, the torso's trail, and the contact forces as arrows."""
        columns = indexes(states.times, states.steps)
        for body, name in enumerate(body_names(self.world)):
            if body == 0:
                continue
            poses = rr.Transform3D.columns(
                translation=states.positions[:, body], quaternion=states.quaternions[:, body]
            )
            self.stream.send_columns(f"{self.root}world/{name}", columns, poses)
        self._log_trail(states)
        for limb, name in enumerate(limb_names(self.world)):
            # A row without contact has no arrow, which clears the last one.
            touches = states.limb_contacts[:, limb] > 0
            arrows = rr.Arrows3D.columns(
                vectors=METRES_PER_NEWTON * states.contact_forces[touches, limb],
                origins=states.contact_points[touches, limb],
            ).partition(touches.astype(np.int64))
            self.stream.send_columns(f"{self.root}contact_arrow/{name}", columns, arrows)

    def _log_trail(self, states: States) -> None:
        """Log the torso's path from each state to the next, at the latter's time."""
        torso = states.positions[:, self.world.anatomy.torso]
        ways = np.stack([torso[:-1], torso[1:]], axis=1).astype(np.float32)
        columns = indexes(states.times[1:], states.steps[1:])
        self.stream.send_columns(f"{self.root}trail", columns, rr.LineStrips3D.columns(strips=ways))

    def _color(self, limb: int) -> Color:
        return self.torso_color if limb == 0 else limb_color(limb)


def camera_path(world: World) -> str:
    """Return the path of the entity that the camera follows."""
    return f"world/{body_names(world)[world.anatomy.torso]}/camera"


def torso_heights(world: World, states: States) -> NDArray[np.float64]:
    """Return the height of the torso's centre in each state [m], shape (num_rows,)."""
    heights: NDArray[np.float64] = states.positions[:, world.anatomy.torso, 2]
    return heights


def time_of_peak(world: World, states: States, until: int) -> int:
    """Return when the torso is highest [ns], up to a time [ns]."""
    heights = torso_heights(world, states)[states.times <= until]
    return int(states.times[np.argmax(heights)])


def _shape(
    model: mujoco.MjModel, geom: int, color: Color
) -> rr.Capsules3D | rr.Ellipsoids3D | rr.Boxes3D:
    kind, size, center = model.geom_type[geom], model.geom_size[geom], model.geom_pos[geom]
    quaternion = np.roll(model.geom_quat[geom], -1)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        axis = np.empty(3)  # Rerun's capsule begins where MuJoCo's has its centre
        mujoco.mju_rotVecQuat(axis, np.array([0.0, 0.0, size[1]]), model.geom_quat[geom])
        return rr.Capsules3D(
            lengths=[2 * size[1]],
            radii=[size[0]],
            translations=[center - axis],
            quaternions=[quaternion],
            colors=[color],
            fill_mode="solid",
        )
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return rr.Ellipsoids3D(radii=[size[0]], centers=[center], colors=[color], fill_mode="solid")
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        depth = 0.01  # [m] below the true surface, where the viewer draws its grid
        return rr.Boxes3D(
            half_sizes=[[size[0], size[1], depth / 2]],
            centers=[center - [0.0, 0.0, 1.5 * depth]],
            quaternions=[quaternion],
            colors=[color],
            fill_mode="solid",
        )
    raise InputError(
        f"robot XML: geom {model.geom(geom).name!r} is a {mujoco.mjtGeom(kind).name}; "
        "allowed: planes, spheres and capsules"
    )
