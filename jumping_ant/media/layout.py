"""Layouts that recordings open in: the views, the camera that follows, and what plays."""

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from jumping_ant.media.scene import camera_path
from jumping_ant.media.states import TIMELINE, motor_names
from jumping_ant.sim.world import World

BACKGROUND = (24, 28, 36)
GRID_COLOR = (140, 156, 176, 90)
TRAIL_SECONDS = 3.0
EYE = (4.5, -4.5, 2.7)  # [m] initial camera position; it keeps its distance from the torso
LOOK_TARGET = (0.0, 0.0, 0.75)
MOMENT = 2 * 10**9  # [ns] played before and after the highest point

ABOUT = rrb.TextDocumentView(origin="about", name="About")


def episode_layout(world: World, peak: int, end: int) -> rrb.Blueprint:
    """Arrange an episode, filmed up to `end` [ns]; it plays what is around `peak` [ns]."""
    film = rrb.Spatial2DView(origin="film", name=f"Film of the first {end / 1e9:g} s")
    height, *plots = _plots(world)
    beside_film = rrb.Horizontal(film, height, column_shares=[2, 5])
    left = rrb.Vertical(_scene(world, "Robot"), beside_film, row_shares=[7, 3])
    right = rrb.Vertical(ABOUT, *plots, row_shares=[10, 3, 3, 7])
    whole = rrb.Horizontal(left, right, column_shares=[3, 2])
    return rrb.Blueprint(whole, _repeat(peak, end), collapse_panels=True)


def lineup_layout(
    worlds: Mapping[str, World],
    labels: Mapping[str, str],
    groups: Mapping[str, Sequence[str]],
    peak: int,
    end: int,
) -> rrb.Blueprint:
    """Arrange agents side by side, with their heights and text, in `groups`: tabs by title.

    What is around `peak` [ns] plays in a loop, which ends at `end` [ns] at the latest.
    """
    tabs = []
    for title, agents in groups.items():
        views = [_scene(worlds[agent], labels[agent], f"{agent}/") for agent in agents]
        scenes = rrb.Grid(*views, grid_columns=int(np.ceil(np.sqrt(len(views)))))
        paths = [f"/height/{agent}" for agent in agents]
        heights = _close_up("Torso height [m]", paths, before=4.0, after=6.0)
        tabs.append(rrb.Vertical(scenes, heights, row_shares=[5, 2], name=title))
    whole = rrb.Horizontal(rrb.Tabs(*tabs), ABOUT, column_shares=[2, 1])
    return rrb.Blueprint(whole, _repeat(peak, end), collapse_panels=True)


def _scene(world: World, name: str, root: str = "") -> rrb.Spatial3DView:
    """Return the view of a robot, with a camera that follows it (see `scene.log_scene`)."""
    trail = rrb.VisibleTimeRanges(timeline=TIMELINE, range=_around(before=TRAIL_SECONDS))
    return rrb.Spatial3DView(
        origin=f"/{root}",
        contents=[f"/{root}{part}" for part in ("world/**", "trail", "contact_arrow/**")],
        name=name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(spacing=1.0, color=GRID_COLOR, stroke_width=1.0),
        eye_controls=rrb.EyeControls3D(
            position=EYE, look_target=LOOK_TARGET, tracking_entity=f"/{root}{camera_path(world)}"
        ),
        overrides={f"/{root}trail": trail},
    )


def _plots(world: World) -> list[rrb.View | rrb.Container]:
    """Return the views of the series: whole, and in tabs what changes fast."""
    no_legend = rrb.PlotLegend(visible=False)
    series = {"Contact forces [N]": ["/contact_force/**"]}
    for name in sorted(motor_names(world), reverse=True):
        title = f"{name.partition('_')[0].capitalize()} torques [N m]"
        series.setdefault(title, []).append(f"/torque/{name}")
    close_ups = [_close_up(name, paths, before=1.5, after=3.5) for name, paths in series.items()]
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


def _close_up(name: str, paths: list[str], before: float, after: float) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        contents=paths,
        name=name,
        axis_x=rrb.TimeAxis(view_range=_around(before, after)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def _repeat(peak: int, end: int) -> rrb.TimePanel:
    """Play what is around `peak` in a loop; the viewer begins at the start and plays up to it."""
    ends = max(0, peak - MOMENT), min(end, peak + MOMENT)
    return rrb.TimePanel(
        timeline=TIMELINE,
        state="collapsed",
        play_state="playing",
        loop_mode="selection",
        time_selection=rrb.components.AbsoluteTimeRange(
            *(rr.encodings.TimeInt(nanos=time) for time in ends)
        ),
    )


def _around(before: float, after: float = 0.0) -> rr.TimeRange:
    """Return the range from `before` to `after` around the current time [s]."""
    return rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-before),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=after),
    )
