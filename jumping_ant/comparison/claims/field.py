"""The agents of a run, as the claims tell them apart."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, pairwise, permutations, product
from typing import Any

import numpy as np

from jumping_ant.comparison.results import AgentResults

LUCK = 5.0  # [standard errors] above the mean of random episodes, which luck does not reach
LEARNERS = "dqn sac pgpe"


@dataclass(frozen=True)
class Twins:
    """What makes two agents twins: one setting of them differs, in which the other lacks something.

    Settings are keys of an agent's block, and of its `actions` as in `actions.kind`.
    """

    algorithms: str  # as in "sac dqn"
    key: str
    lacks: Callable[[Any, Any], bool]  # whether the other's value lacks what the agent's has
    free: tuple[str, ...] = ()  # settings that follow from this one


TWINS = {  # by what one of them has, and the other lacks
    "constant": Twins("pgpe", "decrease_rewards_by", lambda own, other: own != 0 and other == 0),
    "critics": Twins("td3", "n_critics", lambda own, other: own != 1 and other == 1),
    "torques instead of commands": Twins(
        "pgpe", "actions.kind", lambda *kinds: kinds == ("torques", "commands")
    ),
    "torques instead of two levels": Twins(
        "pgpe", "actions.levels", lambda *levels: levels == (None, 2), free=("actions.kind",)
    ),
    "full torque": Twins("dqn pgpe", "actions.amplitude", lambda own, other: other == own / 2),
    "edits": Twins(
        f"{LEARNERS} open_loop", "robot", lambda *robots: robots == ("edited", "unedited")
    ),
}

Pair = tuple[AgentResults, AgentResults]
Select = Callable[["Field"], Iterable[tuple[AgentResults, ...]]]


class Field:
    """The agents of a run; one that only serves certain comparisons represents no algorithm."""

    def __init__(self, agents: Sequence[AgentResults], evaluation_episodes: int) -> None:
        self._rhythms = _of(agents, "open_loop")
        self._edited = [agent for agent in agents if agent.block.robot == "edited"]
        sparse = [agent for agent in self._edited if settings(agent).get("sparse_rewards")]
        self._sparse = _of(sparse, "sac dqn")
        self.twins = {
            name: list(_twins(kind, agents if kind.key == "robot" else self._edited))
            for name, kind in TWINS.items()
        }
        aside = {agent.name for agent in sparse}
        aside |= {other.name for name in ("constant", "critics") for _, other in self.twins[name]}
        aside |= {other.name for _, other in _differ_in_actions(self._edited)}
        self._representing = [agent for agent in self._edited if agent.name not in aside]
        # Mean return of an evaluation that random agents do not exceed by luck; None without them.
        self.threshold = max(
            (out_of_luck(agent, evaluation_episodes) for agent in self.of("random")), default=None
        )

    def of(self, algorithms: str) -> list[AgentResults]:
        """Return the agents that represent algorithms, as in "sac dqn"."""
        return _of(self._representing, algorithms)

    def beside_random(self) -> Iterable[Pair]:
        """Return each DQN with the random agent that draws commands, or else with any."""
        random = self.of("random")
        commands = [agent for agent in random if settings(agent)["actions"]["kind"] == "commands"]
        return product(self.of("dqn"), (commands or random)[:1])

    def beside_open_loop(self) -> Iterable[Pair]:
        """Yield each learner with the best metronome, and each oscillator, of no more torque."""
        for learner in self.of(LEARNERS):
            if rhythm := self.metronome(learner):
                yield learner, rhythm
            limit = settings(learner)["actions"]["amplitude"]
            for agent in self.of("oscillator"):
                if settings(agent)["actions"]["amplitude"] <= limit:
                    yield learner, agent

    def beside_metronome(self) -> Iterable[Pair]:
        """Yield each learner with the best metronome of no more torque."""
        return (pair for pair in self.beside_open_loop() if pair[1].algorithm == "open_loop")

    def metronome(self, agent: AgentResults) -> AgentResults | None:
        """Return the best metronome on an agent's robot, of no more torque, if there is one."""
        limit, robot = settings(agent)["actions"]["amplitude"], agent.block.robot
        alike = [one for one in self._rhythms if one.block.robot == robot]
        weak = [one for one in alike if settings(one)["amplitude"] <= limit]
        return max(weak, key=lambda one: one.quantities["return"].mean(), default=None)

    def beside_sparse_rewards(self) -> Iterable[Pair]:
        """Return each PGPE with those that learned from the returns of whole episodes alone."""
        return product(self.of("pgpe"), self._sparse)

    def beside_evolution(self) -> Iterable[Pair]:
        """Return each PGPE with each agent of another algorithm that evolves the same policies."""
        evolution = [agent for agent in self._edited if agent.family == "evolution"]
        rivals = [agent for agent in evolution if agent.algorithm not in ("pgpe", "oscillator")]
        return product(self.of("pgpe"), rivals)

    def imitators(self) -> Iterable[Pair]:
        """Return each agent with the one that it imitates."""
        pairs = permutations(self._edited, 2)
        return (pair for pair in pairs if pair[0].demonstrator == pair[1].name)


def each(algorithms: str) -> Select:
    """Select each agent that represents one of some algorithms."""
    return lambda field: ((agent,) for agent in field.of(algorithms))


def pairs(*groups: str) -> Select:
    """Select each agent of a group of algorithms with each one of the next group."""
    return lambda field: chain.from_iterable(
        product(field.of(one), field.of(other)) for one, other in pairwise(groups)
    )


def twins(name: str) -> Select:
    """Select each agent with those that are like it, but lack what one of `TWINS` has."""
    return lambda field: field.twins[name]


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


def _twins(kind: Twins, agents: Sequence[AgentResults]) -> Iterator[Pair]:
    """Yield each agent with each of the others that differs in one setting, and lacks it."""
    ignored = dict.fromkeys((kind.key, *kind.free))
    for agent, other in permutations(_of(agents, kind.algorithms), 2):
        one, two = _flat(agent), _flat(other)
        if one | ignored == two | ignored and kind.lacks(one.get(kind.key), two.get(kind.key)):
            yield agent, other


def _differ_in_actions(agents: Sequence[AgentResults]) -> Iterator[Pair]:
    """Yield each learner with the later ones that differ from it in nothing but their actions."""
    for agent, other in combinations([one for one in agents if not one.is_baseline], 2):
        one, two = settings(agent), settings(other)
        if one != two and one | {"actions": None} == two | {"actions": None}:
            yield agent, other


def _flat(agent: AgentResults) -> dict[str, Any]:
    """Return an agent's settings, with those of its actions as `actions.kind` and so on."""
    block = settings(agent)
    actions = block.pop("actions", {})
    return block | {f"actions.{key}": value for key, value in actions.items()}
