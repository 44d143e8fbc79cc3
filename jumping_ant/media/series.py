"""The series plotted over time: height, contacts, torques, reward, and the phases of a jump."""

from itertools import cycle

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.media.scene import TRAIL_COLOR
from jumping_ant.media.states import (
    LEG_COLORS,
    Color,
    States,
    limbs,
    limbs_of_bodies,
    motor_names,
    time_columns,
)
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

REWARD_COLOR: Color = (160, 225, 140)
CONTACTS_COLOR: Color = (140, 156, 176)
PHASE_COLORS: dict[str, Color] = {"airborne": TRAIL_COLOR, "grounded": LEG_COLORS["yellow"]}


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


def log_states(stream: rr.RecordingStream, world: World, states: States) -> None:
    """Log the series that have a value in every state: height and contacts."""
    columns = states.columns
    log_series(stream, "height/torso", "torso height [m]", TRAIL_COLOR, columns, states.heights)
    log_series(stream, "contacts", "contacts", CONTACTS_COLOR, columns, states.contacts)
    for limb, (name, color) in enumerate(limbs(world).items()):
        path, forces = f"contact_force/{name}", states.normal_forces[:, limb]
        log_series(stream, path, name.replace("_", " "), color, columns, forces)
    _log_phases(stream, states)


def log_control(
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


def _log_phases(stream: rr.RecordingStream, states: States) -> None:
    """Log when the robot leaves the ground and when it is back."""
    style = rr.StateConfiguration(values=list(PHASE_COLORS), colors=list(PHASE_COLORS.values()))
    stream.log("phase", style, static=True)
    airborne = states.contacts == 0
    changes = np.flatnonzero(np.diff(airborne, prepend=~airborne[0]))
    phases = np.where(airborne[changes], "airborne", "grounded")
    columns = time_columns(states.times[changes], states.steps[changes])
    stream.send_columns("phase", columns, rr.StateChange.columns(state=phases.tolist()))
