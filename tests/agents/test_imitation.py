"""Imitation: demonstrations are what the expert does, and agents learn to do the same."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import small_agents

from jumping_ant.agents.events import Finished, Progress, Snapshot
from jumping_ant.agents.imitation.demonstrations import Demonstrations, Labelled, play
from jumping_ant.agents.imitation.trainer import train
from jumping_ant.agents.job import Job
from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import InputError
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World

ENV = small_agents.PARAMS.env.model_copy(update={"max_episode_steps": 45})
NAMES = small_agents.of_package("imitation")


@pytest.fixture(scope="module")
def demonstrations(robot_xml: str) -> Demonstrations:
    return Demonstrations.from_bytes(small_agents.demonstrations(robot_xml))


@pytest.fixture(scope="module")
def expert(demonstrations: Demonstrations) -> Policy:
    return policy_file.parse(demonstrations.expert)


def policies(name: str, xml: str, **changes: Any) -> list[Policy]:
    """Return an agent's policy after each round."""
    agent: Any = small_agents.agents()[name].model_copy(update=changes)
    events = train(small_agents.job(World(xml, ENV), agent, seed=4, evaluations=agent.rounds))
    return [policy_file.parse(event.policy) for event in events if isinstance(event, Snapshot)]


def test_an_expert_that_acts_plays_its_episodes(robot_xml: str, expert: Policy) -> None:
    """To the last bit those that an evaluation of the same start states gives."""
    seeds = [3, 5, 8]
    played = play(World(robot_xml, ENV), expert, expert, seeds, ENV.max_episode_steps, 0.0)
    for ours, theirs in zip(
        played.episodes(), rollout.run(World(robot_xml, ENV), expert, seeds), strict=True
    ):
        assert ours.returns[-1] == pytest.approx(theirs.rewards.sum(), rel=1e-12)
        held = theirs.torques[:: expert.actions.hold]
        assert np.array_equal(ours.torques, held.astype(np.float32))


def test_labels_are_the_experts_whoever_acts(robot_xml: str, expert: Policy) -> None:
    actor = policies("bc", robot_xml)[0]
    played = play(World(robot_xml, ENV), actor, expert, [3, 5], ENV.max_episode_steps, 0.0)
    np.testing.assert_allclose(
        played.torques, expert.act(played.observations.astype(np.float64)), atol=1e-5
    )
    own = play(World(robot_xml, ENV), expert, expert, [3, 5], ENV.max_episode_steps, 0.0)
    assert np.array_equal(played.observations[0], own.observations[0])
    assert not np.array_equal(played.observations[1], own.observations[1])


@pytest.mark.parametrize("name", NAMES)
def test_it_learns_what_the_expert_does(
    name: str, robot_xml: str, demonstrations: Demonstrations, expert: Policy
) -> None:
    seen = play(World(robot_xml, ENV), expert, expert, [90, 91], ENV.max_episode_steps, 0.0)
    observations = seen.observations.astype(np.float64)

    def error(policy: Policy) -> float:
        return float(np.square(policy.act(observations) - seen.torques).mean())

    first, *_, last = policies(
        name, robot_xml, updates_per_round=150, net_arch=[32], learning_rate=0.005
    )
    assert error(last) < 0.5 * error(first)
    assert error(last) < 0.5 * np.square(seen.torques).mean()


@pytest.mark.parametrize("name", NAMES)
def test_data_grow_evenly_and_count(name: str, robot_xml: str) -> None:
    agent: Any = small_agents.agents()[name]
    *events, finished = train(small_agents.job(World(robot_xml, ENV), agent, seed=0))
    rows = [event for event in events if isinstance(event, Progress)]
    assert [row.env_steps for row in rows] == [60, 120, 180, 240]
    assert [row.updates for row in rows] == [5, 10, 15, 20]
    assert isinstance(finished, Finished) and finished.env_steps == agent.total_steps
    assert rows[-1].episodes > 0


def test_behaviour_cloning_sees_demonstrations_alone(
    robot_xml: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jumping_ant.agents.imitation.trainer.play", None)
    assert len(policies("bc", robot_xml)) == 4
    with pytest.raises(TypeError, match="NoneType"):
        policies("dagger", robot_xml)


@pytest.mark.parametrize("name", NAMES)
def test_too_few_demonstrations_are_refused(
    name: str, robot_xml: str, demonstrations: Demonstrations
) -> None:
    few = demonstrations.labelled.episodes()[0]
    content = replace(demonstrations, labelled=few).to_bytes()
    agent: Any = small_agents.agents()[name].model_copy(update={"total_steps": 2400})
    for given, said in ((content, r"given \d+ control steps"), (None, "given none")):
        with pytest.raises(InputError, match=said):
            list(train(Job(World(robot_xml, ENV), agent, 0, demonstrations=given)))


def test_a_file_holds_numbers_and_the_expert(demonstrations: Demonstrations) -> None:
    content = demonstrations.to_bytes()
    read = Demonstrations.from_bytes(content)
    assert read.expert == demonstrations.expert and read.to_bytes() == content
    assert len(read.labelled.episodes()) == 10
    assert sum(map(len, read.labelled.episodes())) == len(read.labelled)


def damaged(**changes: Any) -> bytes:
    whole = {
        "observations": np.zeros((4, 27), np.float32),
        "torques": np.zeros((4, 8), np.float32),
        "returns": np.array([np.nan, np.nan, np.nan, 1.0]),
    }
    return Demonstrations(Labelled(**whole | changes), b"").to_bytes()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (damaged(torques=np.full((4, 8), 2.0, np.float32)), "above the peak torque"),
        (damaged(observations=np.full((4, 27), np.nan, np.float32)), "not finite"),
        (damaged(observations=np.zeros((3, 27), np.float32)), "different lengths"),
        (damaged(returns=np.full(4, np.nan)), "without a return"),
        (damaged(returns=np.zeros((4, 1))), "other dimensions"),
        (pack({**Archive(damaged()), "demonstrations.json": b'{"format": 2}'}), "2 instead of 1"),
        (b"what", "BadZipFile"),
    ],
)
def test_a_damaged_file_is_refused(content: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Demonstrations.from_bytes(content)
