"""What recordings say in words: about an agent and its episode, and how to navigate."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import rerun as rr

from jumping_ant.agents import catalogue
from jumping_ant.agents.families import BASELINE, Family
from jumping_ant.base.paths import Paths
from jumping_ant.evaluation import episodes
from jumping_ant.media import style
from jumping_ant.media.scene import METRES_PER_NEWTON
from jumping_ant.media.states import LEG_COLORS, limbs
from jumping_ant.params.model import Params
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

MEASURES = ("return", "peak_height", "jumps", "airborne_seconds")

NAVIGATION = """\
**Navigation.** Drag in the bar below, or click in a plot, to choose a time; space pauses, and the
loop button plays everything. In the view of a robot, drag to rotate, right-drag to pan, scroll to
zoom; the camera follows the torso. Click a shape or a line for its values."""


@dataclass(frozen=True)
class Story:
    """An agent and one of its episodes."""

    agent: str
    algorithm: str
    family: Family
    robot: str  # `edited` or `unedited`
    measures: Mapping[str, float]  # the episode's `MEASURES`
    mean_return: float  # over all of the agent's held-out episodes

    @property
    def label(self) -> str:
        """The agent's display name."""
        return catalogue.label(self.agent, self.algorithm)


def read(root: Path, params: Params, agent: str, trajectory: Trajectory) -> Story:
    """Read what is known about an episode."""
    block = params.agent(agent)
    table = episodes.read(root, params, agent)
    shown = episodes.find(table, agent, trajectory, Paths(root).agent(agent).trajectory)
    return Story(
        agent=agent,
        algorithm=block.algorithm,
        family=catalogue.row(block).family,
        robot=block.robot,
        measures={name: shown[name] for name in MEASURES},
        mean_return=float(table["return"].mean()),
    )


def log_page(stream: rr.RecordingStream, text: str) -> None:
    """Log a page of Markdown, for the view `About`."""
    page = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
    stream.log("about", page, static=True)


def episode_page(world: World, trajectory: Trajectory, story: Story, peak: int, end: int) -> str:
    """Describe one episode, filmed up to `end` [ns], with its highest jump at `peak` [ns]."""
    measures = story.measures
    seconds = len(trajectory.torques) * trajectory.frame_skip * trajectory.timestep
    algorithm = catalogue.ALGORITHMS[story.algorithm].about
    robot = " Its robot is unedited." if story.robot == "unedited" else ""
    reward = f"The reward is the sum of {', '.join(map('`{}`'.format, trajectory.terms))}."
    if list(trajectory.terms) == ["torso_height"]:
        reward = (
            "The reward increases with the torso's height and saturates, so higher jumps earn "
            "more only by lasting longer."
        )
    arrow = f"{100 * METRES_PER_NEWTON:g} m for 100 N"
    _, *legs = limbs(world)
    named = zip(legs, cycle(LEG_COLORS))
    colors = ", ".join(["Torso sand", *(f"{leg.replace('_', ' ')} {name}" for leg, name in named)])
    return f"""\
## {story.label}, seed {trajectory.seed}, episode {trajectory.episode}

| return | peak height | jumps | off the ground |
|---|---|---|---|
| {measures["return"]:,.0f} | {measures["peak_height"]:.2f} m | {measures["jumps"]:.0f} | \
{measures["airborne_seconds"]:.1f} of {seconds:.1f} s |

The median of the held-out episodes of `{story.agent}`: {algorithm}.{robot}
The recording loops over the highest jump of the {end / 1e9:g} s that are filmed, at
{peak / 1e9:.1f} s.

**What to look at.** Arrows are the forces of the ground on each limb ({arrow}): long when the
robot pushes off and lands, absent while it flies. The blue trail is the torso's path.
{reward}

**Colours.** {colors}; the same for shapes, arrows, torques and forces.

{NAVIGATION}
"""


def lineup_page(
    stories: Mapping[str, Story], trajectories: Mapping[str, Trajectory], peak: int, end: int
) -> str:
    """Describe all agents' episodes side by side, the agent that returns most first.

    The highest jump of the first part, which ends at `end` [ns], is at `peak` [ns].
    """
    ranked = sorted(stories.items(), key=lambda item: -item[1].mean_return)
    is_crowded = style.is_crowded({agent: story.family for agent, story in ranked})
    tabs = "\nThe tabs show the best agent of each family, and each family." if is_crowded else ""
    rows = []
    for agent, story in ranked:
        remark = style.remark(story.family == BASELINE, story.robot)
        rows.append(
            f"| **{story.label}**{f' ({remark})' if remark else ''} | {trajectories[agent].seed} | "
            f"{story.measures['return']:,.0f} | {story.mean_return:,.0f} | "
            f"{story.measures['peak_height']:.2f} m | {story.measures['jumps']:.0f} |"
        )
    table = "\n".join(rows)
    return f"""\
## The agents side by side

Each agent's median held-out episode, all started at the same time.{tabs}

| agent | seed | return | mean return | peak | jumps |
|---|---|---|---|---|---|
{table}

A baseline learns nothing. The mean is over all seeds and held-out episodes. Each agent has one
colour, for its torso, its trail and its height in the plot; baselines are grey.
Arrows are the forces of the ground. The recording loops over the
highest jump of the first {end / 1e9:g} s, at {peak / 1e9:.1f} s.

{NAVIGATION}
"""
