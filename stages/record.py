"""Film and record an agent's median episode.

Usage: python -m stages.record AGENT
Reads: params `record`; assets/jumping_ant.xml, results/AGENT/trajectories.npz.
Writes: media/AGENT.mp4, media/AGENT.rrd.
"""

from jumping_ant import recording, rendering, robot, trajectory
from jumping_ant.files import PROJECT_ROOT, write_bytes
from stages import parse_agent, run


def main() -> None:
    """Run the stage."""
    agent, settings = parse_agent(__doc__)
    xml = robot.read(PROJECT_ROOT)
    episode = trajectory.load(PROJECT_ROOT / "results" / agent / "trajectories.npz")
    media = PROJECT_ROOT / "media"
    write_bytes(media / f"{agent}.mp4", rendering.film(xml, episode, settings.record))
    write_bytes(media / f"{agent}.rrd", recording.record(xml, episode, agent))


if __name__ == "__main__":
    run(main)
