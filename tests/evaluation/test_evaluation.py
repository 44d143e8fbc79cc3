"""What is measured of an episode, by hand-made episodes and by real ones."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jumping_ant.evaluation import evaluation, motion
from jumping_ant.evaluation.episodes import PUBLISHED, QUANTITIES
from jumping_ant.evaluation.evaluation import Evaluation, measure, replay
from jumping_ant.params import params_file
from jumping_ant.params.blocks import EvaluateParams
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import Episode
from jumping_ant.sim.world import World

KINDS = ("hip", "ankle")


@pytest.fixture(scope="module")
def world(robot_xml: str, known_params: Params) -> World:
    return World(robot_xml, known_params.env)


@pytest.fixture(scope="module")
def short_world(robot_xml: str, short: Params) -> World:
    return World(robot_xml, short.env)


@pytest.fixture(scope="module")
def short(known_params: Params) -> Params:
    """Three short episodes."""
    limits = {"max_episode_steps": 60, "min_torso_height": 0.3}
    env = known_params.env.model_copy(update=limits)
    evaluate = EvaluateParams(episodes=3, baseline_episodes=3, seed=9)
    return known_params.model_copy(update={"env": env, "evaluate": evaluate})


def evaluate(world: World, params: Params, policies: dict[int, Policy]) -> Evaluation:
    versions = {seed: {PUBLISHED: policy} for seed, policy in policies.items()}
    return evaluation.evaluate(world, params, "random", versions)


def uniform() -> dict[int, Policy]:
    return {seed: UniformPolicy(seed, ActionSet(), 8) for seed in (4, 7)}


@pytest.fixture(scope="module")
def evaluated(short_world: World, short: Params) -> Evaluation:
    return evaluate(short_world, short, uniform())


def still_episode(steps: int = 4) -> Episode:
    """An episode of a robot that hangs at 0.5 m and does nothing."""
    qpos = np.zeros((steps, 15))
    qpos[:, 2:4] = 0.5, 1.0
    return Episode(
        start_qpos=qpos[0],
        start_qvel=np.zeros(14),
        qpos=qpos,
        qvel=np.zeros((steps, 14)),
        torques=np.zeros((steps, 8)),
        rewards=np.zeros(steps),
        terms={},
        airborne=np.zeros(steps, dtype=np.bool_),
        terminated=False,
    )


def test_a_robot_that_does_nothing(world: World) -> None:
    measured = measure(world, still_episode())
    heights = dict.fromkeys(("peak_height", "mean_height"), 0.5)
    expected = dict.fromkeys(QUANTITIES, 0) | heights
    expected |= {"length": 4, "fluidity": np.nan, "survived": 1}
    assert measured == pytest.approx(expected, abs=0, nan_ok=True)


def test_quantities_by_hand(world: World, known_params: Params) -> None:
    episode = still_episode()
    episode.qpos[:, :3] = [[1, 0, 0.7], [2, 5, 1.5], [1, 1, 1.0], [3, 4, 0.8]]
    episode.torques[:, 0] = [1, -1, -1, 0]  # hip_4
    episode.torques[2:, 3] = 0.5  # ankle_1
    joints = [world.model.joint(name).dofadr[0] for name in ("hip_4", "ankle_1")]
    assert joints == [12, 7]
    episode.qvel[:, joints] = [[2, 9], [3, 9], [0, -4], [5, 1]]
    episode = replace(
        episode,
        start_qpos=np.array([0, 0, 0.5, 1, *[0] * 11]),
        rewards=np.array([1.0, 2.0, 3.5, 0.0]),
        airborne=np.array([True, True, False, True]),
        terminated=True,
    )
    gear = known_params.robot.gear
    changes = [2**2, 0.5**2, 1**2]  # of any motor, from step to step
    assert measure(world, episode) == pytest.approx(
        {
            "length": 4,
            "return": 6.5,
            "peak_height": 1.5,
            "apex": 1.5,  # of 0.7 and 1.5; the last step is too short for a jump
            "mean_height": (0.5 + 0.7 + 1.5 + 1.0 + 0.8) / 5,
            "jumps": 1,  # 0.1 s are two control steps
            "airborne_seconds": 3 * 0.05,
            "flight": 3 / 4,
            "torque_change": sum(changes) / (3 * 8),
            "fluidity": np.nan,  # shorter than a window
            "work": gear * (1 * 2 + 1 * 3 + 0 + 0.5 * 4 + 0 * 5 + 0.5 * 1) * 0.05,
            "drift": 5.0,
            "survived": 0,
        },
        nan_ok=True,
    )


def test_fluidity_is_that_of_all_driven_joints(world: World) -> None:
    seconds = 0.05 * np.arange(101)
    swing = 0.5 * np.sin(2 * np.pi * 2.0 * seconds)  # [ranges]
    ranges = [np.ptp(world.model.joint(f"{kind}_{leg}").range) for leg in "1234" for kind in KINDS]
    states = np.concatenate([np.ones((101, 7)), np.outer(swing, ranges)], axis=1)
    episode = replace(still_episode(100), start_qpos=states[0], qpos=states[1:])
    expected = motion.fluidity(np.outer(swing, np.ones(8)), 0.05)
    assert measure(world, episode)["fluidity"] == pytest.approx(expected)
    states[-21:] = np.nan  # the second window is whole no more
    expected = motion.fluidity(np.outer(swing[:41], np.ones(8)), 0.05)
    assert measure(world, episode)["fluidity"] == pytest.approx(expected)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_broken_state_is_left_out(world: World, bad: float) -> None:
    episode = still_episode()
    episode.qpos[1] = 2.0
    episode.qpos[-1] = episode.qvel[-1] = bad
    measured = measure(world, episode)
    assert np.isnan(measured.pop("fluidity"))
    assert np.isfinite(list(measured.values())).all()
    assert measured["length"] == 4
    assert measured["peak_height"] == 2.0
    assert measured["drift"] == 0.0  # to the last place there is


def test_replay_is_the_episode_to_the_last_bit(short_world: World) -> None:
    episode = rollout.run(short_world, UniformPolicy(0, ActionSet(), 8), [3, 4, 5], 2)[1]
    trajectory = replay(short_world, episode, "sac", 0, 1)
    for name in ("qpos", "qvel"):
        start, *states = getattr(trajectory, name)[:: short_world.env.frame_skip]
        np.testing.assert_array_equal(start, getattr(episode, f"start_{name}"))
        np.testing.assert_array_equal(states, getattr(episode, name))
    np.testing.assert_array_equal(trajectory.torques, episode.torques)
    assert (trajectory.seed, trajectory.episode) == (0, 1)
    assert (trajectory.timestep, trajectory.frame_skip) == (0.01, 5)
    assert trajectory.episode_return == trajectory.rewards.sum()


def test_replay_keeps_an_episode_that_broke_down(robot_xml: str, short: Params) -> None:
    wild = World(robot_xml, short.env.model_copy(update={"reset_noise_scale": 1e150}))
    episode = rollout.run(wild, UniformPolicy(0, ActionSet(), 8), [3])[0]
    assert episode.terminated and len(episode.rewards) == 1
    assert len(replay(wild, episode, "sac", 0, 0).qpos) == 6
    assert np.isfinite(measure(wild, episode)["return"])


def test_every_seed_plays_a_block_of_its_own_in_any_run(
    evaluated: Evaluation, short_world: World, short: Params
) -> None:
    table = evaluated.episodes
    assert list(table.columns) == ["seed", "episode", "episode_seed", *QUANTITIES]
    assert table["seed"].tolist() == [4, 4, 4, 7, 7, 7]
    assert table["episode"].tolist() == [0, 1, 2, 0, 1, 2]
    assert table["episode_seed"].tolist() == [21, 22, 23, 30, 31, 32]  # from 9 + 3 * seed on
    ran = rollout.run(short_world, uniform()[7], [30, 31, 32])
    assert table["return"][3:].tolist() == [episode.total() for episode in ran]
    alone = evaluate(short_world, short, {7: uniform()[7]}).episodes
    expected = table[table["seed"] == 7].reset_index(drop=True)
    pd.testing.assert_frame_equal(alone, expected, check_exact=True)


def test_the_same_policy_is_played_once_and_for_as_long_as_asked(
    short_world: World, short: Params, monkeypatch: pytest.MonkeyPatch
) -> None:
    published, other = uniform().values()
    shorter = short.evaluate.model_copy(update={"baseline_episodes": 2})
    params = short.model_copy(update={"evaluate": shorter})
    played, play = [], rollout.play
    monkeypatch.setattr(rollout, "play", lambda _, of, n: played.append([*of]) or play(_, of, n))
    versions = {5: {PUBLISHED: published, "final": published, "best_sample": other}}
    found = evaluation.evaluate(short_world, params, "pgpe", versions)
    starts = [(own, start) for own in (published, other) for start in (24, 25, 26)]
    assert [own[:2] for own in played[0]] == starts
    evaluation.evaluate(short_world, params, "sac", {5: {PUBLISHED: published, "final": other}})
    assert [own[:2] for own in played[-2]] == starts[:5]
    counts = found.variants[["seed", "variant", "episodes"]].values.tolist()
    assert counts == [[5, "final", 3], [5, "best_sample", 3]]
    expected = found.episodes.mean(numeric_only=True)
    returns = [own.total() for own in rollout.run(short_world, other, [24, 25, 26])]
    for name in QUANTITIES:
        assert found.variants[name][0] == pytest.approx(expected[name], nan_ok=True)
    assert found.variants["return"][1] == np.mean(returns)


def test_the_trajectory_is_that_of_the_median_return(
    evaluated: Evaluation, short_world: World, short: Params
) -> None:
    median = evaluated.median
    row = evaluated.episodes.sort_values("return").iloc[2]  # the lower one of the middle two
    assert (median.agent, median.episode_return) == ("random", row["return"])
    assert (median.seed, median.episode) == (row["seed"], row["episode"])
    three = evaluate(short_world, short, {4: uniform()[4]})
    assert three.median.episode_return == three.episodes["return"].median()


def test_the_terms_of_a_reward_stand_beside_their_sum(short_world: World, short: Params) -> None:
    content = short.model_dump()
    content["env"]["reward"]["alive"] = {"weight": 2.0}
    both = replace(short_world, env=params_file.check(content).env)
    evaluated = evaluate(both, short, {4: uniform()[4]})
    table, trajectory = evaluated.episodes, evaluated.median
    terms = table[["return_torso_height", "return_alive"]]
    np.testing.assert_allclose(terms.sum(axis=1), table["return"], rtol=1e-12)
    assert (table["return_alive"] == 2 * (table["length"] - 1 + table["survived"])).all()
    assert list(trajectory.terms) == ["torso_height", "alive"]
    np.testing.assert_allclose(sum(trajectory.terms.values()), trajectory.rewards)
    assert "return_alive" in evaluation.summarize(table)


def test_seeds_count_alike_in_the_means_over_what_is_defined() -> None:
    table = pd.DataFrame({"seed": [3, 3, 3, 5, 7], "return": [1.0, 2.0, 6.0, 10.0, 4.0]})
    table["fluidity"] = [-2.0, np.nan, -4.0, -6.0, np.nan]
    by_seed = evaluation.seed_means(table)
    assert by_seed["seed"].tolist() == [3, 5, 7]
    assert by_seed["return"].tolist() == [3.0, 10.0, 4.0]
    np.testing.assert_array_equal(by_seed["fluidity"], [-3.0, -6.0, np.nan])
    assert evaluation.summarize(table) == {"return": pytest.approx(17 / 3), "fluidity": -4.5}
    assert "fluidity" not in evaluation.summarize(table[-1:]), "no episode has one"
