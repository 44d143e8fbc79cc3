"""Rerun recordings of episodes: the robot in 3-D beside everything it did, on one time line.

Entities, all over `sim_time` [s] and `control_step`:

| path | what | unit |
|---|---|---|
| /world/<body>/<geom> | the robot's shapes, moved with their bodies | m |
| /trail | the torso's path | m |
| /height/torso | height of the torso's centre | m |
| /reward/height | height reward of each control step, at its end | |
| /torque/<motor> | torque held from the control step's start | N m |
| /contact_force/<leg> | sum of the normal forces at a leg's contacts, and at the torso's | N |
| /contacts | number of contacts | |
| /phase | `grounded`, or `airborne` without any contact | |
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from jumping_ant import robot
from jumping_ant.errors import InputError
from jumping_ant.trajectory import Trajectory

APPLICATION_ID = "jumping-ant"
TIMELINE = "sim_time"
TRAIL_SECONDS = 3.0

BACKGROUND = (24, 28, 36)
FLOOR_COLOR = (52, 62, 76)
GRID_COLOR = (140, 156, 176, 90)
TORSO_COLOR = (232, 222, 204)
HEIGHT_COLOR = (120, 200, 255)
REWARD_COLOR = (160, 225, 140)
# One colour a leg, in the order of the bodies; the legs' shapes and series share it.
LEG_COLORS = ((240, 120, 90), (250, 195, 80), (90, 190, 170), (130, 140, 245))


@dataclass(frozen=True)
class _Episode:
    """What is recorded of a trajectory, worked out by the simulator.

    Attributes:
        rows: Recorded states' row numbers.
        times: Their times [ns], (num_rows,).
        steps: The control step each belongs to, (num_rows,).
        positions: World positions of the bodies [m], (num_rows, num_bodies, 3).
        quaternions: Their orientations (x, y, z, w), (num_rows, num_bodies, 4).
        forces: Normal contact force on each limb [N], (num_rows, num_limbs).
        contacts: Number of contacts, (num_rows,).
    """

    rows: NDArray[np.int64]
    times: NDArray[np.int64]
    steps: NDArray[np.int64]
    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]
    forces: NDArray[np.float64]
    contacts: NDArray[np.int64]


def record(xml: str, trajectory: Trajectory, agent: str) -> bytes:
    """Return an episode as the content of an `.rrd` file, with the layout it opens in.

    Recordings of equal trajectories hold equal data (`rerun rrd compare`), though not equal
    bytes: Rerun numbers its chunks by the clock.

    Args:
        xml: The robot.
        trajectory: The episode; it is recorded whole, at the simulation's rate.
        agent: The agent's name.

    Raises:
        InputError: The XML is not the robot, or has a shape that is not drawn.
    """
    model = robot.load(xml)
    episode = _replay(model, trajectory)
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else Rerun leaves out what it cannot take, with a warning
    try:
        return _write(model, trajectory, episode, agent)
    finally:
        rr.set_strict_mode(was_strict)


def body_names(model: mujoco.MjModel) -> list[str]:
    """Return the bodies' names; a nameless one, the tip of a leg, is its parent's foot."""
    names = [model.body(index).name for index in range(model.nbody)]
    for index, name in enumerate(names):
        if not name:
            names[index] = f"{names[model.body_parentid[index]]}_foot"
    return names


def geom_paths(model: mujoco.MjModel) -> list[str]:
    """Return the entity path of every geom; a nameless one is numbered."""
    bodies = body_names(model)
    paths = []
    for index in range(model.ngeom):
        name = model.geom(index).name or f"geom_{index}"
        body = model.geom_bodyid[index]
        paths.append(f"world/{bodies[body]}/{name}" if body else f"world/{name}")
    return paths


def limb_names(model: mujoco.MjModel) -> list[str]:
    """Return the names of the limbs: the torso and the legs that begin at it."""
    names = body_names(model)
    return [names[body] for body in _limb_roots(model)]


def _write(model: mujoco.MjModel, trajectory: Trajectory, episode: _Episode, agent: str) -> bytes:
    name = f"{agent}-seed-{trajectory.seed}-episode-{trajectory.episode}"
    # No batching by time: it would cut equal data into different chunks.
    batching = rr.ChunkBatcherConfig(flush_tick=3600.0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "episode.rrd"
        with rr.RecordingStream(
            APPLICATION_ID, recording_id=name, send_properties=False, batcher_config=batching
        ) as stream:
            stream.set_log_time_enabled(False)
            stream.save(path, default_blueprint=_blueprint(model))
            stream.send_recording_name(f"{agent}, seed {trajectory.seed}")
            _log_shapes(stream, model)
            _log_poses(stream, model, episode)
            _log_states(stream, model, episode)
            _log_control(stream, model, trajectory, episode)
        return path.read_bytes()


def _limb_roots(model: mujoco.MjModel) -> list[int]:
    torso = model.body(robot.TORSO).id
    return [torso, *np.flatnonzero(model.body_parentid == torso).tolist()]


def _limb_of_bodies(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the number of each body's limb, -1 for the world's, shape (num_bodies,)."""
    roots = _limb_roots(model)
    limbs = np.full(model.nbody, -1)
    for body in range(1, model.nbody):  # a parent comes before its children
        limbs[body] = roots.index(body) if body in roots else limbs[model.body_parentid[body]]
    return limbs


def _limb_color(limb: int) -> tuple[int, ...]:
    return TORSO_COLOR if limb == 0 else LEG_COLORS[(limb - 1) % len(LEG_COLORS)]


def _replay(model: mujoco.MjModel, trajectory: Trajectory) -> _Episode:
    """Work out poses and contacts at every recorded state."""
    rows = trajectory.rows()
    steps = np.minimum(rows // trajectory.frame_skip, len(trajectory.ctrl) - 1)
    limbs = _limb_of_bodies(model)[model.geom_bodyid]
    positions = np.empty((len(rows), model.nbody, 3))
    quaternions = np.empty((len(rows), model.nbody, 4))
    forces = np.zeros((len(rows), len(_limb_roots(model))))
    contacts = np.empty(len(rows), dtype=np.int64)
    data = mujoco.MjData(model)
    force = np.empty(6)
    for index, row in enumerate(rows):
        data.qpos[:], data.qvel[:] = trajectory.qpos[row], trajectory.qvel[row]
        data.ctrl[:] = trajectory.ctrl[steps[index]]
        mujoco.mj_forward(model, data)
        positions[index], quaternions[index] = data.xpos, np.roll(data.xquat, -1, axis=1)
        contacts[index] = data.ncon
        for number, pair in enumerate(data.contact.geom):
            mujoco.mj_contactForce(model, data, number, force)
            for limb in limbs[pair]:
                if limb >= 0:
                    forces[index, limb] += force[0]
    times = np.rint(rows * trajectory.timestep * 1e9).astype(np.int64)
    return _Episode(rows, times, steps, positions, quaternions, forces, contacts)


def _indexes(times: NDArray[np.int64], steps: NDArray[np.int64]) -> list[rr.TimeColumn]:
    return [
        rr.TimeColumn(TIMELINE, duration=times.astype("timedelta64[ns]")),
        rr.TimeColumn("control_step", sequence=steps),
    ]


def _log_shapes(stream: rr.RecordingStream, model: mujoco.MjModel) -> None:
    """Log every geom once, in the frame of its body."""
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    limbs = _limb_of_bodies(model)
    for index, path in enumerate(geom_paths(model)):
        limb = limbs[model.geom_bodyid[index]]
        color = FLOOR_COLOR if limb < 0 else _limb_color(limb)
        stream.log(path, _shape(model, index, color), static=True)


def _shape(
    model: mujoco.MjModel, geom: int, color: tuple[int, ...]
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


def _log_poses(stream: rr.RecordingStream, model: mujoco.MjModel, episode: _Episode) -> None:
    """Log where every body is, and the torso's trail."""
    indexes = _indexes(episode.times, episode.steps)
    for body, name in enumerate(body_names(model)):
        if body == 0:
            continue
        poses = rr.Transform3D.columns(
            translation=episode.positions[:, body], quaternion=episode.quaternions[:, body]
        )
        stream.send_columns(f"world/{name}", indexes, poses)
    torso = episode.positions[:, model.body(robot.TORSO).id]
    ends = np.repeat(torso, 2, axis=0)[1:-1]
    trail = rr.LineStrips3D.columns(strips=ends.reshape(-1, 2, 3).astype(np.float32))
    stream.send_columns("trail", _indexes(episode.times[1:], episode.steps[1:]), trail)
    style = rr.LineStrips3D.from_fields(colors=[HEIGHT_COLOR], radii=[0.012])
    stream.log("trail", style, static=True)


def _log_states(stream: rr.RecordingStream, model: mujoco.MjModel, episode: _Episode) -> None:
    """Log the series that have a value at every simulation step: height and contacts."""
    indexes = _indexes(episode.times, episode.steps)
    height = episode.positions[:, model.body(robot.TORSO).id, 2]
    _log_line(stream, "height/torso", indexes, height, "torso height [m]", HEIGHT_COLOR)
    _log_line(stream, "contacts", indexes, episode.contacts, "contacts", GRID_COLOR)
    for limb, name in enumerate(limb_names(model)):
        label, force = name.replace("_", " "), episode.forces[:, limb]
        _log_line(stream, f"contact_force/{name}", indexes, force, label, _limb_color(limb))
    _log_phase(stream, episode)


def _log_control(
    stream: rr.RecordingStream,
    model: mujoco.MjModel,
    trajectory: Trajectory,
    episode: _Episode,
) -> None:
    """Log the series that have a value in every control step: torques and reward."""
    last = len(episode.rows) - 1
    starts = np.arange(0, last, trajectory.frame_skip)
    indexes = _indexes(episode.times[starts], episode.steps[starts])
    torques = trajectory.ctrl[: len(starts)] * model.actuator_gear[:, 0]
    for motor in range(model.nu):
        name, color = model.actuator(motor).name, _limb_color(_limb_of_motor(model, motor))
        _log_line(stream, f"torque/{name}", indexes, torques[:, motor], name, color, steps=True)
    starts = starts[starts + trajectory.frame_skip <= last]  # the others earned nothing
    ends = starts + trajectory.frame_skip
    indexes = _indexes(episode.times[ends], episode.steps[starts])
    rewards = trajectory.reward_height[: len(ends)]
    _log_line(stream, "reward/height", indexes, rewards, "height reward", REWARD_COLOR)


def _limb_of_motor(model: mujoco.MjModel, motor: int) -> int:
    joint = model.actuator_trnid[motor, 0]
    return int(_limb_of_bodies(model)[model.jnt_bodyid[joint]])


def _log_line(
    stream: rr.RecordingStream,
    path: str,
    indexes: list[rr.TimeColumn],
    values: NDArray[np.float64] | NDArray[np.int64],
    label: str,
    color: tuple[int, ...],
    steps: bool = False,
) -> None:
    """Log a series and how it is drawn; `steps` holds each value until the next."""
    mode = rr.components.InterpolationMode.StepAfter if steps else None
    style = rr.SeriesLines(names=[label], colors=[color], widths=[1.5], interpolation_mode=mode)
    stream.log(path, style, static=True)
    stream.send_columns(path, indexes, rr.Scalars.columns(scalars=values))


def _log_phase(stream: rr.RecordingStream, episode: _Episode) -> None:
    """Log when the robot leaves the ground and when it is back."""
    airborne = episode.contacts == 0
    changes = np.flatnonzero(np.diff(airborne, prepend=~airborne[0]))
    states = np.where(airborne[changes], "airborne", "grounded")
    colors = [HEIGHT_COLOR, LEG_COLORS[1]]
    style = rr.StateConfiguration(values=["airborne", "grounded"], colors=colors)
    stream.log("phase", style, static=True)
    indexes = _indexes(episode.times[changes], episode.steps[changes])
    stream.send_columns("phase", indexes, rr.StateChange.columns(state=states.tolist()))


def _blueprint(model: mujoco.MjModel) -> rrb.Blueprint:
    """Arrange the robot, followed by the camera, beside the series."""
    recent = _around(before=TRAIL_SECONDS)
    scene = rrb.Spatial3DView(
        origin="/",
        contents=["/world/**", "/trail"],
        name="Robot",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(spacing=1.0, color=GRID_COLOR, stroke_width=1.0),
        eye_controls=rrb.EyeControls3D(
            position=(4.5, -4.5, 2.7),
            look_target=(0.0, 0.0, 0.75),
            tracking_entity=f"/world/{robot.TORSO}",
        ),
        overrides={"/trail": rrb.VisibleTimeRanges(timeline=TIMELINE, range=recent)},
    )
    motors = [model.actuator(motor).name for motor in range(model.nu)]
    kinds = dict.fromkeys(sorted((name.partition("_")[0] for name in motors), reverse=True))
    torques = {
        kind: [f"/torque/{name}" for name in motors if name.startswith(kind)] for kind in kinds
    }
    plots = [
        rrb.TimeSeriesView(
            origin="/height", name="Torso height [m]", plot_legend=rrb.PlotLegend(visible=False)
        ),
        rrb.TimeSeriesView(
            origin="/reward",
            name="Reward per control step",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        rrb.StateTimelineView(origin="/phase", name="Phase"),
        *(
            _close_up(f"{kind.capitalize()} torques [N m]", paths)
            for kind, paths in torques.items()
        ),
        _close_up("Contact forces [N]", ["/contact_force/**"]),
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            scene, rrb.Vertical(*plots, row_shares=[5, 3.5, 3.2, 6, 6, 7]), column_shares=[3, 2]
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", loop_mode="all", play_state="playing"),
        collapse_panels=True,
    )


def _close_up(name: str, paths: list[str]) -> rrb.TimeSeriesView:
    """Plot fast series around the current time only."""
    return rrb.TimeSeriesView(
        origin="/",
        contents=paths,
        name=name,
        axis_x=rrb.TimeAxis(view_range=_around(before=1.5, after=3.5)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def _around(before: float, after: float = 0.0) -> rr.TimeRange:
    """Return the range from `before` to `after` around the current time [s]."""
    return rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-before),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=after),
    )
