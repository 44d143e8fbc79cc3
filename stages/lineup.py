"""Record all agents' median episodes side by side.

Usage: python -m stages.lineup
Reads: params `seeds`, `env`, `evaluate`, `agents`; the robots in assets/, and for each agent
    results/agents/AGENT/ (trajectory.npz, episodes.csv).
Writes: media/lineup.rrd; media/digests/lineup.json, the digest of what is recorded.
"""

from jumping_ant.base.files import PROJECT_ROOT, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.media import about, lineup
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.world import World

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings, paths = parse(__doc__), Paths()
    worlds, episodes, stories = {}, {}, {}
    for name, agent in settings.agents.items():
        worlds[name] = World(robot.read(PROJECT_ROOT, agent.robot), settings.env)
        episodes[name] = trajectory.load(paths.agent(name).trajectory)
        stories[name] = about.read(PROJECT_ROOT, settings, name, episodes[name])
    recording = lineup.record(worlds, episodes, stories)
    digest = to_json({"recorded": recording.digest})
    write_all({paths.lineup: recording.content, paths.lineup_recorded: digest})


if __name__ == "__main__":
    run(main)
