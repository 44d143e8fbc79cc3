"""The report's interactive charts, as Plotly figures.

Agents keep the colours and markers of all other figures (see `jumping_ant.words.looks`). Charts
show exactly what `results/` holds: nothing is smoothed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from jumping_ant.judging.comparison import LearningCurve
from jumping_ant.judging.results import AgentResults, steps_to
from jumping_ant.words import measures
from jumping_ant.words.looks import INK, Look, looks

Array = NDArray[np.float64]

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"
GRID = "#E6E8EC"
# Markers and lines of `jumping_ant.words.looks` in Plotly's terms.
SYMBOLS = {
    "o": "circle",
    "s": "square",
    "^": "triangle-up",
    "D": "diamond",
    "v": "triangle-down",
    "P": "cross",
    "X": "x",
    "x": "x-thin-open",
}
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
# Plotly chooses the numbers: powers of ten on a long axis, digits between them on a shorter one,
# even steps within a decade. `nticks` is low enough to keep long axes to powers.
LOG_AXIS = {"type": "log", "tickformat": "~s", "nticks": 4}
NUM_THRESHOLDS = 60
TORQUE_SECONDS = 4.0  # shown of each film, around its highest moment


@dataclass(frozen=True)
class FilmedEpisode:
    """The content of an agent's film.

    Attributes:
        seed: The agent's seed.
        episode: Number of the episode among that seed's.
        episode_return: Sum of the rewards of the whole episode.
        times: Times of the simulation steps [s], (num_steps + 1,).
        heights: Heights of the torso's centre at those times [m], (num_steps + 1,).
        torques: Torques over peak torques, held in each control step, (num_control_steps, 8).
        step_seconds: Duration of a control step [s].
    """

    seed: int
    episode: int
    episode_return: float
    times: Array
    heights: Array
    torques: Array
    step_seconds: float


def learning(
    results: Mapping[str, AgentResults], curves: Mapping[str, LearningCurve], against: str
) -> go.Figure:
    """Draw the return while learning, with its interval.

    Args:
        results: What `results.load` returns.
        curves: What `comparison.learning_curves` returns.
        against: `env_steps` or `seconds`.
    """
    figure = go.Figure()
    for name, look in _looks(results).items():
        curve = curves[name]
        x = getattr(curve, against)
        _add_band(figure, x, curve.returns.low, curve.returns.high, look, name)
        figure.add_scatter(
            x=x.tolist(),
            y=curve.returns.value.tolist(),
            name=results[name].label,
            legendgroup=name,
            mode="lines+markers" if look.line == "-" else "lines",
            line={"color": look.colour, "dash": DASHES[look.line]},
            marker={"symbol": SYMBOLS[look.marker], "size": 7},
            hovertemplate="%{y:,.0f}",
        )
    title = {"env_steps": "control steps", "seconds": "training time of a seed [s]"}[against]
    figure.update_xaxes(title=title, hoverformat=",.3~s", **LOG_AXIS)
    figure.update_yaxes(title="return of an evaluation episode", rangemode="tozero")
    return finish(figure, 380, hovermode="x unified")


def efficiency(results: Mapping[str, AgentResults]) -> go.Figure:
    """Draw the control steps after which half of the seeds had reached a return."""
    figure = go.Figure()
    learners = {name: agent for name, agent in results.items() if not agent.is_baseline}
    ends = [c.evaluations[1].max() for agent in learners.values() for c in agent.curves.values()]
    best = max(ends, default=0.0)
    thresholds = np.linspace(0, best, NUM_THRESHOLDS + 1)[1:]
    drawn = _looks(results)
    for name, agent in learners.items():
        steps = np.array([_median_steps(agent, threshold) for threshold in thresholds])
        reached = np.isfinite(steps)
        figure.add_scatter(
            x=thresholds[reached].tolist(),
            y=steps[reached].tolist(),
            name=agent.label,
            mode="lines",
            line={"color": drawn[name].colour, "shape": "hv", "width": 3},
            hovertemplate="%{y:,.0f} steps to a return of %{x:,.0f}",
        )
    figure.update_xaxes(title="return", hoverformat=",.0f", rangemode="tozero")
    figure.update_yaxes(title="control steps to reach it", **LOG_AXIS)
    return finish(figure, 380)


def episodes(
    results: Mapping[str, AgentResults], tables: Mapping[str, Mapping[str, Array]]
) -> go.Figure:
    """Draw every held-out episode, one measure at a time, chosen from a menu.

    Args:
        results: What `results.load` returns.
        tables: Columns of each agent's `episodes.csv`, (num_episodes,) each.
    """
    figure = go.Figure()
    first, *others = tables.values()
    columns = [name for name in first if all(name in table for table in others)]
    measured = {name: measures.of_column(name) for name in columns}
    shown = {name: measure for name, measure in measured.items() if measure}
    for measure in shown:
        for name, look in _looks(results).items():
            table = tables[name]
            figure.add_box(
                y=table[measure].tolist(),
                name=results[name].label,
                marker={"color": look.colour, "size": 5, "opacity": 0.65},
                boxpoints="all",
                jitter=0.5,
                pointpos=0,
                text=[
                    f"seed {seed:.0f}, episode {episode:.0f}"
                    for seed, episode in zip(table["seed"], table["episode"], strict=True)
                ],
                hovertemplate="%{text}: %{y:,.4~g}<extra></extra>",
                hoveron="points",
                visible=measure == "return",
                showlegend=False,
            )
    buttons = [
        {
            "label": shown[measure].label,
            "method": "update",
            "args": [
                {"visible": [other == measure for other in shown for _ in results]},
                {"yaxis.title.text": shown[measure].axis},
            ],
        }
        for measure in shown
    ]
    menu = {"buttons": buttons, "x": 0, "xanchor": "left", "y": 1.2, "yanchor": "top"}
    figure.update_layout(updatemenus=[menu])
    figure.update_yaxes(title=shown["return"].axis, rangemode="tozero")
    return finish(figure, 420, top=70)


def heights(results: Mapping[str, AgentResults], films: Mapping[str, FilmedEpisode]) -> go.Figure:
    """Draw the torso's height over the time of each agent's film.

    Args:
        results: What `results.load` returns.
        films: Each agent's film.
    """
    figure = go.Figure()
    for name, look in _looks(results).items():
        film = films[name]
        figure.add_scatter(
            x=np.round(film.times, 3).tolist(),
            y=np.round(film.heights, 3).tolist(),
            name=results[name].label,
            mode="lines",
            line={"color": look.colour, "dash": DASHES[look.line], "width": 1.6},
            hovertemplate="%{y:.2f} m",
        )
    figure.update_xaxes(title="time in the film [s]", hoverformat=".2f")
    figure.update_yaxes(title="height of the torso [m]", rangemode="tozero")
    return finish(figure, 360, hovermode="x unified")


def torques(
    results: Mapping[str, AgentResults],
    films: Mapping[str, FilmedEpisode],
    motors: Sequence[str],
) -> go.Figure:
    """Draw each motor's torque over the seconds around the highest moment, one panel per agent."""
    labels = [agent.label for agent in results.values()]
    figure = make_subplots(
        rows=len(results), cols=1, subplot_titles=labels, vertical_spacing=0.22 / len(results)
    )
    for row, name in enumerate(results, start=1):
        film = films[name]
        steps = _around_highest(film)
        figure.add_heatmap(
            x=np.round(steps * film.step_seconds, 3).tolist(),
            y=[motor.replace("_", " ") for motor in motors],
            z=np.round(film.torques[steps].T, 3).tolist(),
            coloraxis="coloraxis",
            hovertemplate="%{y} at %{x:.2f} s: %{z:.2f}<extra></extra>",
            row=row,
            col=1,
        )
    figure.update_layout(
        coloraxis={
            "colorscale": "RdBu",
            "cmin": -1,
            "cmax": 1,
            "colorbar": {"title": {"text": "torque /<br>peak", "side": "top"}, "thickness": 12},
        }
    )
    figure.update_xaxes(title="time [s]", row=len(results), col=1)
    return finish(figure, 60 + 190 * len(results), top=30)


def _looks(results: Mapping[str, AgentResults]) -> dict[str, Look]:
    return looks({name: agent.is_baseline for name, agent in results.items()})


def _add_band(figure: go.Figure, x: Array, low: Array, high: Array, look: Look, group: str) -> None:
    red, green, blue = (int(look.colour[i : i + 2], 16) for i in (1, 3, 5))
    figure.add_scatter(
        x=[*x.tolist(), *x[::-1].tolist()],
        y=[*high.tolist(), *low[::-1].tolist()],
        fill="toself",
        fillcolor=f"rgba({red}, {green}, {blue}, 0.15)",
        line={"width": 0},
        mode="lines",
        hoverinfo="skip",
        legendgroup=group,
        showlegend=False,
    )


def _median_steps(agent: AgentResults, threshold: float) -> float:
    """Return the steps by which half of the seeds reached a return; infinity if fewer did."""
    steps, reached = steps_to(agent, threshold)
    return float(np.quantile(np.where(reached, steps, np.inf), 0.5, method="lower"))


def _around_highest(film: FilmedEpisode) -> NDArray[np.int64]:
    """Return the control steps around a film's highest moment."""
    length = len(film.torques)
    width = min(length, round(TORQUE_SECONDS / film.step_seconds))
    highest = int(film.times[film.heights.argmax()] / film.step_seconds)
    start = min(max(0, highest - width // 2), length - width)
    return np.arange(start, start + width)


def finish(figure: go.Figure, height: int, top: int = 16, **layout: Any) -> go.Figure:
    """Give a figure the page's look; its width is that of the page."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 60, "r": 16, "t": top, "b": 50},
        font={"family": FONT, "size": 13, "color": INK},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        legend={"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"},
        **layout,
    )
    figure.update_xaxes(gridcolor=GRID, zeroline=False, automargin=True)
    figure.update_yaxes(gridcolor=GRID, zeroline=False, automargin=True)
    return figure
