"""Films compared with Gymnasium's recording wrapper, for the same random torques."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from gymnasium.wrappers import RecordVideo

from benchmarks.article_ant import ArticleAnt, default_world
from benchmarks.measure import Row, compare_apart, rate
from jumping_ant.evaluation import evaluation
from jumping_ant.media import rendering
from jumping_ant.params import params_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.sim import gl, rollout
from jumping_ant.sim.rollout import Episode
from jumping_ant.sim.trajectory import frame_stride

SEED = 0
SIZE = 480  # [pixels] width and height
FILM_STEPS = 160  # [control steps] filmed by the project
VIDEO_STEPS = 20  # [control steps] filmed by the wrapper, which takes long for a frame


def render_vs_record_video() -> Row:
    """Compare frames per second, encoding included, with shadows."""
    return compare_apart("render_vs_record_video", "frames/s", film, record_video)


def film() -> Callable[[], float]:
    """Set up the project's film, that of the `record` stage."""
    record = params_file.load().record.model_copy(update={"width": SIZE, "height": SIZE})
    ant, episode = default_world(), random_episode(FILM_STEPS)
    trajectory = evaluation.replay(ant, episode, "random", SEED, 0)
    stride = frame_stride(trajectory.timestep, record.fps)
    num_frames = len(trajectory.rows(stride, record.seconds))
    return lambda: rate(partial(rendering.film, ant.xml, trajectory, record), num_frames)


def record_video() -> Callable[[], float]:
    """Set up the wrapper, with its defaults: a frame of each control step."""
    gl.select_backend()  # Gymnasium's default one needs a screen
    torques = random_episode(VIDEO_STEPS).torques

    def record() -> None:
        env = ArticleAnt(render_mode="rgb_array", width=SIZE, height=SIZE)
        with tempfile.TemporaryDirectory() as folder, RecordVideo(env, f"{folder}/video") as video:
            video.reset(seed=SEED)
            for row in torques:
                video.step(row)

    return lambda: rate(record, len(torques) + 1)


def random_episode(num_steps: int) -> Episode:
    """Return an episode of the random agent."""
    whole = default_world()
    short = whole.env.model_copy(update={"max_episode_steps": num_steps})
    policy = UniformPolicy(SEED, ActionSet(), whole.anatomy.num_motors)
    return rollout.run(replace(whole, env=short), policy, [SEED])[0]
