"""A small agent of every algorithm of the catalogue, for tests that hold for all of them."""

from typing import Any

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.experiment import presets

PARAMS = presets.load("families")
# Settings of each family that train in a second.
SMALL: dict[str, dict[str, Any]] = {
    "off_policy": {
        "total_steps": 240,
        "num_envs": 4,
        "learning_starts": 20,
        "batch_size": 16,
        "net_arch": [16],
        "log_interval": 30,
    },
    "evolution": {"generations": 6, "population_size": 4, "episode_steps": 20},
    "open_loop": {"half_periods": [2, 3], "episodes": 2, "episode_steps": 20},
    "random": {},
}


def agents() -> dict[str, AgentBlock]:
    """Return a small agent of every algorithm, by the algorithm's name."""
    found: dict[str, AgentBlock] = {}
    for agent in PARAMS.agents.values():
        small = agent.model_copy(update=SMALL[agent.trainer])
        found.setdefault(agent.algorithm, type(agent).model_validate(small.model_dump()))
    assert found.keys() == ALGORITHMS.keys(), "presets/families has an agent of every algorithm"
    return found


def of_family(trainer: str) -> list[str]:
    """Return the algorithms of a family."""
    return [name for name, agent in agents().items() if agent.trainer == trainer]
