"""All agents side by side as one recording: each one's robot in 3-D, and their heights together.

Entities, over `sim_time` [s] and `control_step`:

| path | what | unit |
|---|---|---|
| /<agent>/world/<body>/<geom> | the robot's shapes, moved with their bodies | m |
| /<agent>/trail, /<agent>/contact_arrow/<limb> | as in `jumping_ant.recording.episode` | |
| /height/<agent> | height of the torso's centre | m |
| /about | a page of text; always there | |
"""

from collections.abc import Callable, Mapping

import rerun as rr

from jumping_ant.looks import looks, panels
from jumping_ant.looks.naming import by_family
from jumping_ant.recording import about, layout, series, states
from jumping_ant.recording.file import write
from jumping_ant.recording.parts import Color
from jumping_ant.recording.scene import Scene, time_of_peak, torso_heights
from jumping_ant.recording.states import States
from jumping_ant.recording.story import Story
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

Page = Callable[[Mapping[str, Story], Mapping[str, Trajectory], about.Opening], str]

STRIDE = 2  # simulation steps between recorded states; all of them would double the file
OPENING_SECONDS = 20.0  # the highest jump up to here plays first


def record(
    worlds: Mapping[str, World],
    trajectories: Mapping[str, Trajectory],
    stories: Mapping[str, Story],
    name: str = "lineup",
    title: str = "All agents",
    describe: Page = about.lineup_page,
) -> bytes:
    """Return the episodes as an `.rrd` file that loops over the highest jump of its opening.

    Args:
        worlds: Each agent's robot and task.
        trajectories: The episode of each agent.
        stories: What is known about them.
        name: The recording's identifier. A viewer merges recordings that share one.
        title: What the recording is called.
        describe: Writes its page of text.
    """
    colors = _colors(stories)
    found = {
        agent: states.derive(worlds[agent], trajectory, trajectory.rows(STRIDE))
        for agent, trajectory in trajectories.items()
    }
    ends = [int(own.times[-1]) for own in found.values()]
    end = min(int(OPENING_SECONDS * 1e9), max(ends))
    peak = _time_of_peak(worlds, found, end)

    def log(stream: rr.RecordingStream) -> None:
        for agent, own in found.items():
            color, world = colors[agent], worlds[agent]
            scene = Scene(stream, world, f"{agent}/", torso_color=color, trail_color=color)
            scene.log_shapes()
            scene.log_states(own)
            series.log_style(stream, f"height/{agent}", stories[agent].label, color)
            series.log_line(stream, f"height/{agent}", own, torso_heights(world, own))
        opening = about.Opening(peak / 1e9, end / 1e9)
        about.log_page(stream, describe(stories, trajectories, opening))

    labels = {agent: story.label for agent, story in stories.items()}
    moment = layout.around(peak, end)
    opened = layout.lineup_layout(worlds, labels, _groups(stories), moment)
    return write(name, title, opened, log)


def _groups(stories: Mapping[str, Story]) -> dict[str, list[str]]:
    """Return the agents that are seen at once, by title: all, or of many learners each family."""
    ranked = sorted(stories, key=lambda agent: -stories[agent].mean_return)
    families = {agent: stories[agent].family for agent in ranked}
    if not panels.is_crowded(families):
        return {"All agents": list(stories)}
    grouped = by_family(families)
    leaders = [members[0] for members in grouped.values()]
    return {"Best of each family": leaders} | {
        family.capitalize(): members for family, members in grouped.items()
    }


def _time_of_peak(worlds: Mapping[str, World], episodes: Mapping[str, States], until: int) -> int:
    """Return the time of the highest point of any torso [ns], up to a time [ns]."""
    peaks = []
    for agent, own in episodes.items():
        time = time_of_peak(worlds[agent], own, until)
        peaks.append((float(torso_heights(worlds[agent], own)[own.times == time][0]), time))
    return max(peaks)[1]


def _colors(stories: Mapping[str, Story]) -> dict[str, Color]:
    """Return each agent's colour, as in the figures."""
    drawn = looks.looks({agent: story.family for agent, story in stories.items()})
    return {agent: tuple(bytes.fromhex(look.colour[1:])) for agent, look in drawn.items()}
