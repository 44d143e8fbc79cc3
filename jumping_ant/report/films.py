"""What agents do in their films: charts and pictures, small enough to embed in the page."""

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import mujoco
import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from jumping_ant.agents.families import by_family
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.comparison.results import AgentResults
from jumping_ant.evaluation import episodes
from jumping_ant.media import drawing, rendering
from jumping_ant.media.drawing import Shots
from jumping_ant.params.model import Params
from jumping_ant.report import charts
from jumping_ant.report.outcome import Outcome
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.anatomy import Anatomy
from jumping_ant.sim.trajectory import Trajectory

Array = NDArray[np.float64]

TORQUE_SECONDS = 4.0  # shown of each film, around its highest moment
SIZE = 360  # [pixels] side of a robot's picture
SHADOW_SIZE = 2048  # [pixels] side of its shadow map
CAMERA = {"distance": 3.4, "azimuth": 112.0, "elevation": -20.0}
JPEG_QUALITY = 85


@dataclass(frozen=True, eq=False)
class Film:
    """The part of an episode that an agent's film shows."""

    episode: Trajectory  # all of it
    times: Array  # of the simulation steps [s], (num_steps + 1,)
    heights: Array  # of the torso's centre at those times [m], (num_steps + 1,)
    torques: Array  # over peak torques, held in each control step, (num_control_steps, num_motors)


def read(root: Path, params: Params, agent: AgentResults) -> Film:
    """Read the content of an agent's film."""
    path = Paths(root).agent(agent.name).trajectory
    episode = trajectory.load(path)
    episodes.find(agent.episodes, agent.name, episode, path)
    rows = episode.rows(seconds=params.record.seconds)
    anatomy = Anatomy.of(robot.load(robot.read(root, agent.block.robot)))
    times = np.asarray(rows * episode.timestep, dtype=np.float64)
    torques = episode.torques[: (len(rows) - 1) // episode.frame_skip]
    return Film(episode, times, anatomy.heights(episode.qpos[rows]), torques)


def figures(root: Path, outcome: Outcome, films: Mapping[str, Film]) -> dict[str, go.Figure]:
    """Return the charts of films by their places: the heights in all, the torques of each."""
    model = robot.load(robot.read(root))
    motors = [model.actuator(index).name for index in range(model.nu)]
    by_place = {f"torques_{name}": _torques(film, motors) for name, film in films.items()}
    return by_place | {"heights": _heights(outcome, films)}


def _heights(outcome: Outcome, films: Mapping[str, Film]) -> go.Figure:
    """Draw the torso's height in each film.

    Of many agents each family's best, which comes first, is shown; a click shows the others.
    """
    best = [names[0] for names in by_family(outcome.families).values()]
    shown = best if outcome.is_crowded else [*outcome.results]
    figure = go.Figure()
    for name, agent in outcome.results.items():
        film, look = films[name], outcome.looks[name]
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
    is_partial = len(shown) < len(outcome.results)
    charts.finish(figure, 540 if is_partial else 360, hovermode="x unified")
    if is_partial:
        figure.update_layout(legend={"y": -0.25, "entrywidth": 110, "font": {"size": 11}})
    return figure


def _torques(film: Film, motors: Sequence[str]) -> go.Figure:
    """Draw each motor's torque over the seconds around the highest moment of a film."""
    step_seconds = film.episode.timestep * film.episode.frame_skip
    width = min(len(film.torques), round(TORQUE_SECONDS / step_seconds))
    highest = int(film.times[film.heights.argmax()] / step_seconds)
    start = min(max(0, highest - width // 2), len(film.torques) - width)
    steps = np.arange(start, start + width)
    figure = go.Figure()
    figure.add_heatmap(
        x=np.round(steps * step_seconds, 3).tolist(),
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


def still(film: Path, seconds: float) -> str:
    """Return a film's frame at a time [s], as a data URI."""
    try:
        reader: Any = imageio.get_reader(film, format="FFMPEG")
        with reader:
            return _data_uri(reader.get_data(int(seconds * reader.get_meta_data()["fps"])))
    except (OSError, IndexError) as error:
        reason = str(error).strip().partition("\n")[0]
        raise InputError(f"{film}: {reason}; run `dvc repro --force record@{film.stem}`") from error


def portrait(xml: str) -> str:
    """Return a picture of a robot as it stands at the start, as a data URI."""
    model = rendering.scene(xml, SHADOW_SIZE)
    data = mujoco.MjData(model)
    lookat = np.array([[0.0, 0.0, 0.6]])
    shots = Shots(model, data.qpos[None], lookat, SIZE, SIZE, **CAMERA)
    return _data_uri(next(drawing.draw(shots, processes=1)))


def _data_uri(picture: NDArray[np.uint8]) -> str:
    """Return a picture, shape (height, width, 3), as the data URI of a JPEG file."""
    content = io.BytesIO()
    imageio.imwrite(content, picture, format="jpg", quality=JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(content.getvalue()).decode()
