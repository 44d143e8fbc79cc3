"""What tells checkpoints of one training from those of another."""

import hashlib
import json
from pathlib import Path

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import effective_code, machine
from jumping_ant.params.blocks import TrainingParams
from jumping_ant.sim.world import World

DRIVER = Path(__file__).with_name("driver.py")


def checkpoint_key(
    world: World, training: TrainingParams, agent: AgentBlock, demonstrations: bytes | None = None
) -> str:
    """Return a digest of everything that the output files of an agent's seeds depend on."""
    content = {
        "robot": world.xml,
        "params": [block.model_dump() for block in (world.env, training, agent)],
        "code": list(map(effective_code.read, sorted(training_code(agent.algorithm, DRIVER)))),
        "machine": machine.describe(),
    }
    if demonstrations is not None:
        content["demonstrations"] = hashlib.sha256(demonstrations).hexdigest()
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]
