"""Run an agent's policies on the held-out episodes.

Usage: python -m stages.evaluate AGENT (DVC names it in the environment)
Reads: params `seeds`, `env`, `evaluate`, `training.evaluation_seed`, the agent's `robot` and
    `algorithm`; the robot in assets/, models/AGENT/seed-N/policy.zip and final.zip.
Writes: results/agents/AGENT/ (episodes.csv, metrics.json, trajectory.npz, seeds.csv, variants.csv).
"""

import filecmp

from jumping_ant.base import machine
from jumping_ant.base.files import PROJECT_ROOT, to_json, write_all
from jumping_ant.base.paths import Paths, SeedPaths
from jumping_ant.evaluation import evaluation, variants
from jumping_ant.experiment import variant_names
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

from . import parse_agent, run


def final_policy(paths: SeedPaths, published: Policy) -> Policy:
    """Return a seed's final policy, or the published object itself if the two are equal."""
    final = policy_file.load(paths.final_policy, paths.owner)
    is_same = filecmp.cmp(paths.final_policy, paths.policy, shallow=False)
    return published if is_same else final


def main() -> None:
    """Run the stage."""
    name, settings = parse_agent(__doc__)
    paths, agent = Paths().agent(name), settings.agent(name)
    world = World(robot.read(PROJECT_ROOT, agent.robot), settings.env)
    trained = {
        seed: policy_file.load(paths.seed(seed).policy, (name, seed)) for seed in settings.seeds
    }
    final = {seed: final_policy(paths.seed(seed), policy) for seed, policy in trained.items()}
    num_threads = machine.num_cores()
    others = variants.make(
        world,
        agent.algorithm,
        trained,
        final,
        settings.training.evaluation_seed,
        num_threads,
    )
    evaluated = evaluation.evaluate(
        world,
        settings.evaluate,
        name,
        {seed: {variant_names.PUBLISHED: trained[seed]} | others[seed] for seed in trained},
        variant_names.num_episodes(agent, settings.evaluate),
        num_threads,
    )
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
