"""Run an agent's policies on the held-out episodes.

Usage: python -m stages.evaluate AGENT (DVC names it in the environment)
Reads: params `seeds`, `env`, `evaluate`, `training.evaluation_seed`, the agent's `robot` and
    `algorithm`; the robot in assets/, models/AGENT/seed-N/policy.zip and final.zip, their
    digests in results/agents/AGENT/training.json.
Writes: results/agents/AGENT/ (episodes.csv, metrics.json, trajectory.npz, seeds.csv, variants.csv).
"""

from jumping_ant.base.files import PROJECT_ROOT, to_json, write_all
from jumping_ant.base.paths import Paths, SeedPaths
from jumping_ant.evaluation import evaluation, variants
from jumping_ant.policies import trained_policy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

from . import parse_agent, run


def load(paths: SeedPaths) -> tuple[Policy, Policy]:
    """Return a seed's published policy and its final one, as one object if the two are equal."""
    published, final = trained_policy.load(paths), trained_policy.load(paths, True)
    is_same = paths.content(paths.final_policy) == paths.content(paths.policy)
    return published, published if is_same else final


def main() -> None:
    """Run the stage."""
    name, settings = parse_agent(__doc__)
    paths = Paths().agent(name)
    world = World(robot.read(PROJECT_ROOT, settings.agent(name).robot), settings.env)
    policies = {seed: load(paths.seed(seed)) for seed in settings.seeds}
    versions = variants.make(world, settings, name, policies)
    evaluated = evaluation.evaluate(world, settings, name, versions)
    episodes = evaluated.episodes
    write_all(
        {
            paths.episodes: evaluation.to_csv(name, episodes),
            paths.seed_means: evaluation.to_csv(name, evaluation.seed_means(episodes)),
            paths.variants: evaluation.to_csv(name, evaluated.variants),
            paths.metrics: to_json(evaluation.summarize(episodes)),
            paths.trajectory: evaluated.median.to_bytes(),
        }
    )


if __name__ == "__main__":
    run(main)
