"""All agents side by side as one recording: each robot in 3-D, and their heights together.

Entities, over `sim_time` [s] and `control_step`:

| path | what | unit |
|---|---|---|
| /<agent>/world/<body>/<geom> | the robot's shapes, moved with their bodies | m |
| /<agent>/trail, /<agent>/contact_arrow/<limb> | as in `jumping_ant.media.episode` | |
| /height/<agent> | height of the torso's centre | m |
| /about | a page of text; always there | |
"""

from collections.abc import Mapping

import rerun as rr

from jumping_ant.agents.families import by_family
from jumping_ant.media import about, layout, rerun_file, states, style
from jumping_ant.media.about import Story
from jumping_ant.media.scene import log_scene, log_series
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

STRIDE = 2  # simulation steps between recorded states; all of them would double the file
OPENING = 20 * 10**9  # [ns] the highest jump up to here plays first


def record(
    worlds: Mapping[str, World],
    trajectories: Mapping[str, Trajectory],
    stories: Mapping[str, Story],
) -> rerun_file.Recording:
    """Record each agent's episode, looping over the highest jump of their opening."""
    motions = {
        agent: states.derive(worlds[agent], trajectory, STRIDE)
        for agent, trajectory in trajectories.items()
    }
    end = min(OPENING, max(int(motion.times[-1]) for motion in motions.values()))
    _, peak = max(motion.peak(end) for motion in motions.values())
    drawn = style.looks({agent: story.family for agent, story in stories.items()})

    def log(stream: rr.RecordingStream) -> None:
        for agent, motion in motions.items():
            color = tuple(bytes.fromhex(drawn[agent].colour[1:]))
            log_scene(stream, worlds[agent], motion, f"{agent}/", color)
            path, label = f"height/{agent}", stories[agent].label
            log_series(stream, path, label, color, motion.columns, motion.heights)
        about.log_page(stream, about.lineup_page(stories, trajectories, peak, end))

    labels = {agent: story.label for agent, story in stories.items()}
    opened = layout.lineup_layout(worlds, labels, _groups(stories), peak, end)
    return rerun_file.write("lineup", "All agents", opened, log)


def _groups(stories: Mapping[str, Story]) -> dict[str, list[str]]:
    """Return the agents of each tab, by its title: all, or of many learners each family."""
    ranked = sorted(stories, key=lambda agent: -stories[agent].mean_return)
    families = {agent: stories[agent].family for agent in ranked}
    if not style.is_crowded(families):
        return {"All agents": list(stories)}
    grouped = by_family(families)
    leaders = [members[0] for members in grouped.values()]
    return {"Best of each family": leaders} | {
        family.capitalize(): members for family, members in grouped.items()
    }
