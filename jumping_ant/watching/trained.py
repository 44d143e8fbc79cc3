"""Which policies a project has, and how to get one."""

from pathlib import Path

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment.models import Params
from jumping_ant.play import content
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Policy


def seeds(root: Path, params: Params, agent: str) -> list[int]:
    """Return the seeds of an agent that are trained, the one that did best in validation first."""
    paths = Paths(root).agent(agent)
    there = [seed for seed in params.seeds if paths.seed(seed).policy.is_file()]
    return content.champions(root, agent, there)


def load(root: Path, params: Params, agent: str, seed: int) -> Policy:
    """Read a policy.

    Raises:
        InputError: There is no such agent, or the seed is not trained; the message lists those.
    """
    params.agent(agent)
    there = sorted(seeds(root, params, agent))
    if seed not in there:
        allowed = ", ".join(map(str, there)) or f"none yet; `dvc repro train@{agent}` trains them"
        raise InputError(f"seed of {agent}: given {seed}, allowed: {allowed}")
    return policy_file.load(Paths(root).agent(agent).seed(seed).policy, (agent, seed))
