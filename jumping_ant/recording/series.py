"""The series plotted over time: height, contacts, torques, reward, and the phases of a jump."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.recording.parts import LEG_COLORS, Color, limb_color, limb_names, limbs_of_motors
from jumping_ant.recording.scene import TRAIL_COLOR, torso_heights
from jumping_ant.recording.states import States, indexes
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

HEIGHT_COLOR: Color = TRAIL_COLOR
REWARD_COLOR: Color = (160, 225, 140)
CONTACTS_COLOR: Color = (140, 156, 176)
PHASE_COLORS: dict[str, Color] = {"airborne": TRAIL_COLOR, "grounded": LEG_COLORS[1]}


def log_styles(stream: rr.RecordingStream, world: World, rewards: Sequence[str]) -> None:
    """Log the name and colour of every series; `rewards` are the names of `reward_series`."""
    log_style(stream, "height/torso", "torso height [m]", HEIGHT_COLOR)
    log_style(stream, "contacts", "contacts", CONTACTS_COLOR)
    for number, name in enumerate(rewards):
        color = (REWARD_COLOR, *LEG_COLORS)[number % (1 + len(LEG_COLORS))]
        log_style(stream, f"reward/{name}", name.replace("_", " "), color)
    for limb, name in enumerate(limb_names(world)):
        log_style(stream, f"contact_force/{name}", name.replace("_", " "), limb_color(limb))
    for motor, limb in enumerate(limbs_of_motors(world)):
        name = world.model.actuator(motor).name
        log_style(stream, f"torque/{name}", name, limb_color(limb), steps=True)
    phases = rr.StateConfiguration(values=list(PHASE_COLORS), colors=list(PHASE_COLORS.values()))
    stream.log("phase", phases, static=True)


def log_style(
    stream: rr.RecordingStream, path: str, label: str, color: Color, steps: bool = False
) -> None:
    """Log how a series is drawn; `steps` holds each value until the next."""
    mode = rr.components.InterpolationMode.StepAfter if steps else None
    style = rr.SeriesLines(names=[label], colors=[color], widths=[1.5], interpolation_mode=mode)
    stream.log(path, style, static=True)


def log_states(stream: rr.RecordingStream, world: World, states: States) -> None:
    """Log the series that have a value in every state: height and contacts."""
    log_line(stream, "height/torso", states, torso_heights(world, states))
    log_line(stream, "contacts", states, states.contacts)
    for limb, name in enumerate(limb_names(world)):
        log_line(stream, f"contact_force/{name}", states, states.normal_forces[:, limb])
    _log_phases(stream, states)


def log_line(
    stream: rr.RecordingStream,
    path: str,
    states: States,
    values: NDArray[np.float64] | NDArray[np.int64],
) -> None:
    """Log a series that has a value in every state."""
    columns = indexes(states.times, states.steps)
    stream.send_columns(path, columns, rr.Scalars.columns(scalars=values))


def log_control(
    stream: rr.RecordingStream,
    world: World,
    trajectory: Trajectory,
    num_rows: int,
) -> None:
    """Log the series with a value per control step: torques at its start, reward at its end.

    A step that the `num_rows` recorded states do not complete has no reward.
    """
    skip, last = trajectory.frame_skip, num_rows - 1
    begun, ended = -(-last // skip), last // skip
    steps = np.arange(begun)
    times = np.rint(np.arange(begun + 1) * skip * trajectory.timestep * 1e9).astype(np.int64)
    torques = trajectory.torques[:begun] * world.anatomy.peak_torques
    columns = indexes(times[:-1], steps)
    for motor in range(world.anatomy.num_motors):
        values = rr.Scalars.columns(scalars=torques[:, motor])
        stream.send_columns(f"torque/{world.model.actuator(motor).name}", columns, values)
    columns = indexes(times[1 : ended + 1], steps[:ended])
    for name, earned in reward_series(trajectory).items():
        stream.send_columns(f"reward/{name}", columns, rr.Scalars.columns(scalars=earned[:ended]))


def reward_series(trajectory: Trajectory) -> dict[str, NDArray[np.float64]]:
    """Return the terms of the reward, and their sum where there are several, by name."""
    total = {"total": trajectory.rewards} if len(trajectory.terms) != 1 else {}
    return total | trajectory.terms


def _log_phases(stream: rr.RecordingStream, states: States) -> None:
    """Log when the robot leaves the ground and when it is back."""
    airborne = states.contacts == 0
    changes = np.flatnonzero(np.diff(airborne, prepend=~airborne[0]))
    phases = np.where(airborne[changes], "airborne", "grounded")
    columns = indexes(states.times[changes], states.steps[changes])
    stream.send_columns("phase", columns, rr.StateChange.columns(state=phases.tolist()))
