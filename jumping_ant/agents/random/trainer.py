"""The baseline that learns nothing."""

from collections.abc import Callable, Iterator

from jumping_ant.actions import ActionSet
from jumping_ant.agents.events import Event, Finished, Snapshot
from jumping_ant.params.models import EnvParams, RandomAgentParams
from jumping_ant.policies import UniformPolicy


def train(
    xml: str,
    env: EnvParams,
    agent: RandomAgentParams,
    seed: int,
    evaluations: int,
    num_threads: int = 1,
    checkpoint: bytes | None = None,
    is_checkpoint_due: Callable[[], bool] = lambda: False,
) -> Iterator[Event]:
    """Yield the policy that draws its actions at random, without a step of training.

    Args:
        xml: The robot, unused.
        env: The task, unused.
        agent: The agent's block: what is drawn from.
        seed: The policy's seed.
        evaluations: Unused; one snapshot shows all there is.
        num_threads: Unused.
        checkpoint: Unused.
        is_checkpoint_due: Unused.
    """
    policy = UniformPolicy(seed, ActionSet.of(agent.actions)).to_bytes()
    yield Snapshot(0, policy)
    yield Finished(0, policy)
