"""Text pages of recordings, as Markdown: what they show, and how to navigate."""

from collections.abc import Mapping
from dataclasses import dataclass

import rerun as rr

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.looks import naming, panels
from jumping_ant.recording.parts import LEG_COLORS, limb_names
from jumping_ant.recording.scene import METRES_PER_NEWTON
from jumping_ant.recording.story import Story
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

LEG_COLOR_NAMES = ("coral", "yellow", "green", "violet")  # of `LEG_COLORS`

MOVING_ABOUT = """\
**Navigation.** Drag in the bar below, or click in a plot, to choose a time; space pauses, and the
loop button plays everything. In the view of a robot, drag to rotate, right-drag to pan, scroll to
zoom; the camera follows the torso. Click a shape or a line for its values."""


@dataclass(frozen=True)
class Opening:
    """The part that plays first."""

    peak: float  # time of the highest jump [s]
    end: float  # of the part in which it is the highest [s]


def log_page(stream: rr.RecordingStream, text: str) -> None:
    """Log a page of Markdown, for the view `About`."""
    page = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
    stream.log("about", page, static=True)


def episode_page(world: World, trajectory: Trajectory, story: Story, opening: Opening) -> str:
    """Describe one episode, whose opening ends with the film."""
    measures = story.measures
    seconds = len(trajectory.torques) * trajectory.frame_skip * trajectory.timestep
    arrow = f"{100 * METRES_PER_NEWTON:g} m for 100 N"
    return f"""\
## {story.label}, seed {trajectory.seed}, episode {trajectory.episode}

| return | peak height | jumps | off the ground |
|---|---|---|---|
| {measures["return"]:,.0f} | {measures["peak_height"]:.2f} m | {measures["jumps"]:.0f} | \
{measures["airborne_seconds"]:.1f} of {seconds:.1f} s |

The median of the held-out episodes of `{story.agent}`: {_algorithm(story)}.{_robot(story)}
The recording loops over the highest jump of the {opening.end:g} s that are filmed, at
{opening.peak:.1f} s.

**What to look at.** Arrows are the forces of the ground on each limb ({arrow}): long when the
robot pushes off and lands, absent while it flies. The blue trail is the torso's path.
{_reward(trajectory)}
The blue learning curve is this seed's, the grey ones are the other seeds'.

**Colours.** {_legend(world)}; the same for shapes, arrows, torques and forces.

{MOVING_ABOUT}
"""


def lineup_page(
    stories: Mapping[str, Story], trajectories: Mapping[str, Trajectory], opening: Opening
) -> str:
    """Describe all agents' episodes side by side, the agent that returns most first."""
    ranked = sorted(stories.items(), key=lambda item: -item[1].mean_return)
    is_crowded = panels.is_crowded({agent: story.family for agent, story in ranked})
    tabs = "\nThe tabs show the best agent of each family, and each family." if is_crowded else ""
    rows = "\n".join(
        f"| **{story.label}**{_remark(story)} | {trajectories[agent].seed} | "
        f"{story.measures['return']:,.0f} | {story.mean_return:,.0f} | "
        f"{story.measures['peak_height']:.2f} m | {story.measures['jumps']:.0f} |"
        for agent, story in ranked
    )
    return f"""\
## The agents side by side

Each agent's median held-out episode, all started at the same time.{tabs}

| agent | seed | return | mean return | peak | jumps |
|---|---|---|---|---|---|
{rows}

A baseline learns nothing. The mean is over all seeds and held-out episodes. Each agent has one
colour, for its torso, its trail and its height in the plot; baselines are grey.
Arrows are the forces of the ground. The recording loops over the
highest jump of the first {opening.end:g} s, at {opening.peak:.1f} s.

{MOVING_ABOUT}
"""


def _algorithm(story: Story) -> str:
    """Return what an agent runs, in words."""
    return ALGORITHMS[story.algorithm].about


def _robot(story: Story) -> str:
    return " Its robot is unedited." if story.robot == "unedited" else ""


def _reward(trajectory: Trajectory) -> str:
    """Return what the reward depends on, in words."""
    if list(trajectory.terms) == ["torso_height"]:
        return (
            "The reward increases with the torso's height and saturates, so higher jumps earn "
            "more only by lasting longer."
        )
    return f"The reward is the sum of {', '.join(map('`{}`'.format, trajectory.terms))}."


def _remark(story: Story) -> str:
    """Return what sets an agent apart from learners on the edited robot, in brackets."""
    remark = naming.remark(story.is_baseline, story.robot)
    return f" ({remark})" if remark else ""


def _legend(world: World) -> str:
    legs = limb_names(world)[1:]
    names = [LEG_COLOR_NAMES[i % len(LEG_COLORS)] for i in range(len(legs))]
    words = [f"{leg.replace('_', ' ')} {name}" for leg, name in zip(legs, names, strict=True)]
    return ", ".join(["Torso sand", *words])
