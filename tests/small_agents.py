"""A small agent of every algorithm of the catalogue, for tests that hold for all of them."""

from functools import cache
from typing import Any

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import ALGORITHMS, row
from jumping_ant.agents.imitation.demonstrations import Demonstrations, play
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.params import presets
from jumping_ant.policies import policy_file
from jumping_ant.sim.world import World

PARAMS = presets.load("families")
# Settings that train in a second; an algorithm takes those that it has.
SMALL: dict[str, Any] = {
    **{"total_steps": 240, "num_envs": 4, "learning_starts": 20, "log_interval": 40},
    **{"batch_size": 20, "net_arch": [16], "n_epochs": 2},
    **{"generations": 6, "population_size": 4, "n_top": 1, "parenthood_ratio": 0.5},
    **{"rounds": 4, "updates_per_round": 5},
    **{"half_periods": [2, 3], "episodes": 2, "episode_steps": 20},
}


def smaller(agent: AgentBlock) -> dict[str, Any]:
    """Return changes of an agent's settings that let it train in a second."""
    changes = SMALL | ({"n_steps": 5} if row(agent).package == "on_policy" else {})
    return {name: value for name, value in changes.items() if name in type(agent).model_fields}


def agents() -> dict[str, AgentBlock]:
    """Return a small agent of every algorithm, by the algorithm's name."""
    found: dict[str, AgentBlock] = {}
    for agent in PARAMS.agents.values():
        small = agent.model_copy(update=smaller(agent))
        found.setdefault(agent.algorithm, type(agent).model_validate(small.model_dump()))
    assert found.keys() == ALGORITHMS.keys(), "presets/families has an agent of every algorithm"
    return found


def of_package(package: str) -> list[str]:
    """Return the algorithms of a package that trains."""
    return [name for name in agents() if ALGORITHMS[name].package == package]


def job(world: World, agent: AgentBlock, seed: int, **more: Any) -> Job[Any]:
    """Return a training of an agent, with demonstrations if it learns from them."""
    content = demonstrations(world.xml) if agent.learns_from_demonstrations else None
    return Job(world, agent, seed, demonstrations=content, **more)


@cache
def demonstrations(xml: str) -> bytes:
    """Return demonstrations of a linear policy that has hardly been trained."""
    world, agent = World(xml, PARAMS.env), agents()["ars"]
    held = agent.model_copy(update={"actions": agents()["bc"].actions})  # type: ignore[attr-defined]
    *_, finished = trainer_of(held)(Job(world, held, seed=0))
    expert = policy_file.parse(finished.policy)  # type: ignore[union-attr]
    played = play(world, expert, expert, list(range(10)), 60, 0.25)
    return Demonstrations(played, finished.policy).to_bytes()  # type: ignore[union-attr]
