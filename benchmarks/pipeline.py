"""The pipeline in a throw-away copy of the project: its memory, and the cost of bookkeeping."""

import shutil
import sys
from collections.abc import Iterator, Mapping
from functools import partial

from benchmarks import memory
from benchmarks.measure import CORES, Row, compare
from jumping_ant.agents.off_policy.algorithms import OffPolicyParams
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file
from jumping_ant.params.model import Params
from scripts.checkout import Checkout, checkout, with_tools

# Memory does not grow with these, so a run is shortened to these shares of the budgets.
MEMORY_SHARES = {"total_steps": 0.05, "generations": 0.02}
MEMORY_EPISODES = 2
MEMORY_FILM_SECONDS = 2.0
# Except for replay memory, which a short run leaves empty: 2 observations of 27 float64, up to 8
# torques, reward, and two flags.
TRANSITION_BYTES = 500

TRACKED_AGENT = "sac"
TRACKED_SHARES = {"total_steps": 0.4}
TRACKED_SEEDS = [0, 1]
TRACKED_REPEATS = 3
UNTRACKED = """
from contextlib import nullcontext
from stages import run, train
train.live_tracking = lambda *_: nullcontext()
run(train.main)
"""

NOOP_REPEATS = 4


def rows() -> Iterator[Row]:
    """Measure one row after the other, in the same copy."""
    with checkout() as project:
        yield peak_memory(project)
        yield noop_repro(project)
        yield tracking_overhead(project)


def peak_memory(project: Checkout) -> Row:
    """Compare a run of everything with the article's script; the ratio is our figure itself."""
    settings = params_file.load()
    brief = shortened(settings, MEMORY_SHARES)
    updates = {
        "evaluate": settings.evaluate.model_copy(
            update=dict.fromkeys(("episodes", "baseline_episodes"), MEMORY_EPISODES)
        ),
        "record": settings.record.model_copy(update={"seconds": MEMORY_FILM_SECONDS}),
    }
    project.write_params(brief.model_copy(update=updates))
    ours = memory.peak(["dvc", "repro"], project.folder, project.environment)
    ours += empty_replay_memory(settings, MEMORY_SHARES["total_steps"])
    script = [sys.executable, "-m", "benchmarks.notebook"]
    peer = memory.peak(script, PROJECT_ROOT, with_tools())
    return Row("peak_memory", ours, peer, "GiB", ratio=ours, spread=0.0)


def noop_repro(project: Checkout) -> Row:
    """Compare `dvc repro` with `dvc status` where everything is up to date."""
    repro, status = (partial(project.seconds, "dvc", command) for command in ("repro", "status"))
    return compare("noop_repro", "s", repro, status, NOOP_REPEATS)


def tracking_overhead(project: Checkout) -> Row:
    """Compare the `train` stage of an agent with the same stage without live tracking."""
    settings = params_file.load()
    compute = settings.compute.model_copy(update={"workers": len(TRACKED_SEEDS)})
    updates = {"seeds": TRACKED_SEEDS, "compute": compute}
    project.write_params(shortened(settings, TRACKED_SHARES).model_copy(update=updates))

    def seconds(*program: str) -> float:
        shutil.rmtree(project.folder / ".checkpoints", ignore_errors=True)  # train from scratch
        return project.seconds(sys.executable, *program, TRACKED_AGENT)

    tracked, untracked = partial(seconds, "-m", "stages.train"), partial(seconds, "-c", UNTRACKED)
    return compare("tracking_overhead", "s", tracked, untracked, TRACKED_REPEATS)


def shortened(settings: Params, shares: Mapping[str, float]) -> Params:
    """Return parameters with training budgets cut to shares, by their names in agents' blocks."""
    agents = {}
    for name, agent in settings.agents.items():
        budgets = {
            budget: max(1, round(share * getattr(agent, budget)))
            for budget, share in shares.items()
            if hasattr(agent, budget)
        }
        agents[name] = agent.model_copy(update=budgets)
    evaluations = max(1, round(max(shares.values()) * settings.training.evaluations))
    training = settings.training.model_copy(update={"evaluations": evaluations})
    return settings.model_copy(update={"agents": agents, "training": training})


def empty_replay_memory(settings: Params, share: float) -> float:
    """Return the replay memory that a shortened run leaves empty, of all workers together [GiB]."""
    workers = min(settings.compute.workers or CORES, len(settings.seeds))
    transitions = [
        min(agent.buffer_size, agent.total_steps)
        - min(agent.buffer_size, round(share * agent.total_steps))
        for agent in settings.agents.values()
        if isinstance(agent, OffPolicyParams)
    ]
    return workers * max(transitions, default=0) * TRANSITION_BYTES / 2**30
