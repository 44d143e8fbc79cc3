"""What the rows work on: the project's robot and task, and agents with the article's settings."""

from typing import Any

from jumping_ant.base import machine
from jumping_ant.params import params_file, presets
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

CORES = machine.num_cores()


def default_world() -> World:
    """Return robot and task of `params.yaml`, whether the pipeline has built it or not."""
    params = params_file.load()
    return World(robot.build(params.robot), params.env)


def article_agent(name: str) -> Any:
    """Return an agent's block with `presets/article` applied."""
    return presets.load("article").agent(name)
