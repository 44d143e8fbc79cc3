"""Train every seed of an agent.

Usage: python -m stages.train AGENT (DVC names it in the environment)
Reads: params `seeds`, `env`, `training`, `agents.AGENT`; the robot in assets/; for imitation
    .inputs/train/ALGORITHM/demonstrations.zip.
Writes: models/AGENT/seed-N/ (policy.zip, final.zip, curve.csv, validation.csv),
    results/agents/AGENT/training.json, results/timing/AGENT/ (timing.csv, machines.json).
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params.model import Params
from jumping_ant.training import driver

from . import parse_agent, run

SECONDS_FOR_LAST_ROWS = 60


@contextmanager
def live_tracking(agent: str, settings: Params) -> Iterator[None]:
    """Mirror the growing curves to MLflow from a separate process, after a while.

    The process follows files, so that training neither waits for it nor depends on its code;
    `track` completes what it leaves unfinished. It gets the parameters, which may change in their
    file.
    """
    after = str(settings.compute.live_after_seconds)
    follower = subprocess.Popen(
        [sys.executable, "-m", "jumping_ant.tracking", "follow", agent, "--after", after],
        cwd=PROJECT_ROOT,
        stdin=subprocess.PIPE,
        encoding="utf-8",
    )
    try:
        with suppress(BrokenPipeError):
            print(settings.model_dump_json(), file=follower.stdin, flush=True)
        yield
    finally:
        try:
            follower.communicate(timeout=SECONDS_FOR_LAST_ROWS)  # closes its input to end it
        except subprocess.TimeoutExpired:
            follower.terminate()


def main() -> None:
    """Run the stage."""
    agent, settings = parse_agent(__doc__)
    with live_tracking(agent, settings):
        driver.train(PROJECT_ROOT, settings, agent)


if __name__ == "__main__":
    run(main)
