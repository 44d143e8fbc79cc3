"""The agents of a run, as the claims tell them apart."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain, pairwise, permutations, product
from typing import Any

import numpy as np

from jumping_ant.comparison.results import AgentResults

LUCK = 5.0  # [standard errors] above the mean of random episodes, which luck does not reach
LEARNERS = "dqn sac pgpe"
# Settings that claims are on: whose they are, and which value means that an agent lacks something.
SETTINGS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "decrease_rewards_by": ("pgpe", lambda constant: constant == 0),
    "actions": ("pgpe", lambda actions: actions["kind"] == "commands"),
    "n_critics": ("td3", lambda number: number == 1),
}

Pair = tuple[AgentResults, AgentResults]
Select = Callable[["Field"], Iterable[tuple[AgentResults, ...]]]


class Field:
    """The agents of a run; one that only serves certain comparisons represents no algorithm."""

    def __init__(self, agents: Sequence[AgentResults], evaluation_episodes: int) -> None:
        self._edited = [agent for agent in agents if agent.block.robot == "edited"]
        self._sparse = [
            agent for agent in _of(self._edited, "sac dqn") if settings(agent)["sparse_rewards"]
        ]
        # By setting, each agent with those that are like it, but lack what the setting gives.
        self.twins = {
            key: _twins(_of(self._edited, algorithm), self._edited, key, lacks)
            for key, (algorithm, lacks) in SETTINGS.items()
        }
        aside = {agent.name for agent in self._sparse}
        aside |= {other.name for pairs in self.twins.values() for _, other in pairs}
        self._representing = [agent for agent in self._edited if agent.name not in aside]
        self.twins["robot"] = _twins(
            self.of(f"{LEARNERS} open_loop"), agents, "robot", lambda name: name == "unedited"
        )
        # Mean return of an evaluation that random agents do not exceed by luck; None without them.
        self.threshold = max(
            (out_of_luck(agent, evaluation_episodes) for agent in self.of("random")), default=None
        )

    def of(self, algorithms: str) -> list[AgentResults]:
        """Return the agents that represent algorithms, which are given as "sac dqn"."""
        return _of(self._representing, algorithms)

    def beside_random(self) -> Iterable[Pair]:
        """Return each DQN with the random agent that draws commands, or else with any."""
        random = self.of("random")
        commands = [agent for agent in random if settings(agent)["actions"]["kind"] == "commands"]
        return product(self.of("dqn"), (commands or random)[:1])

    def beside_metronomes(self) -> Iterable[Pair]:
        """Yield each learner with the best open-loop agent whose torques are no stronger."""
        for learner in self.of(LEARNERS):
            limit = settings(learner)["actions"]["amplitude"]
            weak = [
                agent for agent in self.of("open_loop") if settings(agent)["amplitude"] <= limit
            ]
            if weak:
                yield learner, max(weak, key=lambda agent: agent.quantities["return"].mean())

    def beside_sparse_rewards(self) -> Iterable[Pair]:
        """Return each PGPE with those that learned from the returns of whole episodes alone."""
        return product(self.of("pgpe"), self._sparse)

    def beside_evolution(self) -> Iterable[Pair]:
        """Return each PGPE with each agent of another evolutionary algorithm."""
        evolution = [agent for agent in self._edited if agent.family == "evolution"]
        rivals = [agent for agent in evolution if agent.algorithm != "pgpe"]
        return product(self.of("pgpe"), rivals)

    def imitators(self) -> Iterable[Pair]:
        """Return each agent with the one that it imitates."""
        pairs = permutations(self._edited, 2)
        return ((agent, other) for agent, other in pairs if agent.demonstrator == other.name)


def each(algorithms: str) -> Select:
    """Select each agent that represents one of some algorithms."""
    return lambda field: ((agent,) for agent in field.of(algorithms))


def pairs(*groups: str) -> Select:
    """Select each agent of a group of algorithms with each one of the next group."""
    return lambda field: chain.from_iterable(
        product(field.of(one), field.of(other)) for one, other in pairwise(groups)
    )


def twins(key: str) -> Select:
    """Select each agent with those that are like it, but lack what a setting gives."""
    return lambda field: field.twins[key]


def settings(agent: AgentResults) -> dict[str, Any]:
    """Return an agent's block of `params.yaml`."""
    return agent.block.model_dump()


def out_of_luck(random: AgentResults, num_episodes: int) -> float:
    """Return the mean return over `num_episodes` that a random policy does not reach by luck."""
    returns = random.episodes["return"]
    return float(returns.mean() + LUCK * returns.std() / np.sqrt(num_episodes))


def _of(agents: Sequence[AgentResults], algorithms: str) -> list[AgentResults]:
    names = algorithms.split()
    return [agent for name in names for agent in agents if agent.algorithm == name]


def _twins(
    agents: Sequence[AgentResults],
    others: Sequence[AgentResults],
    key: str,
    lacks: Callable[[Any], bool],
) -> list[Pair]:
    """Return each agent with each of the others that differs in one setting, and lacks it."""
    return [
        (agent, other)
        for agent, other in product(agents, others)
        if settings(agent) | {key: None} == settings(other) | {key: None}
        and lacks(settings(other)[key])
        and not lacks(settings(agent)[key])
    ]
