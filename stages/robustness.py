"""Run an agent's policies under perturbations.

Usage: python -m stages.robustness AGENT (DVC names it in the environment)
Reads: params `seeds`, `env`, `evaluate`, `robustness`, the agent's `robot` and `algorithm`; the
    robot in assets/, models/AGENT/seed-N/policy.zip, results/agents/AGENT/training.json.
Writes: results/robustness/AGENT.csv.
"""

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.evaluation import perturbed, playing
from jumping_ant.policies import trained_policy
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

from . import parse_agent, run


def main() -> None:
    """Run the stage."""
    name, settings = parse_agent(__doc__)
    paths = Paths().agent(name)
    world = World(robot.read(PROJECT_ROOT, settings.agent(name).robot), settings.env)
    policies = {
        seed: trained_policy.load(paths.seed(seed))
        for seed in dict.fromkeys(case.seed for case in perturbed.cases(settings, name))
    }
    returns = playing.perturbed_returns(world, settings, name, policies)
    write_text(Paths().perturbed(name), perturbed.to_csv(name, returns))


if __name__ == "__main__":
    run(main)
