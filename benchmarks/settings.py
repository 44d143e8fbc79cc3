"""What the rows work on: the project's robot and task, and its agents as the article sets them."""

from functools import reduce
from typing import Any

from ruamel.yaml import YAML

from jumping_ant import machine, params_file, robot
from jumping_ant.files import PROJECT_ROOT
from jumping_ant.params import EnvParams

CORES = machine.num_cores()


def robot_xml() -> str:
    """Return the robot of `params.yaml`, whether the pipeline has built it or not."""
    return robot.build(params_file.load().robot)


def task() -> EnvParams:
    """Return the task of `params.yaml`."""
    return params_file.load().env


def article_agent(name: str) -> Any:
    """Return an agent's block with `presets/article` applied, as `dvc exp run` applies it."""
    yaml = YAML(typ="safe")
    content = yaml.load((PROJECT_ROOT / "params.yaml").read_text())
    for line in (PROJECT_ROOT / "presets" / "article").read_text().splitlines():
        key, _, value = line.removeprefix("-S ").partition("=")
        *parents, last = key.split(".")
        block = reduce(lambda outer, name: outer[name], parents, content)
        block[last] = yaml.load(value)
    return params_file.check(content, "presets/article").agent(name)
