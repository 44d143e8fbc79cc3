"""Files cut short, given to the stages as a user would give them.

Each must end in a line that names what is wrong, with exit status 2.
"""

import random
import sys

from scripts.checkout import Checkout
from soak.project import AGENT, Count

EACH = 5  # cut versions of each file
INPUTS = [  # file, what the error names, the stage that reads the file
    ("params.yaml", "params.yaml", ("build",)),
    ("assets/edited.xml", "robot XML", ("train", "dqn")),
    (f"models/{AGENT}/seed-0/policy.zip", "policy.zip: given another file", ("evaluate", AGENT)),
    (f"results/agents/{AGENT}/trajectory.npz", "trajectory.npz", ("record", AGENT)),
]
LEAST_CUT = 100  # [bytes]


def give(
    project: Checkout, generator: random.Random, troubles: list[str], each: int = EACH
) -> Count:
    """Evaluate an agent, then give stages files cut at random; add unclear answers to troubles."""
    project.seconds("dvc", "repro", f"evaluate@{AGENT}")
    count = {"tried": 0, "clear": 0}
    for name, named, (stage, *arguments) in each * INPUTS:
        path = project.folder / name
        before = path.read_bytes()
        place = generator.randrange(len(before) - LEAST_CUT)
        path.unlink()  # DVC may have linked it
        path.write_bytes(before[:place])
        done = project.run(sys.executable, "-m", f"stages.{stage}", *arguments)
        path.write_bytes(before)
        answer = done.stdout + done.stderr
        is_refused = done.returncode == 2 and "Traceback" not in answer
        is_clear = is_refused and "error: " in answer and named in answer
        count["tried"] += 1
        count["clear"] += is_clear
        if not is_clear:
            troubles.append(f"{name} cut at {place}: {done.returncode}: {answer[-2000:]}")
    return count
