"""Edit the robot.

Usage: python -m stages.build
Reads: params `robot`, `env`, `record.fps`; the source, from the installed Gymnasium or robots/.
Writes: assets/edited.xml, assets/unedited.xml, assets/robot.json (masses and torques before and
    after).
"""

from jumping_ant.base.files import to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.sim import robot, rollout
from jumping_ant.sim.task import Task
from jumping_ant.sim.trajectory import frame_stride
from jumping_ant.sim.world import World

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings = parse(__doc__)
    xml = robot.build(settings.robot)
    world = World(xml, settings.env)
    Task(world)  # rejects a task that does not fit the robot, before any training
    rollout.require_stability(world)
    frame_stride(float(world.model.opt.timestep), settings.record.fps)
    paths = Paths()
    write_all(
        {
            paths.assets / robot.FILES["edited"]: xml,
            paths.assets / robot.FILES["unedited"]: robot.unedited(settings.robot),
            paths.physique: to_json(robot.summarize(settings.robot, xml)),
        }
    )


if __name__ == "__main__":
    run(main)
