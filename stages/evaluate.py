"""Run an agent's policies on the held-out episodes.

Usage: python -m stages.evaluate AGENT
Reads: params `seeds`, `env`, `evaluate`; assets/jumping_ant.xml, models/AGENT/seed-N/policy.zip.
Writes: results/AGENT/ (episodes.csv, metrics.json, trajectories.npz), results/seeds/AGENT.csv.
"""

from jumping_ant import evaluation, machine, policies, robot
from jumping_ant.files import PROJECT_ROOT, write_json, write_text
from stages import parse_agent, run


def main() -> None:
    """Run the stage."""
    agent, settings = parse_agent(__doc__)
    xml = robot.read(PROJECT_ROOT)
    models = PROJECT_ROOT / "models" / agent
    trained = {
        seed: policies.load_file(models / f"seed-{seed}" / "policy.zip") for seed in settings.seeds
    }
    episodes, median = evaluation.evaluate(xml, settings, trained, machine.num_cores())
    folder = PROJECT_ROOT / "results" / agent
    write_text(folder / "episodes.csv", episodes.to_csv(index=False, lineterminator="\n"))
    means = evaluation.seed_means(episodes)
    sample = PROJECT_ROOT / "results" / "seeds" / f"{agent}.csv"
    write_text(sample, means.to_csv(index=False, lineterminator="\n"))
    write_json(folder / "metrics.json", evaluation.summarize(episodes))
    median.save(folder / "trajectories.npz")


if __name__ == "__main__":
    run(main)
