"""The report's charts of what agents do in their films."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from jumping_ant.base.paths import Paths
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment import episodes
from jumping_ant.experiment.models import Params
from jumping_ant.looks.style import Look
from jumping_ant.report import charts
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.anatomy import Anatomy

Array = NDArray[np.float64]

TORQUE_SECONDS = 4.0  # shown of each film, around its highest moment


@dataclass(frozen=True, eq=False)
class FilmedEpisode:
    """The part of an episode that an agent's film shows."""

    seed: int
    episode: int
    episode_return: float  # of the whole episode
    times: Array  # of the simulation steps [s], (num_steps + 1,)
    heights: Array  # of the torso's centre at those times [m], (num_steps + 1,)
    torques: Array  # over peak torques, held in each control step, (num_control_steps, num_motors)
    step_seconds: float  # duration of a control step [s]


def read(root: Path, params: Params, agent: AgentResults) -> FilmedEpisode:
    """Read the content of an agent's film."""
    path = Paths(root).agent(agent.name).trajectory
    episode = trajectory.load(path)
    episodes.find(agent.episodes, agent.name, episode, path)
    rows = episode.rows(seconds=params.record.seconds)
    model = robot.load(robot.read(root, agent.block.robot))
    return FilmedEpisode(
        seed=episode.seed,
        episode=episode.episode,
        episode_return=episode.episode_return,
        times=np.asarray(rows * episode.timestep, dtype=np.float64),
        heights=Anatomy.of(model).heights(episode.qpos[rows]),
        torques=episode.torques[: (len(rows) - 1) // episode.frame_skip],
        step_seconds=episode.timestep * episode.frame_skip,
    )


def heights(
    results: Mapping[str, AgentResults],
    films: Mapping[str, FilmedEpisode],
    drawn: Mapping[str, Look],
    shown: Collection[str],
) -> go.Figure:
    """Draw the torso's height in each film; lines of agents not in `shown` are a click away."""
    figure = go.Figure()
    for name, agent in results.items():
        film, look = films[name], drawn[name]
        figure.add_scatter(
            x=np.round(film.times, 3).tolist(),
            y=np.round(film.heights, 3).tolist(),
            name=agent.label,
            mode="lines",
            line={"color": look.colour, "dash": charts.DASHES[look.line], "width": 1.6},
            hovertemplate="%{y:.2f} m",
            visible=True if name in shown else "legendonly",
        )
    figure.update_xaxes(title="time in the film [s]", hoverformat=".2f")
    figure.update_yaxes(title="height of the torso [m]", rangemode="tozero")
    if len(shown) == len(results):
        return charts.finish(figure, 360, hovermode="x unified")
    charts.finish(figure, 540, hovermode="x unified")  # with room for many names
    return figure.update_layout(legend={"y": -0.25, "entrywidth": 110, "font": {"size": 11}})


def torques(film: FilmedEpisode, motors: Sequence[str]) -> go.Figure:
    """Draw each motor's torque over the seconds around the highest moment of a film."""
    steps = _around_highest(film)
    figure = go.Figure()
    figure.add_heatmap(
        x=np.round(steps * film.step_seconds, 3).tolist(),
        y=[motor.replace("_", " ") for motor in motors],
        z=np.round(film.torques[steps].T, 3).tolist(),
        colorscale="RdBu",
        zmin=-1,
        zmax=1,
        showscale=False,
        hovertemplate="%{y} at %{x:.2f} s: %{z:.2f}<extra></extra>",
    )
    figure.update_xaxes(title="time [s]")
    return charts.finish(figure, 90 + 14 * len(motors), top=6)


def _around_highest(film: FilmedEpisode) -> NDArray[np.int64]:
    """Return the control steps around a film's highest moment."""
    length = len(film.torques)
    width = min(length, round(TORQUE_SECONDS / film.step_seconds))
    highest = int(film.times[film.heights.argmax()] / film.step_seconds)
    start = min(max(0, highest - width // 2), length - width)
    return np.arange(start, start + width)
