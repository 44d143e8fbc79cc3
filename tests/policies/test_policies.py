"""Policies: equal bytes, equal actions, and those of the libraries that trained them."""

import io
import zipfile
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
import small_agents
import torch
from commands import COMMAND_SIGNS
from small_policies import NUMBERS, linear_policy
from stable_baselines3.common.type_aliases import TrainFrequencyUnit

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3.model import make_envs, make_model, policy_bytes
from jumping_ant.params.blocks import ActionParams
from jumping_ant.params.model import Params
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import OpenLoopPolicy, OscillatorPolicy, Oscillators, UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World

OBSERVATIONS = np.random.default_rng(0).normal(0, 3, (50, 27))


KINDS = ("torques", "commands", "levels")
NETWORKS = [(name, "") for name in small_agents.of_package("off_policy")]
NETWORKS += [(name, kind) for name in small_agents.of_package("on_policy") for kind in KINDS]


def librarys_class(algorithm: str) -> Any:
    """Return the class of Stable-Baselines3 that an algorithm's learner is, or derives from."""
    bases = resolve_name(ALGORITHMS[algorithm].learner).__mro__
    return next(base for base in bases if not base.__module__.startswith("jumping_ant"))


@pytest.fixture(scope="module", params=NETWORKS, ids="-".join)
def network(request: pytest.FixtureRequest, robot_xml: str, known_params: Params) -> Any:
    """An untrained model of Stable-Baselines3 and its policy file, written twice."""
    (algorithm, kind), small = request.param, {"net_arch": [16, 8], "velocity_scale": 0.3}
    agent: Any = small_agents.agents()[algorithm]
    actions = agent.actions.model_copy(update={"amplitude": 0.75, "hold": 2})
    if kind:
        levels = 2 if kind == "levels" else None
        actions = ActionParams(kind=kind, levels=levels, amplitude=0.75, hold=2)
    else:
        small["buffer_size"] = 10
    agent = agent.model_copy(update=small | {"actions": actions})
    chosen = ActionSet.of(actions, known_params.env.commands)
    job = Job(World(robot_xml, known_params.env), agent, seed=5)
    model = make_model(make_envs(job), agent, seed=5)
    generator = torch.Generator().manual_seed(0)
    for name, numbers in model.policy.state_dict().items():  # as if it had learned something
        if name.endswith((".weight", ".bias", ".scale", ".ra_mean", ".ra_var")):
            numbers += 0.3 * torch.rand(numbers.shape, generator=generator)
    files = [policy_bytes(model, agent, chosen) for _ in range(2)]
    return algorithm, model, *files


def test_units_are_pickled_the_same_under_every_python(monkeypatch: pytest.MonkeyPatch) -> None:
    pickled = cloudpickle.dumps(TrainFrequencyUnit.STEP)
    by_name = lambda unit, _: (getattr, (type(unit), unit.name))  # noqa: E731
    monkeypatch.setattr(TrainFrequencyUnit, "__reduce_ex__", by_name)
    assert cloudpickle.dumps(TrainFrequencyUnit.STEP) == pickled


def sb3_torques(model: Any) -> np.ndarray:
    actions, _ = model.predict(OBSERVATIONS.astype(np.float32), deterministic=True)
    if isinstance(model.action_space, gym.spaces.MultiDiscrete):
        assert set(np.unique(actions)) == {0, 1}
        return 0.75 * (2 * actions - 1)
    return 0.75 * (COMMAND_SIGNS[actions] if actions.ndim == 1 else np.clip(actions, -1, 1))


@pytest.mark.filterwarnings("ignore:.n_steps=")
def test_stable_baselines3_plays_a_policy_file_as_the_project_does(
    network: Any, robot_xml: str, known_params: Params
) -> None:
    """`SAC.load` and `DQN.load`, in an environment whose steps are the agent's decisions."""
    algorithm, model, content, _ = network
    content = policy_file.owned(content, ("a", 1))
    ours = policy_file.parse(content)
    assert ours.actions.hold == 2
    np.testing.assert_allclose(ours.factors, [1.0] * 13 + [0.3] * 14, rtol=1e-6)
    theirs = librarys_class(algorithm).load(io.BytesIO(content), device="cpu")
    np.testing.assert_array_equal(sb3_torques(theirs), sb3_torques(model))
    env = RobotEnv(World(robot_xml, known_params.env), actions=ours.actions)
    assert env.action_space == theirs.action_space
    played = []
    for observation in OBSERVATIONS:
        env.reset(seed=0)
        choice, _ = theirs.predict(observation, deterministic=True)
        env.step(choice)
        played.append(env.envs.batch.bind("ctrl")[0].copy())
    np.testing.assert_allclose(played, ours.act(OBSERVATIONS), rtol=0, atol=1e-5)
    assert np.ptp(played, axis=0).max() > 0.1, "the choices differ from state to state"


def test_networks_saved_again_are_the_same_bytes(network: Any) -> None:
    _, _, content, again = network
    assert content == again
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}


@pytest.mark.parametrize("policy", NUMBERS.values(), ids=NUMBERS.keys())
def test_files_are_the_same_bytes_and_act_the_same(policy: Any, tmp_path: Path) -> None:
    content = policy.to_bytes()
    (tmp_path / "policy.zip").write_bytes(content)
    loaded: Any = policy_file.load(tmp_path / "policy.zip")
    assert type(loaded) is type(policy)
    assert loaded.to_bytes() == content == policy.to_bytes()
    mine, read = policy.actions, loaded.actions
    assert (read.hold, read.amplitude, read.levels) == (mine.hold, mine.amplitude, mine.levels)
    assert np.array_equal(read.table, mine.table) and (read.table is None) == (mine.table is None)
    for one in (policy, loaded):
        one.start(range(50))
    np.testing.assert_array_equal(loaded.act(OBSERVATIONS), policy.act(OBSERVATIONS))


def test_torques_depend_on_no_row_beside_them(network: Any) -> None:
    """To the last bit: products of several rows round by their number."""
    policies = [policy_file.parse(network[2]), linear_policy()]
    observations = np.random.default_rng(5).normal(size=(37, 27))
    for policy in policies:
        expected = policy.act(observations)
        for rows in (slice(1), slice(5, 9), slice(3, 36), slice(None, None, -1)):
            np.testing.assert_array_equal(policy.act(observations[rows]), expected[rows])


def test_linear_policy_by_hand() -> None:
    weight = np.zeros((8, 27), np.float32)
    weight[0, 0], weight[1, 26], weight[2, 0] = 0.5, -2.0, 100.0
    bias = np.array([0, 0.25, 0, -7, 0, 0, 0, 0.125], np.float32)
    mean, stdev = np.full(27, 1.0, np.float32), np.full(27, 2.0, np.float32)
    observation = np.ones((1, 27))
    observation[0, 0], observation[0, 26] = 2.0, 1.5  # normalised: 0.5 and 0.25, the others 0
    policy = LinearPolicy(weight, bias, mean, stdev, weight, bias, ActionSet())
    torques = policy.act(observation)
    assert torques.tolist() == [[0.25, -0.25, 1.0, -1.0, 0, 0, 0, 0.125]]
    weaker = replace(policy, actions=ActionSet(amplitude=0.5)).act(observation)
    assert weaker.tolist() == [[0.125, -0.125, 0.5, -0.5, 0, 0, 0, 0.0625]]
    assert torques.dtype == np.float64
    signs = replace(policy, actions=ActionSet(amplitude=0.5, levels=2)).act(observation)
    assert signs.tolist() == [[0.5, -0.5, 0.5, -0.5, 0.5, 0.5, 0.5, 0.5]]


def test_random_torques_depend_on_seed_and_episode_alone() -> None:
    def torques(seed: int, episodes: list[int]) -> dict[int, np.ndarray]:
        policy = UniformPolicy(seed, ActionSet(), 8)
        policy.start(episodes)
        drawn = [policy.act(OBSERVATIONS[: len(episodes)]) for _ in range(20)]
        return dict(zip(episodes, np.stack(drawn, axis=1), strict=True))

    alone, together = torques(1, [7]), torques(1, [3, 7, 9])
    np.testing.assert_array_equal(alone[7], together[7])
    assert (together[3] != together[7]).all()
    assert (torques(2, [7])[7] != alone[7]).all()
    everything = np.concatenate(list(torques(0, list(range(100))).values()))
    assert np.abs(everything).max() <= 1
    np.testing.assert_allclose(everything.mean(axis=0), 0, atol=0.06)
    np.testing.assert_allclose(everything.std(axis=0), 1 / np.sqrt(3), atol=0.03)


def test_the_open_loop_plays_its_table_in_a_circle() -> None:
    policy = OpenLoopPolicy(ActionSet(COMMAND_SIGNS[[3, 4, 0]]))
    for _ in range(2):  # each episode begins with the first row
        policy.start([1, 2])
        drawn = np.array([policy.act(OBSERVATIONS[:2]) for _ in range(5)])
        expected = COMMAND_SIGNS[[3, 4, 0, 3, 4]]
        np.testing.assert_array_equal(drawn, np.stack([expected, expected], axis=1))


def test_oscillators_by_hand() -> None:
    """Two motors in opposite phase, whose sines last for two decisions above zero and one below."""
    amplitudes, offsets = np.array([0.5, 2.0]), np.array([0.25, 0.0])
    speeds = np.array([np.pi / 2, np.pi])
    phases = np.array([np.pi / 4, np.pi / 4 + np.pi])
    oscillators = Oscillators(amplitudes, phases, offsets, speeds)
    root = np.sqrt(0.5)
    sines = [[1, -1], [1, 1], [-1, 1], [1, -1], [1, 1]]
    expected = np.clip(np.array(sines) * root * amplitudes + offsets, -1, 1)
    policy = OscillatorPolicy(oscillators, ActionSet(amplitude=0.5))
    for _ in range(2):  # each episode begins at the phases
        policy.start([1, 2, 3])
        drawn = np.array([policy.act(OBSERVATIONS[:3]) for _ in range(5)])
        np.testing.assert_allclose(drawn, 0.5 * np.tile(expected[:, None], (1, 3, 1)))


def test_neighbours_are_drawn_around_the_centre() -> None:
    policy = linear_policy()
    generator = np.random.default_rng(0)
    drawn = [policy.sample(generator) for _ in range(2000)]
    for name in ("weight", "bias"):
        center, spread = getattr(policy, name), getattr(policy, f"{name}_spread")
        found = (np.array([getattr(one, name) for one in drawn]) - center) / spread
        np.testing.assert_allclose(found.mean(axis=0), 0, atol=0.1)
        np.testing.assert_allclose(found.std(axis=0), 1, atol=0.1)
    assert all(np.array_equal(one.mean, policy.mean) for one in drawn)


def test_the_interface_is_read_without_the_policy(network: Any, tmp_path: Path) -> None:
    for content in (network[2], *(policy.to_bytes() for policy in NUMBERS.values())):
        policy = policy_file.parse(content)
        (tmp_path / "policy.zip").write_bytes(content)
        found = policy_file.read_interface(tmp_path / "policy.zip")
        sees = 27 if hasattr(policy, "layers") or isinstance(policy, LinearPolicy) else None
        assert (found.num_observations, found.num_motors) == (sees, 8)
        assert found.actions.hold == policy.actions.hold
