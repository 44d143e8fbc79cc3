"""Episodes run side by side are those of a plain loop over the single environment."""

from typing import Any

import numpy as np
import pytest
from commands import COMMAND_SIGNS
from small_policies import linear_policy

from jumping_ant.base.errors import InputError
from jumping_ant.params import params_file
from jumping_ant.params.blocks import EnvParams
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import OpenLoopPolicy, UniformPolicy
from jumping_ant.policies.networks import TanhActor
from jumping_ant.sim import robot, rollout
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.rollout import Episode, Play
from jumping_ant.sim.world import World

SEEDS = [11, 5, 8]


@pytest.fixture(scope="module")
def task(known_params: Params) -> EnvParams:
    """Short, and high enough that some episodes end before their limit."""
    return known_params.env.model_copy(update={"max_episode_steps": 80, "min_torso_height": 0.3})


@pytest.fixture(scope="module")
def episodes(robot_xml: str, task: EnvParams) -> list[Episode]:
    return rollout.run(World(robot_xml, task), UniformPolicy(4, ActionSet(), 8), SEEDS)


def test_episodes_are_those_of_a_plain_loop(
    robot_xml: str, task: EnvParams, episodes: list[Episode]
) -> None:
    env = RobotEnv(World(robot_xml, task))
    for seed, episode in zip(SEEDS, episodes, strict=True):
        policy = UniformPolicy(4, ActionSet(), 8)
        policy.start([seed])
        observation, _ = env.reset(seed=seed)
        np.testing.assert_array_equal(episode.start_qpos, env.envs.qpos[0])
        np.testing.assert_array_equal(episode.start_qvel, env.envs.qvel[0])
        for step in range(len(episode.rewards)):
            torques: Any = policy.act(observation[None])[0]
            observation, reward, terminated, truncated, _ = env.step(torques)
            np.testing.assert_array_equal(episode.torques[step], torques)
            np.testing.assert_array_equal(episode.qpos[step], env.envs.qpos[0])
            np.testing.assert_array_equal(episode.qvel[step], env.envs.qvel[0])
            assert episode.rewards[step] == reward
            assert episode.airborne[step] == env.envs.airborne[0]
            is_last = step == len(episode.rewards) - 1
            assert (terminated or truncated) == is_last
        assert episode.terminated == terminated
    lengths = {episode.terminated: len(episode.rewards) for episode in episodes}
    assert lengths[True] < lengths[False] == task.max_episode_steps
    assert {bool(flag) for episode in episodes for flag in episode.airborne} == {True, False}


@pytest.mark.parametrize("hold", [1, 3])
def test_a_choice_is_held_as_long_as_the_policy_says(
    robot_xml: str, task: EnvParams, hold: int
) -> None:
    """The policy sees the state at each of its decisions, and no state in between."""
    policy = linear_policy(ActionSet(amplitude=0.5, hold=hold))
    (episode,) = rollout.run(World(robot_xml, task), policy, [3])
    states = np.concatenate([episode.qpos[:, 2:], episode.qvel], axis=1)
    first = np.concatenate([episode.start_qpos[2:], episode.start_qvel])
    seen = np.vstack([first, states[:-1]])
    chosen = np.concatenate([policy.act(seen[step][None]) for step in range(0, len(seen), hold)])
    expected = np.repeat(chosen, hold, axis=0)[: len(seen)]
    np.testing.assert_array_equal(episode.torques, expected)
    assert len(np.unique(chosen, axis=0)) == len(chosen) > 5
    assert np.abs(episode.torques).max() <= 0.5


def actor(seed: int) -> TanhActor:
    """A network whose layers are of sizes that products round by the number of rows."""
    generator = np.random.default_rng(seed)
    shapes = ((64, 27), (64, 64), (8, 64))
    weights = [generator.normal(0, 0.3, shape).astype(np.float32) for shape in shapes]
    layers = [(weight, np.zeros(len(weight), np.float32)) for weight in weights]
    return TanhActor(np.ones(27, np.float32), ActionSet(hold=2), layers)


def test_no_episode_depends_on_what_is_played_beside_it(
    robot_xml: str, task: EnvParams, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In batches of any size and order, with policies that keep a state and with networks."""
    world = World(robot_xml, task)
    cycle = OpenLoopPolicy(ActionSet(COMMAND_SIGNS[[3, 4, 1]], hold=2))
    policies = [actor(0), actor(1), cycle, UniformPolicy(4, ActionSet(hold=2), 8)]
    plays = [Play(policy, seed) for policy in policies for seed in range(7)]
    expected = [*rollout.play(world, plays)]
    assert len({episode.torques.tobytes() for episode in expected}) > 3 * 7
    order = np.random.default_rng(0).permutation(len(plays))
    for size in (1, 2, 5, 16):
        monkeypatch.setattr(rollout, "LARGEST_BATCH", size)
        ran = rollout.play(world, [plays[index] for index in order], num_threads=2)
        for index, episode in zip(order, ran, strict=True):
            np.testing.assert_equal(vars(episode), vars(expected[index]))


def test_what_is_kept_of_episodes_bounds_how_many_run_side_by_side(
    robot_xml: str, task: EnvParams, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, start = [], UniformPolicy.start
    monkeypatch.setattr(
        UniformPolicy, "start", lambda policy, seeds: begun.append(seeds) or start(policy, seeds)
    )
    monkeypatch.setattr(rollout, "LARGEST_RECORD", 2 * 80 * (15 + 14 + 8 + 3) + 1)
    rollout.run(World(robot_xml, task), UniformPolicy(4, ActionSet(), 8), range(5))
    assert begun == [[0, 1], [2, 3], [4]]


@pytest.mark.parametrize(
    "change",
    [
        {"robot.damping": 1e6},
        {"robot.gear": 1e6},
        {"robot.contact_margin": 1e6},
        {"env.reset_noise_scale": 1e6},
    ],
)
def test_a_robot_that_falls_apart_is_refused(
    change: dict[str, float], known_params: Params, capfd: pytest.CaptureFixture[str]
) -> None:
    """Before any training, in one line; whatever can be drawn is not."""
    ((key, value),) = change.items()
    block, name = key.split(".")
    content = known_params.model_dump()
    content[block][name] = value
    params = params_file.check(content)
    with pytest.raises(InputError, match="robot: given one that falls apart in its first moments"):
        rollout.require_stability(World(robot.build(params.robot), params.env))
    assert capfd.readouterr().err == ""
    rollout.require_stability(World(robot.build(known_params.robot), known_params.env))
