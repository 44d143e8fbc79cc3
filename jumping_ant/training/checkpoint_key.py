"""What tells checkpoints of one training from those of another."""

import hashlib
import json
from pathlib import Path

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import effective_code, machine
from jumping_ant.experiment.models import Params

DRIVER = Path(__file__).with_name("driver.py")


def checkpoint_key(
    xml: str, params: Params, agent: AgentBlock, demonstrations: bytes | None = None
) -> str:
    """Return a digest of everything that the output files of an agent's seeds depend on.

    It covers the robot, the parameters, demonstrations, the effective code of training and of the
    agent's algorithm, and the machine with its versions.

    Args:
        xml: The robot as MJCF text.
        params: All parameters; only the task and the evaluation of snapshots are included.
        agent: The agent's block.
        demonstrations: What the agent learns from, if it learns from demonstrations.
    """
    content = {
        "robot": xml,
        "params": [block.model_dump() for block in (params.env, params.training, agent)],
        "code": list(map(effective_code.read, sorted(training_code(agent.algorithm, DRIVER)))),
        "machine": machine.describe(),
    }
    if demonstrations is not None:
        content["demonstrations"] = hashlib.sha256(demonstrations).hexdigest()
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]
