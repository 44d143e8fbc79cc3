"""Film and record an agent's median episode.

Usage: python -m stages.record AGENT (DVC names it in the environment)
Reads: params `record`, `seeds`, `env`, `evaluate`, `agents.AGENT`; the robot in assets/,
    results/agents/AGENT/ (trajectory.npz, episodes.csv).
Writes: media/AGENT.mp4, media/AGENT.rrd; media/digests/AGENT.json, the digest of what is recorded.
"""

from jumping_ant.base.files import PROJECT_ROOT, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.media import about, episode, rendering
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.world import World

from . import parse_agent, run


def main() -> None:
    """Run the stage."""
    agent, settings = parse_agent(__doc__)
    world = World(robot.read(PROJECT_ROOT, settings.agent(agent).robot), settings.env)
    paths = Paths().agent(agent)
    states = trajectory.load(paths.trajectory)
    story = about.read(PROJECT_ROOT, settings, agent, states)
    film = rendering.film(world.xml, states, settings.record)
    recording = episode.record(world, states, story, film)
    digest = to_json({"recorded": recording.digest})
    write_all({paths.film: film, paths.recording: recording.content, paths.recorded: digest})


if __name__ == "__main__":
    run(main)
