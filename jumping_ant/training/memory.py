"""The memory that training needs, estimated before it starts."""

from collections.abc import Callable

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.base import machine
from jumping_ant.base.errors import InputError
from jumping_ant.sim.world import World

WORTH_TELLING = 2**20  # [bytes]


def check(
    world: World, name: str, agent: AgentBlock, num_seeds: int, say: Callable[[str], None]
) -> None:
    """Tell how much memory training so many seeds at a time needs; refuse it if there is less."""
    anatomy = world.anatomy
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
