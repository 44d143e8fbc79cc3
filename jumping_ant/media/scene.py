"""What recordings show of an episode: the robot in 3-D, and series over time."""

from itertools import cycle

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.media.states import (
    LEG_COLORS,
    Color,
    States,
    limbs,
    limbs_of_bodies,
    motor_names,
    time_columns,
)
from jumping_ant.sim.robot import body_names
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

FLOOR_COLOR: Color = (52, 62, 76)
TRAIL_COLOR: Color = (120, 200, 255)
CAMERA_REACH = 1.4  # [m] from the torso's centre, which the camera should show
METRES_PER_NEWTON = 0.01  # length of the arrows of contact forces
REWARD_COLOR: Color = (160, 225, 140)
CONTACTS_COLOR: Color = (140, 156, 176)
PHASE_COLORS: dict[str, Color] = {"airborne": TRAIL_COLOR, "grounded": LEG_COLORS["yellow"]}


def log_scene(
    stream: rr.RecordingStream,
    world: World,
    states: States,
    root: str = "",
    color: Color | None = None,
) -> None:
    """Log a robot in 3-D under `root`, which is empty or a name and a slash.

    The torso and its trail have the `color`, by default one each.
    """
    colors = list(limbs(world).values())
    colors[0] = color or colors[0]
    _log_shapes(stream, world, root, colors)
    trail = rr.LineStrips3D.from_fields(colors=[color or TRAIL_COLOR], radii=[0.012])
    stream.log(f"{root}trail", trail, static=True)
    _log_poses(stream, world, states, root)


def log_series(
    stream: rr.RecordingStream,
    path: str,
    label: str,
    color: Color,
    columns: list[rr.TimeColumn],
    values: NDArray[np.float64] | NDArray[np.int64],
    is_held: bool = False,
) -> None:
    """Log a series and how it is drawn: `is_held` holds each value until the next."""
    mode = rr.components.InterpolationMode.StepAfter if is_held else None
    style = rr.SeriesLines(names=[label], colors=[color], widths=[1.5], interpolation_mode=mode)
    stream.log(path, style, static=True)
    stream.send_columns(path, columns, rr.Scalars.columns(scalars=values))


def log_state_series(stream: rr.RecordingStream, world: World, states: States) -> None:
    """Log the series that have a value in every state: height and contacts."""
    columns = states.columns
    log_series(stream, "height/torso", "torso height [m]", TRAIL_COLOR, columns, states.heights)
    log_series(stream, "contacts", "contacts", CONTACTS_COLOR, columns, states.contacts)
    for limb, (name, color) in enumerate(limbs(world).items()):
        path, forces = f"contact_force/{name}", states.normal_forces[:, limb]
        log_series(stream, path, name.replace("_", " "), color, columns, forces)
    _log_phases(stream, states)


def log_control_series(
    stream: rr.RecordingStream, world: World, trajectory: Trajectory, states: States
) -> None:
    """Log the series with a value per control step: torques at its start, reward at its end.

    A step that the states do not complete has no reward.
    """
    skip, last = trajectory.frame_skip, len(states.times) - 1
    begun, ended = -(-last // skip), last // skip
    steps = np.arange(begun)
    times = np.rint(np.arange(begun + 1) * skip * trajectory.timestep * 1e9).astype(np.int64)
    torques = trajectory.torques[:begun] * world.anatomy.peak_torques
    columns = time_columns(times[:-1], steps)
    colors, numbers = list(limbs(world).values()), limbs_of_bodies(world)
    moved = numbers[world.model.jnt_bodyid[world.anatomy.motor_joints]]
    for name, limb, held in zip(motor_names(world), moved, torques.T, strict=True):
        log_series(stream, f"torque/{name}", name, colors[limb], columns, held, is_held=True)
    columns = time_columns(times[1 : ended + 1], steps[:ended])
    total = {"total": trajectory.rewards} if len(trajectory.terms) != 1 else {}
    terms, colors = total | trajectory.terms, [REWARD_COLOR, *LEG_COLORS.values()]
    for (name, earned), color in zip(terms.items(), cycle(colors)):
        label = name.replace("_", " ")
        log_series(stream, f"reward/{name}", label, color, columns, earned[:ended])


def geom_paths(world: World) -> list[str]:
    """Return the entity path of every geom; an unnamed one is numbered."""
    model, bodies = world.model, body_names(world.model)
    paths = []
    for index, body in enumerate(model.geom_bodyid):
        name = model.geom(index).name or f"geom_{index}"
        paths.append(f"world/{bodies[body]}/{name}" if body else f"world/{name}")
    return paths


def camera_path(world: World) -> str:
    """Return the path of the entity that the camera follows."""
    return f"world/{body_names(world.model)[world.anatomy.torso]}/camera"


def _log_shapes(stream: rr.RecordingStream, world: World, root: str, colors: list[Color]) -> None:
    """Log static data: every geom in the frame of its body, and the drawing styles."""
    stream.log(root or "/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    numbers = limbs_of_bodies(world)[world.model.geom_bodyid]
    for geom, path in enumerate(geom_paths(world)):
        color = FLOOR_COLOR if numbers[geom] < 0 else colors[numbers[geom]]
        stream.log(root + path, _shape(world.model, geom, color), static=True)
    # A camera follows a drawn entity, at a distance that shows all of it: points of zero size.
    reach = [[-CAMERA_REACH] * 3, [CAMERA_REACH] * 3]
    points = rr.Points3D(reach, radii=rr.Radius.ui_points(0.0))
    stream.log(root + camera_path(world), points, static=True)
    for name, color in zip(limbs(world), colors, strict=True):
        arrow = rr.Arrows3D.from_fields(colors=[color], radii=[0.03])
        stream.log(f"{root}contact_arrow/{name}", arrow, static=True)


def _log_poses(stream: rr.RecordingStream, world: World, states: States, root: str) -> None:
    for body, name in enumerate(body_names(world.model)[1:], start=1):
        poses = rr.Transform3D.columns(
            translation=states.positions[:, body], quaternion=states.quaternions[:, body]
        )
        stream.send_columns(f"{root}world/{name}", states.columns, poses)
    # The torso's path from each state to the next, at the latter's time.
    torso = states.positions[:, world.anatomy.torso]
    ways = np.stack([torso[:-1], torso[1:]], axis=1).astype(np.float32)
    columns = time_columns(states.times[1:], states.steps[1:])
    stream.send_columns(f"{root}trail", columns, rr.LineStrips3D.columns(strips=ways))
    for limb, name in enumerate(limbs(world)):
        # A row without contact has no arrow, which clears the last one.
        touches = states.limb_contacts[:, limb] > 0
        arrows = rr.Arrows3D.columns(
            vectors=METRES_PER_NEWTON * states.contact_forces[touches, limb],
            origins=states.contact_points[touches, limb],
        ).partition(touches.astype(np.int64))
        stream.send_columns(f"{root}contact_arrow/{name}", states.columns, arrows)


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


def _log_phases(stream: rr.RecordingStream, states: States) -> None:
    style = rr.StateConfiguration(values=list(PHASE_COLORS), colors=list(PHASE_COLORS.values()))
    stream.log("phase", style, static=True)
    airborne = states.contacts == 0
    changes = np.flatnonzero(np.diff(airborne, prepend=~airborne[0]))
    phases = np.where(airborne[changes], "airborne", "grounded")
    columns = time_columns(states.times[changes], states.steps[changes])
    stream.send_columns("phase", columns, rr.StateChange.columns(state=phases.tolist()))
