"""The sceptic's baseline: rhythms tried in turn, and the best of them played blindly."""

import numpy as np
import pytest
from commands import COMMAND_SIGNS

from jumping_ant.agents.baselines.algorithms import OpenLoopParams
from jumping_ant.agents.baselines.trainer import metronome, search
from jumping_ant.agents.events import Finished, Progress, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.base.seeding import derive_all
from jumping_ant.params.model import Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World

AGENT = OpenLoopParams(
    robot="edited",
    algorithm="open_loop",
    amplitude=0.75,
    commands=[3, 4],
    half_periods=[1, 4, 2],
    episodes=3,
    episode_steps=60,
)


@pytest.fixture(scope="module")
def world(robot_xml: str, known_params: Params) -> World:
    """A task in which some episodes end early, at a height of 0.55 m."""
    return World(robot_xml, known_params.env.model_copy(update={"min_torso_height": 0.55}))


@pytest.fixture(scope="module")
def events(world: World) -> list:
    return list(search(Job(world, AGENT, seed=5, evaluations=9)))


def test_the_best_rhythm_is_kept(events: list, world: World) -> None:
    """Each rhythm's returns are those of its policy's episodes from the seed's start states.

    Control steps of episodes that end early count until their end.
    """
    limit = {"max_episode_steps": AGENT.episode_steps}
    short = World(world.xml, world.env.model_copy(update=limit))
    starts, returns, steps = derive_all(5, "starts", AGENT.episodes), {}, 0
    rows = [event for event in events if isinstance(event, Progress)]
    for row, half_period in zip(rows, AGENT.half_periods, strict=True):
        episodes = rollout.run(short, metronome(AGENT, world.env, half_period), starts)
        values = np.array([episode.rewards.sum() for episode in episodes])
        steps += sum(len(episode.rewards) for episode in episodes)
        assert (row.return_mean, row.return_std) == pytest.approx((values.mean(), values.std()))
        assert (row.env_steps, row.extra) == (steps, {"half_period": half_period})
        returns[half_period] = values.mean()
    assert steps < AGENT.max_env_steps == 3 * AGENT.episodes * AGENT.episode_steps
    assert len(set(returns.values())) == 3
    best = max(returns, key=returns.__getitem__)
    assert best != AGENT.half_periods[0], "not by being the first"
    snapshot, finished = events[-2:]
    assert isinstance(snapshot, Snapshot) and isinstance(finished, Finished)
    assert snapshot.env_steps == finished.env_steps == steps
    assert snapshot.policy == finished.policy == metronome(AGENT, world.env, best).to_bytes()


def test_the_policy_plays_a_square_wave(events: list, robot_xml: str, known_params: Params) -> None:
    policy = policy_file.parse(events[-1].policy)
    half_period = policy.actions.hold
    (episode,) = rollout.run(World(robot_xml, known_params.env), policy, [1])
    down, up = 0.75 * COMMAND_SIGNS[3], 0.75 * COMMAND_SIGNS[4]
    turns = np.arange(len(episode.torques)) // half_period % 2
    np.testing.assert_array_equal(episode.torques, np.where(turns[:, None] == 0, down, up))
    assert len(turns) > 2 * half_period
