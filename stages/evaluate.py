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
    agent, settings = parse_agent(__doc__)
    paths = Paths().agent(agent)
    world = World(robot.read(PROJECT_ROOT, settings.agent(agent).robot), settings.env)
    trained = {
        seed: policy_file.load(paths.seed(seed).policy, (agent, seed)) for seed in settings.seeds
    }
    if not settings.agent(agent).depends_on_seed:  # played once, for all seeds
        trained = dict.fromkeys(trained, trained[settings.seeds[0]])
    num_threads = machine.num_cores()
    held_out = settings.evaluate
    episodes, median = evaluation.evaluate(world, held_out, agent, trained, num_threads)
    others = {
        seed: variants.make(
            world,
            settings.agent(agent).algorithm,
            policy,
            final_policy(paths.seed(seed), policy),
            seed,
            settings.training.evaluation_seed,
            num_threads,
        )
        for seed, policy in trained.items()
    }
    table = evaluation.evaluate_variants(world, held_out, (trained, episodes), others, num_threads)
    means = evaluation.seed_means(episodes)
    write_all(
        {
            paths.episodes: evaluation.to_csv(agent, episodes),
            paths.seed_means: evaluation.to_csv(agent, means),
            paths.variants: evaluation.to_csv(agent, table),
            paths.metrics: to_json(evaluation.summarize(episodes)),
            paths.trajectory: median.to_bytes(),
        }
    )


if __name__ == "__main__":
    run(main)
