"""What the rows work on: the project's robot and task, and agents with the article's settings."""

from typing import Any

from jumping_ant.base import machine
from jumping_ant.experiment import params_file, presets
from jumping_ant.params.blocks import EnvParams
from jumping_ant.sim import robot

CORES = machine.num_cores()


def robot_xml() -> str:
    """Return the robot of `params.yaml`, whether the pipeline has built it or not."""
    return robot.build(params_file.load().robot)


def task() -> EnvParams:
    """Return the task of `params.yaml`."""
    return params_file.load().env


def article_agent(name: str) -> Any:
    """Return an agent's block with `presets/article` applied."""
    return presets.load("article").agent(name)
