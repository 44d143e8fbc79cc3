"""Trainings of neighbouring seeds meet no start state of one another."""

from typing import Any

import numpy as np
import pytest
import small_agents

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World

NUM_STARTS = 6
SIZES = {
    **dict.fromkeys(("num_envs", "population_size", "episodes"), NUM_STARTS),
    **{"episode_steps": 10, "long_episodes": 0.0, "tumbled_starts": 0.0},
    "learning_starts": 1000,  # it is about the starts
}
AGENTS = {
    name: agent.model_copy(
        update={key: size for key, size in SIZES.items() if key in type(agent).model_fields}
    )
    for name, agent in small_agents.agents().items()
    if row(agent).package != "imitation" and name != "random"
}


@pytest.mark.parametrize("name", AGENTS)
def test_no_environment_starts_as_one_of_a_neighbouring_seed(
    robot_xml: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = AGENTS[name]
    drawn: list[bytes] = []
    original = Task.start_state

    def start_state(*args: Any) -> Any:
        qpos, qvel = original(*args)
        drawn.append(np.concatenate([qpos, qvel]).tobytes())
        return qpos, qvel

    monkeypatch.setattr(Task, "start_state", start_state)
    starts = []
    for seed in range(4):
        drawn.clear()
        list(trainer_of(agent)(Job(World(robot_xml, small_agents.PARAMS.env), agent, seed)))
        assert len(set(drawn[:NUM_STARTS])) == NUM_STARTS, "each environment starts otherwise"
        assert len(drawn) >= 2 * NUM_STARTS, "the next episodes are looked at, too"
        starts.append(set(drawn))
    assert len(set.union(*starts)) == sum(map(len, starts))
