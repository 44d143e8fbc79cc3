"""Layouts that recordings open in: the views, the camera that follows, and what plays."""

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from jumping_ant.recording import curves
from jumping_ant.recording.scene import camera_path
from jumping_ant.recording.states import TIMELINE
from jumping_ant.sim.world import World

BACKGROUND = (24, 28, 36)
GRID_COLOR = (140, 156, 176, 90)
TRAIL_SECONDS = 3.0
EYE = (4.5, -4.5, 2.7)  # [m] initial camera position; it keeps its distance from the torso
LOOK_TARGET = (0.0, 0.0, 0.75)
MOMENT_SECONDS = 2.0  # played before and after the highest point

Moment = tuple[int, int]  # first and last time [ns]


def around(peak: int, end: int) -> Moment:
    """Return the moment around `peak` [ns] in a recording that ends at `end` [ns]."""
    margin = int(MOMENT_SECONDS * 1e9)
    return max(0, peak - margin), min(end, peak + margin)


def episode_layout(world: World, moment: Moment, film_end: int) -> rrb.Blueprint:
    """Arrange a recorded episode; `moment` plays in a loop, the film ends at `film_end` [ns]."""
    film = rrb.Spatial2DView(origin="film", name=f"Film of the first {film_end / 1e9:g} s")
    left = rrb.Vertical(
        scene_view(world, "Robot"),
        rrb.Horizontal(film, curves.view(), column_shares=[2, 5]),
        row_shares=[7, 3],
    )
    about = rrb.TextDocumentView(origin="about", name="About")
    right = rrb.Vertical(about, *_plots(world), row_shares=[10, 4, 3, 3, 7])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]), _repeat(moment), collapse_panels=True
    )


def lineup_layout(
    worlds: Mapping[str, World],
    labels: Mapping[str, str],
    groups: Mapping[str, Sequence[str]],
    moment: Moment,
) -> rrb.Blueprint:
    """Arrange agents side by side, with their heights and text; `moment` plays in a loop.

    `groups` are the agents that are seen at once, by title; several groups are tabs.
    """
    about = rrb.TextDocumentView(origin="about", name="About")
    scenes, heights = [], []
    for agents in groups.values():
        views = [scene_view(worlds[agent], labels[agent], f"{agent}/") for agent in agents]
        scenes.append(rrb.Grid(*views, grid_columns=int(np.ceil(np.sqrt(len(views))))))
        heights.append(_heights(agents))
    if len(groups) == 1:
        whole = rrb.Horizontal(scenes[0], rrb.Vertical(about, heights[0]), column_shares=[2, 1])
    else:
        tabs = [
            rrb.Vertical(*parts, row_shares=[3, 1], name=title)
            for title, parts in zip(groups, zip(scenes, heights, strict=True), strict=True)
        ]
        whole = rrb.Horizontal(rrb.Tabs(*tabs), about, column_shares=[2, 1])
    return rrb.Blueprint(whole, _repeat(moment), collapse_panels=True)


def _heights(agents: Sequence[str]) -> rrb.TimeSeriesView:
    """Return the view of the heights of agents' torsos."""
    return rrb.TimeSeriesView(
        origin="height",
        contents=[f"/height/{agent}" for agent in agents],
        name="Torso height [m]",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
        axis_x=rrb.TimeAxis(view_range=_around(before=4.0, after=6.0)),
    )


def scene_view(world: World, name: str, root: str = "") -> rrb.Spatial3DView:
    """Return the view of a robot, with a camera that follows it (see `scene.Scene`)."""
    return rrb.Spatial3DView(
        origin=f"/{root}",
        contents=[f"/{root}{part}" for part in ("world/**", "trail", "contact_arrow/**")],
        name=name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(spacing=1.0, color=GRID_COLOR, stroke_width=1.0),
        eye_controls=rrb.EyeControls3D(
            position=EYE,
            look_target=LOOK_TARGET,
            tracking_entity=f"/{root}{camera_path(world)}",
        ),
        overrides={
            f"/{root}trail": rrb.VisibleTimeRanges(
                timeline=TIMELINE, range=_around(before=TRAIL_SECONDS)
            )
        },
    )


def _plots(world: World) -> list[rrb.View | rrb.Container]:
    """Return the views of the series."""
    no_legend = rrb.PlotLegend(visible=False)
    motors = [world.model.actuator(motor).name for motor in range(world.anatomy.num_motors)]
    kinds = dict.fromkeys(sorted((name.partition("_")[0] for name in motors), reverse=True))
    close_ups = [_close_up("Contact forces [N]", ["/contact_force/**"])] + [
        _close_up(
            f"{kind.capitalize()} torques [N m]",
            [f"/torque/{name}" for name in motors if name.startswith(kind)],
        )
        for kind in kinds
    ]
    return [
        rrb.TimeSeriesView(origin="height", name="Torso height [m]", plot_legend=no_legend),
        rrb.TimeSeriesView(origin="reward", name="Reward per control step", plot_legend=no_legend),
        rrb.StateTimelineView(
            origin="phase",
            name="Phase",
            time_view=rrb.TimeAxis(view_range=_around(before=3.0, after=7.0)),
        ),
        rrb.Tabs(*close_ups, active_tab=1),
    ]


def _close_up(name: str, paths: list[str]) -> rrb.TimeSeriesView:
    """Plot fast series around the current time only."""
    return rrb.TimeSeriesView(
        origin="/",
        contents=paths,
        name=name,
        axis_x=rrb.TimeAxis(view_range=_around(before=1.5, after=3.5)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def _repeat(moment: Moment) -> rrb.TimePanel:
    """Play a moment in a loop; the viewer begins at the start and plays up to it."""
    first, last = (rr.encodings.TimeInt(nanos=time) for time in moment)
    return rrb.TimePanel(
        timeline=TIMELINE,
        state="collapsed",
        play_state="playing",
        loop_mode="selection",
        time_selection=rrb.components.AbsoluteTimeRange(first, last),
    )


def _around(before: float, after: float = 0.0) -> rr.TimeRange:
    """Return the range from `before` to `after` around the current time [s]."""
    return rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-before),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=after),
    )
