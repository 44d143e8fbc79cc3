"""Run an agent's policies on the held-out episodes.

Usage: python -m stages.evaluate AGENT
Reads: params `seeds`, `env`, `evaluate`, `training.evaluation_seed`, the agent's `robot`; the robot
    in assets/, models/AGENT/seed-N/policy.zip and final.zip.
Writes: results/AGENT/ (episodes.csv, metrics.json, trajectories.npz), results/seeds/AGENT.csv,
    results/variants/AGENT.csv.
"""

import filecmp
from pathlib import Path

from jumping_ant import policies
from jumping_ant.base import machine
from jumping_ant.base.files import PROJECT_ROOT, write_json, write_text
from jumping_ant.judging import evaluation, variants
from jumping_ant.policies import Policy
from jumping_ant.sim import robot
from stages import parse_agent, run


def final_policy(folder: Path, published: Policy) -> Policy:
    """Return a seed's last policy, the published one itself where it is the same."""
    final = policies.load_file(folder / "final.zip")
    is_same = filecmp.cmp(folder / "final.zip", folder / "policy.zip", shallow=False)
    return published if is_same else final


def main() -> None:
    """Run the stage."""
    agent, settings = parse_agent(__doc__)
    xml = robot.read(PROJECT_ROOT, settings.agent(agent).robot)
    models = {seed: PROJECT_ROOT / "models" / agent / f"seed-{seed}" for seed in settings.seeds}
    trained = {seed: policies.load_file(folder / "policy.zip") for seed, folder in models.items()}
    num_threads = machine.num_cores()
    episodes, median = evaluation.evaluate(xml, settings, trained, num_threads)
    others = {
        seed: variants.make(
            xml,
            settings.env,
            policy,
            final_policy(models[seed], policy),
            seed,
            settings.training.evaluation_seed,
            num_threads,
        )
        for seed, policy in trained.items()
    }
    table = evaluation.evaluate_variants(xml, settings, (trained, episodes), others, num_threads)
    folder = PROJECT_ROOT / "results" / agent
    write_text(folder / "episodes.csv", episodes.to_csv(index=False, lineterminator="\n"))
    means = evaluation.seed_means(episodes)
    sample = PROJECT_ROOT / "results" / "seeds" / f"{agent}.csv"
    write_text(sample, means.to_csv(index=False, lineterminator="\n"))
    versions = PROJECT_ROOT / "results" / "variants" / f"{agent}.csv"
    write_text(versions, table.to_csv(index=False, lineterminator="\n"))
    write_json(folder / "metrics.json", evaluation.summarize(episodes))
    median.save(folder / "trajectories.npz")


if __name__ == "__main__":
    run(main)
