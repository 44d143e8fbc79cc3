"""The agents of a run by algorithm, and the measurements that the claims compare."""

from collections.abc import Callable, Sequence
from itertools import permutations
from typing import Any

import numpy as np

from jumping_ant.judging.claims.findings import Sample
from jumping_ant.judging.results import AgentResults
from jumping_ant.training import curves

LUCK = 5.0  # [standard errors] above the mean of random episodes, which luck does not reach


class Field:
    """The agents of a run, by algorithm."""

    def __init__(self, agents: Sequence[AgentResults], evaluation_episodes: int) -> None:
        self.all = [agent for agent in agents if robot_of(agent) == "edited"]
        self.unedited = [agent for agent in agents if robot_of(agent) == "unedited"]
        self.random = self._that_run("random")
        self.open_loop = self._that_run("open_loop")
        dqn, sac = self._that_run("dqn"), self._that_run("sac")
        self.a2c, self.ppo = self._that_run("a2c"), self._that_run("ppo")
        self.ddpg, td3 = self._that_run("ddpg"), self._that_run("td3")
        pgpe = self._that_run("pgpe")
        # An agent that only serves one of these comparisons does not represent its algorithm.
        self.constants = _pairs(pgpe, lacks_constant)
        self.action_sets = _pairs(pgpe, lacks_torques)
        self.critics = _pairs(td3, lacks_a_critic)
        self.pgpe = _without_seconds(pgpe, [*self.constants, *self.action_sets])
        self.td3 = _without_seconds(td3, self.critics)
        self.sparse = [agent for agent in (*sac, *dqn) if has_sparse_rewards(agent)]
        self.dqn, self.sac = (
            [agent for agent in agents if not has_sparse_rewards(agent)] for agents in (dqn, sac)
        )
        self.imitated = [
            (agent, other)
            for agent, other in permutations(self.all, 2)
            if agent.demonstrator == other.name
        ]
        self.evolution = [
            agent for agent in self.all if agent.family == "evolution" and agent not in pgpe
        ]
        self.threshold = max(
            (out_of_luck(agent, evaluation_episodes) for agent in self.random), default=np.inf
        )

    @property
    def learners(self) -> list[AgentResults]:
        """Return the agents that represent an algorithm that learns."""
        return [*self.dqn, *self.sac, *self.pgpe]

    def metronome(self, learner: AgentResults) -> AgentResults | None:
        """Return the best open-loop agent whose torques are no stronger than a learner's."""
        weak = [agent for agent in self.open_loop if amplitude(agent) <= amplitude(learner)]
        return max(weak, key=lambda agent: agent.quantities["return"].mean(), default=None)

    def _that_run(self, algorithm: str) -> list[AgentResults]:
        return [agent for agent in self.all if agent.algorithm == algorithm]


def robot_of(agent: AgentResults) -> str:
    """Return which robot an agent has: `edited`, unless its block says `unedited`."""
    return getattr(agent.block, "robot", None) or "edited"


def _pairs(
    agents: Sequence[AgentResults], lacks: Callable[[AgentResults, AgentResults], bool]
) -> list[tuple[AgentResults, AgentResults]]:
    """Return each agent with each of those that are like it but lack something."""
    return [(agent, other) for agent, other in permutations(agents, 2) if lacks(agent, other)]


def _without_seconds(
    agents: Sequence[AgentResults], pairs: Sequence[tuple[AgentResults, AgentResults]]
) -> list[AgentResults]:
    return [agent for agent in agents if all(agent is not other for _, other in pairs)]


def lacks_constant(agent: AgentResults, other: AgentResults) -> bool:
    """Return whether the other is the same PGPE with nothing subtracted from the reward."""
    (own, own_rest), (others, others_rest) = (
        _apart(each, "decrease_rewards_by") for each in (agent, other)
    )
    return own != 0 and others == 0 and own_rest == others_rest


def lacks_torques(agent: AgentResults, other: AgentResults) -> bool:
    """Return whether the other is the same agent choosing among commands instead of torques."""
    (_, own), (_, others) = _apart(agent, "actions"), _apart(other, "actions")
    return (drawn_actions(agent), drawn_actions(other)) == ("torques", "commands") and own == others


def lacks_a_critic(agent: AgentResults, other: AgentResults) -> bool:
    """Return whether the other is the same agent with one critic instead of several."""
    (own, own_rest), (others, others_rest) = (_apart(each, "n_critics") for each in (agent, other))
    return (own or 1) > 1 and others == 1 and own_rest == others_rest


def has_sparse_rewards(agent: AgentResults) -> bool:
    """Return whether an agent learned from the returns of whole episodes alone."""
    return bool(getattr(agent.block, "sparse_rewards", False))


def differs_by_robot(agent: AgentResults, other: AgentResults) -> bool:
    """Return whether the other is the same agent on the unedited robot."""
    (_, own), (_, others) = _apart(agent, "robot"), _apart(other, "robot")
    return (robot_of(agent), robot_of(other)) == ("edited", "unedited") and own == others


def amplitude(agent: AgentResults) -> float:
    """Return the largest torque over peak torque that an agent may choose."""
    own = getattr(agent.block, "actions", agent.block)
    return float(getattr(own, "amplitude", 1.0))


def out_of_luck(random: AgentResults, num_episodes: int) -> float:
    """Return the mean return over `num_episodes` that a random policy does not reach by luck."""
    returns = random.episode_returns
    return float(returns.mean() + LUCK * returns.std() / np.sqrt(num_episodes))


def effort(agent: AgentResults, unit: curves.Unit, threshold: float) -> Sample:
    """Return the effort of each seed until all its evaluations exceeded a threshold.

    Args:
        agent: The agent.
        unit: Unit of the effort.
        threshold: Return to exceed.

    Returns:
        The effort up to the first of these evaluations; the whole budget, as a lower bound, if
        there is none.
    """
    rows = [curves.sustained(curve, threshold) for curve in agent.curves.values()]
    values = [
        curve[unit][-1 if row is None else row]
        for curve, row in zip(agent.curves.values(), rows, strict=True)
    ]
    return Sample(agent.label, np.array(values), np.array([row is not None for row in rows]))


def speed_up(agent: AgentResults) -> Sample:
    """Return how many times as fast each seed trains on all cores; NaN if there is only one."""
    cores = max(agent.step_seconds)
    one, every = agent.step_seconds[1], agent.step_seconds[cores]
    return Sample(agent.label, one / every if cores > 1 else np.full(len(one), np.nan))


def drawn_actions(agent: AgentResults) -> str:
    """Return which actions an agent draws: `torques`, unless its block says `commands`."""
    return str(getattr(getattr(agent.block, "actions", None), "kind", "torques"))


def _apart(agent: AgentResults, key: str) -> tuple[Any, dict[str, Any]]:
    """Return one setting of an agent's block, None if it is absent, and the others."""
    rest = agent.block.model_dump()
    return rest.pop(key, None), rest
