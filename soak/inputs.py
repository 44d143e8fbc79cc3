"""Files cut short, given to the stages as a user would give them.

Each must end in a line that names what is wrong, with exit status 2.
"""

import random
import sys

from scripts.checkout import Checkout
from soak.mutations import Count
from soak.project import AGENT

INPUTS = [  # file, what the error names, the stage that reads the file
    ("params.yaml", "params.yaml", ("build",)),
    ("assets/edited.xml", "robot XML", ("train", "dqn")),
    (f"models/{AGENT}/seed-0/policy.zip", "policy file", ("evaluate", AGENT)),
    (f"results/agents/{AGENT}/trajectory.npz", "trajectory.npz", ("record", AGENT)),
]
LEAST_CUT = 100  # [bytes]


def give(project: Checkout, generator: random.Random) -> Count:
    """Give each stage a file cut at a random place.

    Args:
        project: A throw-away copy in which the agent is evaluated.
        generator: Decides where to cut.
    """
    count = Count()
    for name, named, (stage, *arguments) in INPUTS:
        path = project.folder / name
        before = path.read_bytes()
        place = generator.randrange(len(before) - LEAST_CUT)
        path.unlink()  # DVC may have linked it
        path.write_bytes(before[:place])
        done = project.run(sys.executable, "-m", f"stages.{stage}", *arguments)
        path.write_bytes(before)
        told = done.stdout + done.stderr
        is_refused = done.returncode == 2 and "Traceback" not in told
        is_clear = is_refused and "error: " in told and named in told
        count.tried += 1
        count.clear += is_clear
        if not is_clear:
            count.troubles.append(f"{name} cut at {place}: {done.returncode}: {told[-2000:]}")
    return count
