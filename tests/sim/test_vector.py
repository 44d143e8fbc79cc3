"""The batched environment: each of its rows is the same, whatever runs beside it."""

import copy
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from commands import COMMAND_SIGNS
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from jumping_ant.base.errors import InputError
from jumping_ant.params.blocks import RewardParams, TermParams
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.rewards import TERMS
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

STILL = np.zeros((3, 8))
LEVELS = ActionSet(hold=3, levels=3)


@pytest.fixture
def make(robot_xml: str, known_params: Params) -> Any:
    def make_envs(
        num_envs: int = 3,
        num_threads: int = 1,
        mode: AutoresetMode = AutoresetMode.SAME_STEP,
        xml: str = robot_xml,
        actions: ActionSet | None = None,
        **task: Any,
    ) -> RobotVectorEnv:
        world = World(xml, known_params.env.model_copy(update=task))
        return RobotVectorEnv(world, num_envs, num_threads, mode, actions)

    return make_envs


def torques(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (*shape, 8)).astype(np.float32)


def test_episodes_do_not_depend_on_how_many_run(make: Any) -> None:
    def episodes(num_envs: int, num_threads: int) -> np.ndarray:
        envs = make(num_envs, num_threads, max_episode_steps=10)
        steps = [envs.reset(seed=3)[0]]
        steps += [envs.step(action[:num_envs])[0] for action in torques(25, 9)]
        return np.array(steps)

    few, many = episodes(2, 1), episodes(9, 2)
    np.testing.assert_array_equal(few, many[:, :2])
    assert len(np.unique(many[0, :, 0])) == 9  # noise differs


def test_a_seed_each_or_one_to_count_from(make: Any) -> None:
    counted, _ = make().reset(seed=5)
    listed, _ = make().reset(seed=[7, 6, 5])
    np.testing.assert_array_equal(counted, listed[::-1])
    envs = make()
    envs.reset(seed=5)
    first = envs.reset()[0]
    envs.reset(seed=5)
    np.testing.assert_array_equal(envs.reset(seed=None)[0], first)
    assert (first != counted).all()
    for seeds in ([], [1, 2], [1, 2, 3, 4]):
        with pytest.raises(ValueError, match="zip"):
            envs.reset(seed=seeds)


def test_without_autoreset_a_mask_restarts_what_it_names(make: Any) -> None:
    envs = make(mode=AutoresetMode.DISABLED, max_episode_steps=2)
    envs.reset(seed=0)
    for truncated in (False, True, True):
        ended = envs.qpos.copy()
        observations, _, _, truncations, infos = envs.step(STILL)
        assert truncations.tolist() == [truncated] * 3
        assert "final_obs" not in infos
    assert np.array_equal(envs.qpos, ended), "it stands still"
    reference = make()
    reference.reset(seed=0)
    second_start = reference.reset()[0]
    mask = np.array([False, True, False])
    restarted, _ = envs.reset(seed=[100, None, 102], options={"reset_mask": mask})
    np.testing.assert_array_equal(restarted[1], second_start[1])
    np.testing.assert_array_equal(restarted[~mask], observations[~mask])
    assert envs.step(STILL)[3].tolist() == [True, False, True]
    np.testing.assert_array_equal(envs.reset()[0][~mask], second_start[~mask])


@pytest.mark.parametrize("mode", [AutoresetMode.DISABLED, AutoresetMode.NEXT_STEP])
def test_what_does_not_fit_changes_no_robot(make: Any, mode: AutoresetMode) -> None:
    envs = make(mode=mode, max_episode_steps=1)
    with pytest.raises(ResetNeeded):
        envs.step(STILL)
    envs.reset(seed=0)
    envs.step(STILL)
    before = envs.save_state()
    for actions in (STILL[0], STILL[:1], STILL[:2], 0.0):
        with pytest.raises(InputError, match=r"actions: given shape .*, allowed: \(3, 8\)"):
            envs.step(actions)
    for mask in ([True, False], [[True] * 3], [1, 0, 0], True, None):
        with pytest.raises(InputError, match=r"reset_mask: given .*, allowed: bool of \(3,\)"):
            envs.reset(seed=1, options={"reset_mask": np.array(mask)})
    for seeds in ([1, 2], [1, 2, -3]):
        with pytest.raises((ValueError, gym.error.Error)):
            envs.reset(seed=seeds)
    np.testing.assert_equal(envs.save_state(), before)


@pytest.mark.parametrize("actions", [ActionSet(), ActionSet(0.5 * COMMAND_SIGNS, hold=3)])
@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_infos_and_resets_are_those_of_sync_vector_env(
    make: Any, mode: AutoresetMode, actions: ActionSet
) -> None:
    """To the last bit, keys and masks included, with ends of both kinds."""
    task = {"max_episode_steps": 30, "min_torso_height": 0.5}
    ours = make(4, num_threads=2, mode=mode, actions=actions, **task)
    single = partial(RobotEnv, ours.world, actions=actions)
    theirs = gym.vector.SyncVectorEnv([single] * 4, autoreset_mode=mode)
    assert ours.single_action_space == theirs.single_action_space
    assert ours.single_observation_space == theirs.single_observation_space
    same(ours.reset(seed=3), theirs.reset(seed=3))
    ends = np.zeros(2, dtype=np.int64)
    ours.action_space.seed(0)
    for _ in range(150):
        action = ours.action_space.sample()
        outcome = ours.step(action)
        same(outcome, theirs.step(action))
        ends += [outcome[2].sum(), outcome[3].sum()]
    assert ends.min() > 0, ends
    theirs.close()


def same(ours: Any, theirs: Any) -> None:
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys()
        for key in theirs:
            same(ours[key], theirs[key])
    elif isinstance(theirs, tuple):
        for mine, other in zip(ours, theirs, strict=True):
            same(mine, other)
    elif theirs.dtype == object:  # observations, and None where there is none
        for mine, other in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(mine, other)
    else:
        np.testing.assert_array_equal(ours, theirs)


def test_a_batch_draws_a_picture_of_each() -> None:
    size = {"render_mode": "rgb_array", "width": 96, "height": 64}
    envs: Any = gym.make_vec("JumpingAnt-v0", num_envs=2, **size)
    single: Any = gym.make("JumpingAnt-v0", **size)
    envs.reset(seed=3)
    single.reset(seed=4)
    for action in torques(5):
        envs.step(np.stack([action, action]))
        single.step(action)
    pictures, alone = envs.render(), single.render()
    assert [each.shape for each in pictures] == [(64, 96, 3)] * 2
    assert np.array_equal(pictures[1], alone) and not np.array_equal(pictures[0], alone)
    for drawn in (envs, single):
        drawn.close()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e12, 1e200])
def test_a_simulation_that_breaks_down_ends_alone(make: Any, bad: float) -> None:
    envs, healthy = make(num_threads=2), make()
    envs.reset(seed=0)
    healthy.reset(seed=0)
    envs.qvel[1, 7] = bad
    for step, action in enumerate(torques(5, 3)):
        observations, rewards, terminations, truncations, infos = envs.step(action)
        expected, expected_rewards, *_ = healthy.step(action)
        assert terminations.tolist() == [False, step == 0, False]
        assert not truncations.any()
        assert np.isfinite(observations).all() and np.isfinite(rewards).all()
        assert step > 0 or np.isfinite(infos["final_obs"][1]).all()
        np.testing.assert_array_equal(observations[[0, 2]], expected[[0, 2]])
        np.testing.assert_array_equal(rewards[[0, 2]], expected_rewards[[0, 2]])


def test_a_simulation_that_mujoco_gives_up_ends_alone(make: Any, robot_xml: str) -> None:
    """Memory for a robot in the air, and too little for one with its feet on the ground."""
    tight = robot_xml.replace("<default>", '<size memory="10K"/><default>', 1)
    envs = make(xml=tight, min_torso_height=0.0, reset_noise_scale=0.0)
    envs.reset(seed=0)
    envs.qpos[:, 2] = [5.0, 0.3, 5.0]
    envs.qpos[1, 8::2] = [1, -1, -1, 1]  # ankles down
    _, _, terminations, _, infos = envs.step(STILL)
    assert terminations.tolist() == [False, True, False]
    assert np.isfinite(infos["final_obs"][1]).all()


def test_what_is_returned_does_not_change_later(make: Any) -> None:
    envs = make(max_episode_steps=4)
    returned: list[Any] = [*envs.reset(seed=0)]
    for action in torques(6, 3):
        returned += envs.step(action)
    before = copy.deepcopy(returned)
    assert any("final_obs" in part for part in returned if isinstance(part, dict))
    for action in torques(6, 3):
        envs.step(action)
    same(tuple(returned), tuple(before))


@pytest.mark.parametrize(
    "actions",
    [ActionSet(amplitude=0.5, hold=3), ActionSet(0.5 * COMMAND_SIGNS, hold=3), LEVELS],
    ids=["torques", "commands", "levels"],
)
def test_a_decision_is_so_many_steps_of_the_same_torques(make: Any, actions: ActionSet) -> None:
    """To the last bit, with ends of both kinds in the middle of decisions."""
    task = {"max_episode_steps": 50, "min_torso_height": 0.3, "mode": AutoresetMode.DISABLED}
    held, plain = make(20, 2, actions=actions, **task), make(20, **task)
    held.reset(seed=4)
    plain.reset(seed=4)
    held.action_space.seed(1)
    alive, ends = np.ones(20, dtype=bool), set()
    while alive.any():
        choices, before, earned = held.action_space.sample(), alive.copy(), np.zeros(20)
        *outcome, infos = held.step(choices)
        for step in range(3):
            seen, reward, terminated, truncated, info = plain.step(actions.torques(choices))
            earned += reward * alive
            ends |= {(step, fell) for fell in terminated[alive & (terminated | truncated)].tolist()}
            alive &= ~(terminated | truncated)
        values = [*outcome, infos["torso_height"], infos["reward_torso_height"]]
        expected = [seen, earned, terminated, truncated, info["torso_height"], earned]
        for mine, other in zip(values, expected, strict=True):
            np.testing.assert_array_equal(mine[before], other[before])
    assert {(0, True), (1, True)} & ends, "falls before a decision is over"
    assert (1, False) in ends, "a limit of 50 steps within a decision of 3"


def test_terms_see_velocities_and_contacts(make: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TERMS, "upright", lambda step, _: step.contacts + step.qvel[:, 5])
    envs = make(reward=RewardParams(upright=TermParams(weight=1.0)), min_torso_height=0.0)
    envs.reset(seed=3)
    for action in torques(60, 3):
        contacts = envs.step(action)[1] - envs.qvel[:, 5]
        np.testing.assert_allclose(contacts, contacts.round(), atol=1e-9)
        assert ((contacts.round() == 0) == envs.airborne).all()
    assert contacts.max() > 1
