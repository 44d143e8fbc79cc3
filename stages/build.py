"""Edit Gymnasium's Ant into a jumping Ant.

Usage: python -m stages.build
Reads: params `robot`; `ant.xml` of the installed Gymnasium.
Writes: assets/jumping_ant.xml, assets/ant.xml (without the edits), assets/jumping_ant.json (masses
    and torques before and after).
"""

from jumping_ant.base.files import PROJECT_ROOT, write_json, write_text
from jumping_ant.params import params_file
from jumping_ant.sim import robot
from stages import run


def main() -> None:
    """Run the stage."""
    xml = robot.build(params_file.load().robot)
    write_text(PROJECT_ROOT / "assets" / robot.FILES["edited"], xml)
    write_text(PROJECT_ROOT / "assets" / robot.FILES["unedited"], robot.unedited())
    write_json(PROJECT_ROOT / "assets" / "jumping_ant.json", robot.summarize(xml))


if __name__ == "__main__":
    run(main)
