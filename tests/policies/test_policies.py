"""Policy files: equal bytes, equal actions, and nothing in them that runs."""

import io
import json
import pickle
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small_agents
import torch
from commands import COMMAND_SIGNS
from sb3_contrib import QRDQN, TQC, CrossQ
from stable_baselines3 import DDPG, DQN, SAC, TD3

from jumping_ant.actions import ActionSet
from jumping_ant.agents.off_policy.trainer import make_model
from jumping_ant.agents.sb3.model import make_envs, policy_bytes
from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import InputError
from jumping_ant.experiment.models import Params
from jumping_ant.policies import policy_file
from jumping_ant.policies.blind import OpenLoopPolicy, UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.networks import (
    GaussianActor,
    GreedyCommands,
    NormalizedActor,
    QuantileCommands,
    TanhActor,
)
from jumping_ant.sim.env import Decisions, RobotEnv

OBSERVATIONS = np.random.default_rng(0).normal(0, 3, (50, 27))
COMMANDS = ActionSet(0.5 * COMMAND_SIGNS, hold=3)
SB3: dict[str, tuple[Any, type]] = {
    "sac": (SAC, GaussianActor),
    "td3": (TD3, TanhActor),
    "ddpg": (DDPG, TanhActor),
    "tqc": (TQC, GaussianActor),
    "crossq": (CrossQ, NormalizedActor),
    "dqn": (DQN, GreedyCommands),
    "qrdqn": (QRDQN, QuantileCommands),
}


def linear_policy(actions: ActionSet = ActionSet()) -> LinearPolicy:  # noqa: B008 - it is frozen
    generator = np.random.default_rng(1)
    return LinearPolicy(
        weight=generator.normal(0, 0.1, (8, 27)).astype(np.float32),
        bias=generator.normal(0, 0.1, 8).astype(np.float32),
        mean=generator.normal(0, 1, 27).astype(np.float32),
        stdev=generator.uniform(0.5, 2, 27).astype(np.float32),
        weight_spread=generator.uniform(0.1, 0.2, (8, 27)).astype(np.float32),
        bias_spread=generator.uniform(0.1, 0.2, 8).astype(np.float32),
        actions=actions,
    )


@pytest.fixture(scope="module", params=SB3)
def network(request: pytest.FixtureRequest, robot_xml: str, known_params: Params) -> Any:
    """An untrained model of Stable-Baselines3 and its policy file, written twice."""
    small = {"net_arch": [16, 8], "buffer_size": 10, "num_envs": 1, "velocity_scale": 0.3}
    agent = small_agents.agents()[request.param]
    actions = agent.actions.model_copy(update={"amplitude": 0.75, "hold": 2})
    agent = agent.model_copy(update=small | {"actions": actions})
    chosen = ActionSet.of(actions, known_params.env.commands)
    model = make_model(make_envs(robot_xml, known_params.env, agent, seed=5), agent, seed=5)
    generator = torch.Generator().manual_seed(0)
    for name, numbers in model.policy.state_dict().items():  # as if it had learned something
        if name.endswith((".weight", ".bias", ".scale", ".ra_mean", ".ra_var")):
            numbers += 0.3 * torch.rand(numbers.shape, generator=generator)
    files = [policy_bytes(model, agent, chosen) for _ in range(2)]
    return request.param, model, *files


def sb3_torques(algorithm: str, model: Any) -> np.ndarray:
    actions, _ = model.predict(OBSERVATIONS.astype(np.float32), deterministic=True)
    return 0.75 * (COMMAND_SIGNS[actions] if algorithm in ("dqn", "qrdqn") else actions)


def test_networks_act_as_in_stable_baselines3(network: Any) -> None:
    algorithm, model, content, _ = network
    policy = policy_file.parse(content)
    assert isinstance(policy, SB3[algorithm][1])
    assert policy.actions.hold == 2
    torques = policy.act(OBSERVATIONS)
    np.testing.assert_allclose(torques, sb3_torques(algorithm, model), rtol=0, atol=1e-5)
    assert len(np.unique(torques, axis=0)) > 1  # it does look at what it sees


@pytest.mark.filterwarnings("ignore:.n_steps=")  # it matters for training only
def test_stable_baselines3_loads_the_same_file(network: Any) -> None:
    algorithm, model, content, _ = network
    loaded = SB3[algorithm][0].load(io.BytesIO(policy_file.owned(content, ("a", 1))), device="cpu")
    np.testing.assert_array_equal(sb3_torques(algorithm, loaded), sb3_torques(algorithm, model))


@pytest.mark.filterwarnings("ignore:.n_steps=")
def test_stable_baselines3_plays_a_policy_file_as_the_project_does(
    network: Any, robot_xml: str, known_params: Params
) -> None:
    """`SAC.load` and `DQN.load`, in an environment whose steps are the agent's decisions."""
    algorithm, _, content, _ = network
    ours, theirs = (
        policy_file.parse(content),
        SB3[algorithm][0].load(io.BytesIO(content), device="cpu"),
    )
    env = RobotEnv(robot_xml, known_params.env)
    decisions = Decisions(env, ours.actions)
    assert decisions.action_space == theirs.action_space
    played = []
    for observation in OBSERVATIONS:
        decisions.reset(seed=0)
        choice, _ = theirs.predict(observation, deterministic=True)
        decisions.step(choice)
        played.append(env.data.ctrl.copy())
    np.testing.assert_allclose(played, ours.act(OBSERVATIONS), rtol=0, atol=1e-5)
    assert np.ptp(played, axis=0).max() > 0.1, "the choices differ from state to state"


def test_networks_saved_again_are_the_same_bytes(network: Any) -> None:
    _, _, content, again = network
    assert content == again
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}


NUMBERS = {
    "linear": linear_policy(ActionSet(amplitude=0.25, hold=4)),
    "uniform": UniformPolicy(3, ActionSet(amplitude=0.25, hold=4), 8),
    "uniform commands": UniformPolicy(3, COMMANDS, 8),
    "open loop": OpenLoopPolicy(ActionSet(COMMAND_SIGNS[[3, 4]], hold=3)),
}


@pytest.mark.parametrize("policy", NUMBERS.values(), ids=NUMBERS.keys())
def test_files_are_the_same_bytes_and_act_the_same(policy: Any, tmp_path: Path) -> None:
    content = policy.to_bytes()
    (tmp_path / "policy.zip").write_bytes(content)
    loaded: Any = policy_file.load(tmp_path / "policy.zip")
    assert type(loaded) is type(policy)
    assert loaded.to_bytes() == content == policy.to_bytes()
    mine, read = policy.actions, loaded.actions
    assert (read.hold, read.amplitude) == (mine.hold, mine.amplitude)
    assert np.array_equal(read.table, mine.table) and (read.table is None) == (mine.table is None)
    for one in (policy, loaded):
        one.start(range(50))
    np.testing.assert_array_equal(loaded.act(OBSERVATIONS), policy.act(OBSERVATIONS))


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


def test_velocities_are_scaled_and_positions_are_not(network: Any) -> None:
    factors = policy_file.parse(network[2]).factors
    assert factors[:13].tolist() == [1.0] * 13
    np.testing.assert_allclose(factors[13:], [0.3] * 14, rtol=1e-6)


def test_the_interface_is_read_without_the_policy(network: Any, tmp_path: Path) -> None:
    for name, content in (
        ("network", network[2]),
        *((k, p.to_bytes()) for k, p in NUMBERS.items()),
    ):
        policy = policy_file.parse(content)
        (tmp_path / name).write_bytes(content)
        found = policy_file.read_interface(tmp_path / name)
        assert (found.num_observations, found.num_motors) == (policy.num_observations, 8)
        assert found.actions.hold == policy.actions.hold
    assert policy_file.parse(network[2]).num_observations == 27
    (tmp_path / "torn").write_bytes(network[2][:-9])
    with pytest.raises(InputError, match="torn: not a policy file .*; `dvc repro` trains it"):
        policy_file.read_interface(tmp_path / "torn")


SIZES = {"num_observations": 27, "num_motors": 8}


def archive(kind: Any, /, table: Any = None, hold: Any = 1, **entries: bytes) -> bytes:
    header = SIZES | {"format": 3, "kind": kind, "amplitude": 1.0, "hold": hold}
    tables = {} if table is None else {"commands.npy": npy(table)}
    return pack({"policy.json": json.dumps(header | {"seed": 0}).encode(), **tables, **entries})


def npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def tensors(**state: Any) -> bytes:
    buffer = io.BytesIO()
    torch.save({name: torch.from_numpy(value) for name, value in state.items()}, buffer)
    return buffer.getvalue()


def one_layer(prefix: str, outputs: Any, bias: Any) -> bytes:
    network = prefix.partition(".")[0]
    factors = {f"{network}.features_extractor.factors": np.ones(27)}
    layer = {f"{prefix}.weight": np.ones(outputs), f"{prefix}.bias": np.ones(bias)}
    return tensors(**factors, **layer)


HEADER = SIZES | {"format": 3, "kind": "uniform", "seed": 0, "hold": 1, "amplitude": 1.0}


def with_amplitude(amplitude: Any) -> bytes:
    return pack({"policy.json": json.dumps(HEADER | {"amplitude": amplitude}).encode()})


def actor(*weights: Any) -> dict[str, Any]:
    """TD3's network of these layers, as its file has it."""
    state = {"actor.features_extractor.factors": np.ones(27)}
    for number, weight in enumerate(weights):
        state |= {
            f"actor.mu.{number}.weight": weight,
            f"actor.mu.{number}.bias": weight[:, 0].copy(),
        }
    return state


def bomb(*shape: int) -> bytes:
    """A network whose weights are one number, again and again: a few kB that say terabytes."""
    number = torch.ones(1)
    state = {
        "actor.features_extractor.factors": number.expand(shape[1]),
        "actor.mu.weight": number.expand(shape),
        "actor.mu.bias": number.expand(shape[0]),
    }
    buffer = io.BytesIO()
    torch.save(state, buffer)
    return buffer.getvalue()


def compressed(content: bytes) -> bytes:
    """The same archive, compressed."""
    entries, buffer = Archive(content), io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name in entries:
            packed.writestr(name, entries[name])
    return buffer.getvalue()


def says(shape: tuple[int, ...]) -> bytes:
    """An .npy file whose header says more than it holds."""
    small = npy(np.zeros((8, 27), np.float32))
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}"
    return small[:10] + header.encode().ljust(117) + b"\n" + small[128:]


NETWORK_OF_FIVE = one_layer("q_net.q_net.0", (5, 27), 5)
NETWORK_OF_NINE = one_layer("q_net.q_net.0", (9, 27), 9)
OPEN_LOOP = dict(Archive(NUMBERS["open loop"].to_bytes()))
LINEAR = linear_policy().to_bytes()
ARRAYS = dict(Archive(LINEAR))
DAMAGED = {
    "empty": b"",
    "text": b"no policy at all",
    "truncated": LINEAR[:-30],
    "flipped bit": LINEAR[:400] + bytes([LINEAR[400] ^ 1]) + LINEAR[401:],
    "foreign zip": pack({"a.txt": b"a"}),
    "no header": pack({name: ARRAYS[name] for name in ARRAYS if name != "policy.json"}),
    "header of other kind": archive("ppo"),
    "header of odd kind": archive(["linear"]),
    "header not JSON": pack({"policy.json": b"{"}),
    "header a list": pack({"policy.json": b"[]"}),
    "array missing": pack({name: ARRAYS[name] for name in ARRAYS if name != "bias.npy"}),
    "array of other shape": pack(ARRAYS | {"weight.npy": npy(np.zeros((8, 26)))}),
    "too few torques": pack(
        ARRAYS | {"weight.npy": npy(np.zeros((7, 27))), "bias.npy": npy(np.zeros(7))}
    ),
    "no network": archive("sac", **{"policy.pth": tensors()}),
    "other network": archive("sac", **{"policy.pth": one_layer("actor.mu", (8, 26), 8)}),
    "flat network": archive("sac", **{"policy.pth": one_layer("actor.mu", 27, 1)}),
    "too many commands": archive("dqn", COMMAND_SIGNS, **{"policy.pth": NETWORK_OF_NINE}),
    "commands without a table": archive("dqn", **{"policy.pth": NETWORK_OF_FIVE}),
    "torn tensors": archive("dqn", COMMAND_SIGNS, **{"policy.pth": NETWORK_OF_FIVE[:-50]}),
    "open loop without a table": archive("open_loop"),
    "table without rows": archive("open_loop", COMMAND_SIGNS[:0]),
    "table of other width": archive("open_loop", COMMAND_SIGNS[:, :7]),
    "flat table": archive("open_loop", COMMAND_SIGNS[0]),
    "table of text": archive("open_loop", np.full((2, 8), "up")),
    "table of infinities": archive("open_loop", np.full((2, 8), np.inf)),
    "table beyond the peak torque": archive("open_loop", np.full((2, 8), 1.5)),
    "torn table": pack(OPEN_LOOP | {"commands.npy": OPEN_LOOP["commands.npy"][:-5]}),
    "held for no time": archive("uniform", hold=0),
    "held backwards": archive("uniform", hold=-3),
    "held for a word": archive("uniform", hold="long"),
    "held for half a step": archive("uniform", hold=0.5),
    "amplitude missing": pack({"policy.json": b'{"kind": "uniform", "seed": 0, "hold": 1}'}),
    "amplitude no number": with_amplitude("loud"),
    "amplitude not finite": with_amplitude(float("nan")),
    "amplitude beyond the peak torque": with_amplitude(2.0),
    "later format": pack({"policy.json": ARRAYS["policy.json"].replace(b": 3,", b": 4,")}),
    "weight not a number": pack(ARRAYS | {"weight.npy": npy(np.full((8, 27), np.nan))}),
    "bias infinite": pack(ARRAYS | {"bias.npy": npy(np.full(8, np.inf))}),
    "stdev zero": pack(ARRAYS | {"stdev.npy": npy(np.zeros(27))}),
    "mean for all": pack(ARRAYS | {"mean.npy": npy(np.zeros(()))}),
    "weight of terabytes": pack(ARRAYS | {"weight.npy": says((1_000_000, 1_000_000))}),
    "compressed": compressed(LINEAR),
    "compressed tensors": archive("sac", **{"policy.pth": compressed(bomb(8, 27))}),
    "one number for all": archive("sac", **{"policy.pth": bomb(8, 27)}),
    "one number for terabytes": archive("sac", **{"policy.pth": bomb(1_000_000, 1_000_000)}),
    "network not a number": archive(
        "td3", **{"policy.pth": tensors(**actor(np.full((8, 27), np.nan)))}
    ),
    "layers of other widths": archive(
        "td3", **{"policy.pth": tensors(**actor(np.ones((9, 27)), np.ones((8, 10))))}
    ),
    "motors beyond number": pack(
        {"policy.json": json.dumps(HEADER | {"num_motors": 10**9}).encode()}
    ),
    "observations beyond number": pack(
        {"policy.json": json.dumps(HEADER | {"num_observations": 10**12}).encode()}
    ),
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED.keys())
def test_damaged_and_foreign_files_are_refused(content: bytes) -> None:
    with pytest.raises(InputError, match="policy file: .*allowed: ") as caught:
        policy_file.parse(content)
    assert "\n" not in str(caught.value)


def test_what_does_not_belong_to_a_policy_is_not_read(tmp_path: Path) -> None:
    path, size = tmp_path / "policy.zip", 2**26
    path.write_bytes(pack(ARRAYS | {"stray": bytes(size)}))
    tracemalloc.start()
    policy_file.load(path)
    policy_file.read_interface(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < size / 8


def test_the_damage_is_all_that_is_wrong() -> None:
    """What the damaged files above are made of is accepted."""
    for content in (
        archive("uniform", hold=3),
        archive("open_loop", COMMAND_SIGNS),
        archive("dqn", COMMAND_SIGNS, **{"policy.pth": NETWORK_OF_FIVE}),
        with_amplitude(0.5),
        pack(OPEN_LOOP),
        pack(ARRAYS),
        archive("td3", **{"policy.pth": tensors(**actor(np.ones((8, 27))))}),
        archive("td3", **{"policy.pth": tensors(**actor(np.ones((9, 27)), np.ones((8, 9))))}),
        pack({"policy.json": json.dumps(HEADER).encode()}),
    ):
        assert policy_file.parse(content).actions.hold >= 1


class Payload:
    """Pickled, this makes a file when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


@pytest.mark.filterwarnings("ignore:Detected pickle protocol")
def test_pickled_code_is_not_run(tmp_path: Path) -> None:
    planted = tmp_path / "planted"
    payload = Payload(planted)
    saved = io.BytesIO()
    torch.save(payload, saved)
    files = [
        archive("sac", **{"policy.pth": pickle.dumps(payload)}),
        archive("dqn", **{"policy.pth": saved.getvalue()}),
        pack(ARRAYS | {"weight.npy": npy(np.array([payload], dtype=object))}),
        pack(ARRAYS | {"mean.npy": pickle.dumps(payload)}),
        pickle.dumps(payload),
    ]
    for content in files:
        with pytest.raises(InputError, match="policy file: "):
            policy_file.parse(content)
        assert not planted.exists()
    pickle.loads(files[-1])
    assert planted.exists()  # the payload would have worked


def test_a_missing_file_names_what_writes_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"policy.zip: No such file .*; `dvc repro` trains it"):
        policy_file.load(tmp_path / "policy.zip")


def test_a_published_policy_says_whose_it_is(tmp_path: Path) -> None:
    path = tmp_path / "policy.zip"
    path.write_bytes(policy_file.owned(LINEAR, ("sac", 20)))
    assert policy_file.load(path, ("sac", 20)).to_bytes() == LINEAR
    assert policy_file.load(path).to_bytes() == LINEAR
    assert policy_file.read_interface(path, ("sac", 20)).num_motors == 8
    for owner in (("sac", 21), ("dqn", 20)):
        told = (
            f"{path}: policy file: given that of agent sac, seed 20, allowed: that of agent "
            f"{owner[0]}, seed {owner[1]}; run `dvc repro --force train@{owner[0]}`"
        )
        for read in (policy_file.load, policy_file.read_interface):
            with pytest.raises(InputError) as caught:
                read(path, owner)
            assert str(caught.value) == told
    path.write_bytes(LINEAR)
    with pytest.raises(InputError, match="given one of no agent, allowed: that of agent sac"):
        policy_file.load(path, ("sac", 20))
    path.write_bytes(pack({**Archive(LINEAR), "owner.json": b"[1]"}))
    with pytest.raises(InputError, match="given what is not a policy"):
        policy_file.load(path)
