"""Edit Gymnasium's Ant into a jumping Ant.

Usage: python -m stages.build
Reads: params `robot`; `ant.xml` of the installed Gymnasium.
Writes: assets/jumping_ant.xml, assets/ant.xml (without the edits), assets/jumping_ant.json (masses
    and torques before and after).
"""

from jumping_ant.base.files import write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.sim import robot
from stages import parse, run


def main() -> None:
    """Run the stage."""
    xml = robot.build(parse(__doc__).robot)
    write_text(Paths().assets / robot.FILES["edited"], xml)
    write_text(Paths().assets / robot.FILES["unedited"], robot.unedited())
    write_json(Paths().physique, robot.summarize(xml))


if __name__ == "__main__":
    run(main)
