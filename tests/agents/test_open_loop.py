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
def events(robot_xml: str, known_params: Params) -> list:
    return list(search(Job(World(robot_xml, known_params.env), AGENT, seed=5, evaluations=9)))


def test_the_best_rhythm_is_kept(events: list, robot_xml: str, known_params: Params) -> None:
    """Each rhythm's returns are those of its policy's episodes from the seed's start states."""
    env = known_params.env.model_copy(update={"max_episode_steps": AGENT.episode_steps})
    starts, returns = derive_all(5, "starts", AGENT.episodes), {}
    rows = [event for event in events if isinstance(event, Progress)]
    for row, half_period in zip(rows, AGENT.half_periods, strict=True):
        episodes = rollout.run(
            World(robot_xml, env), metronome(AGENT, known_params.env, half_period), starts
        )
        values = np.array([episode.rewards.sum() for episode in episodes])
        assert (row.return_mean, row.return_std) == pytest.approx((values.mean(), values.std()))
        assert row.extra == {"half_period": half_period}
        returns[half_period] = values.mean()
    assert len(set(returns.values())) == 3
    best = max(returns, key=returns.__getitem__)
    assert best != AGENT.half_periods[0], "not by being the first"
    snapshot, finished = events[-2:]
    assert isinstance(snapshot, Snapshot) and isinstance(finished, Finished)
    assert snapshot.policy == finished.policy == metronome(AGENT, known_params.env, best).to_bytes()


def test_control_steps_are_counted(robot_xml: str, known_params: Params, events: list) -> None:
    """Those of episodes that end early until their end."""
    full = AGENT.episodes * AGENT.episode_steps
    assert [event.env_steps for event in events] == [full, 2 * full, 3 * full, 3 * full, 3 * full]
    assert AGENT.max_env_steps == 3 * full
    high = known_params.env.model_copy(update={"min_torso_height": 0.55})
    starts = derive_all(5, "starts", AGENT.episodes)
    events, expected = search(Job(World(robot_xml, high), AGENT, 5)), []
    steps = [event.env_steps for event in events]
    limited = high.model_copy(update={"max_episode_steps": AGENT.episode_steps})
    for half_period in AGENT.half_periods:
        episodes = rollout.run(
            World(robot_xml, limited), metronome(AGENT, known_params.env, half_period), starts
        )
        expected.append(sum(len(episode.rewards) for episode in episodes))
    assert steps[:3] == np.cumsum(expected).tolist()
    assert expected[0] < full


def test_the_policy_plays_a_square_wave(events: list, robot_xml: str, known_params: Params) -> None:
    policy = policy_file.parse(events[-1].policy)
    half_period = policy.actions.hold
    (episode,) = rollout.run(World(robot_xml, known_params.env), policy, [1])
    down, up = 0.75 * COMMAND_SIGNS[3], 0.75 * COMMAND_SIGNS[4]
    turns = np.arange(len(episode.torques)) // half_period % 2
    np.testing.assert_array_equal(episode.torques, np.where(turns[:, None] == 0, down, up))
    assert len(turns) > 2 * half_period
