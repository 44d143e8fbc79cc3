"""An agent's episode as a recording: the robot in 3-D beside everything it did.

Entities, over `sim_time` [s] and, except for the film, `control_step`:

| path | what | unit |
|---|---|---|
| /world/<body>/<geom> | the robot's shapes, moved with their bodies | m |
| /trail | the torso's path | m |
| /contact_arrow/<limb> | contact force on a limb, drawn from the mean contact point | 100 N/m |
| /height/torso | height of the torso's centre | m |
| /reward/<term> | what a term adds to the reward of each control step, at its end | |
| /reward/total | their sum, where there are several | |
| /torque/<motor> | torque held from the control step's start | N m |
| /contact_force/<limb> | sum of the normal forces at the contacts of a leg, or of the torso | N |
| /contacts | number of contacts | |
| /phase | `grounded`, or `airborne` without any contact | |
| /film/frames | the frames of the film | |
| /learning/curves/seed-<n> | returns of a seed's policy while it learned; always there | |
| /about | a page of text; always there | |
"""

import rerun as rr

from jumping_ant.recording import about, curves, film, layout, series, states
from jumping_ant.recording.file import write
from jumping_ant.recording.scene import Scene, time_of_peak
from jumping_ant.recording.story import Story
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World


def record(world: World, trajectory: Trajectory, story: Story, mp4: bytes) -> bytes:
    """Return a whole episode as an `.rrd` file, which loops over the highest jump of its film.

    The film, `mp4`, starts with the episode and may end before it.
    """
    video = film.Film(mp4)
    found = states.derive(world, trajectory, trajectory.rows())
    end = min(int(video.times[-1]), int(found.times[-1]))
    peak = time_of_peak(world, found, end)

    def log(stream: rr.RecordingStream) -> None:
        scene = Scene(stream, world)
        scene.log_shapes()
        scene.log_states(found)
        series.log_styles(stream, world, list(series.reward_series(trajectory)))
        series.log_states(stream, world, found)
        series.log_control(stream, world, trajectory, len(found.rows))
        video.log(stream)
        curves.log_curves(stream, story.curves, trajectory.seed)
        page = about.episode_page(world, trajectory, story, about.Opening(peak / 1e9, end / 1e9))
        about.log_page(stream, page)

    name = f"{story.agent}-seed-{trajectory.seed}-episode-{trajectory.episode}"
    title = f"{story.agent}, seed {trajectory.seed}"
    return write(name, title, layout.episode_layout(world, layout.around(peak, end), end), log)
