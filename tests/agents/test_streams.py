"""Trainings of neighbouring seeds meet no start state of one another."""

from typing import Any

import numpy as np
import pytest

from jumping_ant.agents.evolution import trainer as evolution
from jumping_ant.agents.off_policy import trainer as off_policy
from jumping_ant.agents.open_loop import trainer as open_loop
from jumping_ant.params import params_file
from jumping_ant.sim import vector

PARAMS = params_file.load()
EPISODE_STEPS, NUM_STARTS = 10, 6
NETWORKS = {
    "total_steps": 240,
    "num_envs": NUM_STARTS,
    "episode_steps": EPISODE_STEPS,
    "long_episodes": 0.0,
    "learning_starts": 1000,
    "net_arch": [8],
}
SMALL: dict[str, tuple[Any, dict[str, Any]]] = {
    "dqn": (off_policy, NETWORKS),
    "sac": (off_policy, NETWORKS),
    "pgpe": (
        evolution,
        {"generations": 2, "population_size": NUM_STARTS, "episode_steps": EPISODE_STEPS},
    ),
    "metronome": (
        open_loop,
        {"half_periods": [2, 3], "episodes": NUM_STARTS, "episode_steps": EPISODE_STEPS},
    ),
}


@pytest.mark.parametrize("name", sorted(SMALL))
def test_no_environment_starts_as_one_of_a_neighbouring_seed(
    robot_xml: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    trainer, changes = SMALL[name]
    agent = PARAMS.agents[name].model_copy(update=changes)
    drawn: list[bytes] = []
    original = vector.start_state

    def start_state(*args: Any) -> Any:
        qpos, qvel = original(*args)
        drawn.append(np.concatenate([qpos, qvel]).tobytes())
        return qpos, qvel

    monkeypatch.setattr(vector, "start_state", start_state)
    starts = []
    for seed in range(4):
        drawn.clear()
        list(trainer.train(robot_xml, PARAMS.env, agent, seed, evaluations=1))
        assert len(set(drawn[:NUM_STARTS])) == NUM_STARTS, "each environment starts otherwise"
        assert len(drawn) >= 2 * NUM_STARTS, "the next episodes are looked at, too"
        starts.append(set(drawn))
    assert len(set.union(*starts)) == sum(map(len, starts))
