"""Film the best learner and a metronome under a perturbation, and record them for Rerun.

Usage: python -m stages.overtaking
Reads: params.yaml; the robots in assets/, models/AGENT/seed-N/policy.zip of two agents,
    results/robustness.json, which says which ones, under what and from where.
Writes: media/overtaking.mp4, media/overtaking.rrd.
"""

from jumping_ant.base.files import PROJECT_ROOT, read_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.policies import policy_file
from jumping_ant.recording import overtaking
from jumping_ant.robustness import recorded
from jumping_ant.robustness.perturbations import NONE, Condition
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings, paths = parse(__doc__), Paths()
    told = read_json(paths.robustness, "crossings")["filmed"]
    condition, seed = Condition(told["perturbation"], told["level"]), told["seed"]
    start = settings.evaluate.block(seed)[0]
    worlds, episodes, stories = {}, {}, {}
    for agent, mean in told["agents"].items():
        xml = robot.read(PROJECT_ROOT, settings.agent(agent).robot)
        policy = policy_file.load(paths.agent(agent).seed(seed).policy, (agent, seed))
        player = recorded.Player(agent, seed, policy)
        worlds[agent] = World(xml, settings.env)
        steps = settings.robustness.episode_steps
        episodes[agent] = recorded.play(worlds[agent], steps, player, condition, start)
        stories[agent] = overtaking.story(settings, agent, mean)
    name = condition.perturbation.replace("_", " ")
    words = "nothing perturbed" if condition == NONE else f"{name} of {condition.level:g}"
    write_all(
        {
            paths.overtaking_film: overtaking.film(worlds, episodes, stories, settings.record),
            paths.overtaking: overtaking.record(worlds, episodes, stories, words),
        }
    )


if __name__ == "__main__":
    run(main)
