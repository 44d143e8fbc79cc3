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
| /about | a page of text; always there | |
"""

import numpy as np
import rerun as rr

from jumping_ant.media import about, layout, rerun_file, scene, states
from jumping_ant.media.about import Story
from jumping_ant.media.states import Indices, time_columns
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World


def record(world: World, trajectory: Trajectory, story: Story, mp4: bytes) -> rerun_file.Recording:
    """Record a whole episode, looping over the highest jump of its film.

    The film, `mp4`, starts with the episode and may end before it.
    """
    video = rr.AssetVideo(contents=mp4, media_type="video/mp4")
    frames: Indices = video.read_frame_timestamps_nanos()
    motion = states.derive(world, trajectory)
    end = min(int(frames[-1]), int(motion.times[-1]))
    _, peak = motion.peak(end)

    def log(stream: rr.RecordingStream) -> None:
        scene.log_scene(stream, world, motion)
        scene.log_state_series(stream, world, motion)
        scene.log_control_series(stream, world, trajectory, motion)
        _log_film(stream, video, frames)
        about.log_page(stream, about.episode_page(world, trajectory, story, peak, end))

    name = f"{story.agent}-seed-{trajectory.seed}-episode-{trajectory.episode}"
    title = f"{story.agent}, seed {trajectory.seed}"
    return rerun_file.write(name, title, layout.episode_layout(world, peak, end), log)


def _log_film(stream: rr.RecordingStream, video: rr.AssetVideo, times: Indices) -> None:
    """Log each frame at its time [ns], and clear the picture after the last one."""
    stream.log("film/frames", video, static=True)
    frames = rr.VideoFrameReference.columns_nanos(times)
    stream.send_columns("film/frames", time_columns(times), frames)
    end = times[-1:] + np.diff(times[-2:], prepend=times[-1])[-1:]
    stream.send_columns("film", time_columns(end), rr.Clear.columns(is_recursive=[True]))
