"""The memory that training needs, estimated before it starts."""

from collections.abc import Callable

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.base import machine
from jumping_ant.base.errors import InputError
from jumping_ant.sim import robot
from jumping_ant.sim.anatomy import Anatomy

WORTH_TELLING = 2**20  # [bytes]


def check(
    xml: str, name: str, agent: AgentBlock, num_seeds: int, say: Callable[[str], None]
) -> None:
    """Tell how much memory training needs; refuse it if this machine has less.

    Args:
        xml: The robot as MJCF text.
        name: The agent's name.
        agent: The agent's block.
        num_seeds: Seeds that are trained at the same time.
        say: Tells a line.

    Raises:
        InputError: There is too little memory.
    """
    anatomy = Anatomy.of(robot.load(xml))
    needed = num_seeds * agent.memory(anatomy.num_observations, anatomy.num_motors)
    available = machine.available_memory()
    seeds = "1 seed" if num_seeds == 1 else f"{num_seeds} seeds"
    told = f"about {_size(needed)} of memory, {seeds} at a time"
    if needed > available:
        raise InputError(
            f"agents.{name}: given sizes that need {told}, allowed: the {_size(available)} that "
            "are free; reduce them or `compute.workers`"
        )
    if needed >= WORTH_TELLING:
        say(f"needs {told}; {_size(available)} are free")


def _size(num_bytes: float) -> str:
    mebibytes = num_bytes / 2**20
    return f"{mebibytes:,.0f} MiB" if mebibytes < 1000 else f"{mebibytes / 1024:,.1f} GiB"
