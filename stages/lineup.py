"""Record all agents' median episodes side by side.

Usage: python -m stages.lineup
Reads: params `seeds`, `env`, `evaluate`, `agents`; the robots in assets/, and for each agent
    results/agents/AGENT/ (trajectory.npz, episodes.csv), models/AGENT/seed-N/curve.csv.
Writes: media/lineup.rrd.
"""

from jumping_ant.base.files import PROJECT_ROOT, write_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.recording import lineup, story
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.world import World

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings = parse(__doc__)
    worlds = {
        name: World(robot.read(PROJECT_ROOT, agent.robot), settings.env)
        for name, agent in settings.agents.items()
    }
    episodes = {
        agent: trajectory.load(Paths().agent(agent).trajectory) for agent in settings.agents
    }
    stories = {
        agent: story.read(PROJECT_ROOT, settings, agent, episode)
        for agent, episode in episodes.items()
    }
    write_bytes(Paths().lineup, lineup.record(worlds, episodes, stories))


if __name__ == "__main__":
    run(main)
