"""Measure how an agent's training speeds up with threads.

Usage: python -m stages.scaling AGENT (DVC names it in the environment)
Reads: params `seeds`, `env`, `agents.AGENT`; the robot in assets/.
Writes: results/timing/AGENT/scaling.csv, without rows for an agent whose algorithm's
    speed-up no claim compares.
"""

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import scaling_table
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import scaling

from . import parse_agent, run


def main() -> None:
    """Run the stage."""
    agent, settings = parse_agent(__doc__)
    world = World(robot.read(PROJECT_ROOT, settings.agent(agent).robot), settings.env)
    rows = scaling.measure(world, settings.agent(agent), scaling_table.seeds(settings))
    write_text(Paths().agent(agent).scaling, scaling_table.to_csv(agent, rows))


if __name__ == "__main__":
    run(main)
