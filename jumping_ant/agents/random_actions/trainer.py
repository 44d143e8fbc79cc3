"""The random baseline, which learns nothing."""

from collections.abc import Iterator

from jumping_ant.actions import ActionSet
from jumping_ant.agents.events import Event, Finished, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.agents.random_actions.algorithms import RandomAgentParams
from jumping_ant.policies.blind import UniformPolicy


def train(job: Job[RandomAgentParams]) -> Iterator[Event]:
    """Yield the policy that draws its actions at random, without any training."""
    actions = ActionSet.of(job.agent.actions, job.world.env.commands)
    policy = UniformPolicy(job.seed, actions, job.world.anatomy.num_motors).to_bytes()
    yield Snapshot(0, policy)
    yield Finished(0, policy)
