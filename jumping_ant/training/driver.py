"""The driver of the `train` stage, which writes trainers' events to files.

Only the driver accesses files while training runs (see `jumping_ant.training.seed_files`).
Wall-clock times and the machine, which equal trainings need not share, are kept apart in
`timing.csv` and `machines.json`. Checkpoints let a killed run resume where it stopped (see
`jumping_ant.training.checkpoints`); the resulting files are the same.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.job import Job
from jumping_ant.base import portable, tables
from jumping_ant.base.errors import StoppedError
from jumping_ant.base.files import read_bytes, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.compute import jobs
from jumping_ant.compute.workers import Work
from jumping_ant.experiment import curves
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import seed_run
from jumping_ant.training.checkpoint_key import checkpoint_key
from jumping_ant.training.checkpoints import Checkpoints
from jumping_ant.training.forced import is_forced
from jumping_ant.training.progress import TrainingProgress
from jumping_ant.training.seed_files import SeedFiles

SHARED_SEED = 0  # of a search whose result every seed of an agent shares


def train(root: Path, params: Params, agent_name: str) -> None:
    """Train every seed of an agent, each from its last checkpoint.

    Args:
        root: The project's folder; a robot in `assets/` is read, and `models/<agent>/` and the
            agent's `timing.csv`, `machines.json` and `training.json` are written.
        params: All parameters.
        agent_name: Which agent.

    Raises:
        InputError: There is no such agent, or no robot yet.
        WorkerError: The workers of one seed died repeatedly.
        StoppedError: A signal asked training to stop; another call resumes from there.
        OSError: A file cannot be written, as on a full disk; another call resumes from the last
            checkpoint.
    """
    agent = params.agent(agent_name)
    world = World(robot.read(root, agent.robot), params.env)
    demonstrations = _demonstrations(root, agent)
    with ExitStack() as stack:
        display = TrainingProgress(agent_name, params.seeds, agent.max_env_steps)
        stack.enter_context(display)
        if not portable.is_supported():
            display.say(portable.UNSUPPORTED)
        key = checkpoint_key(world, params.training, agent, demonstrations)
        checkpoints = Checkpoints(root, agent_name, key, display.say)
        stack.enter_context(checkpoints.opened(params.seeds))
        if is_forced():
            for seed in params.seeds:
                checkpoints.forget(seed)
        paths = Paths(root).agent(agent_name)
        seeds = {
            seed: stack.enter_context(
                SeedFiles(agent_name, seed, paths.seed(seed), checkpoints, display)
            )
            for seed in params.seeds
        }
        _run(world, params, demonstrations, seeds, display)
        if unfinished := [seed for seed in seeds.values() if not seed.is_finished]:
            places = ", ".join(f"seed {seed.number} at {seed.saved_steps:,}" for seed in unfinished)
            raise StoppedError(f"{agent_name} is not trained yet; the next run resumes: {places}")
        timing = {number: seed.timing for number, seed in seeds.items()}
        machines = {str(number): seed.machine for number, seed in seeds.items()}
        written = {str(number): paths.seed(number).digests() for number in seeds}
        write_all(
            {
                paths.timing: _timing_table(agent_name, timing),
                paths.machines: to_json(machines),
                paths.training: to_json(written),
            }
        )


def _run(
    world: World,
    params: Params,
    demonstrations: bytes | None,
    seeds: Mapping[int, SeedFiles],
    display: TrainingProgress,
) -> None:
    """Train the seeds that are not finished.

    A baseline runs in this process, which has all cores. If its result does not depend on the
    seed, it runs once, and all seeds take what it reports.
    """
    requested, agent = params.compute.workers, params.agent(display.agent)
    untrained = [number for number, seed in seeds.items() if not seed.is_finished]
    workers = 0 if agent.is_baseline else jobs.num_workers(requested, len(untrained))
    while untrained:  # once, unless a checkpoint is rejected
        if agent.is_baseline:
            threads = jobs.num_threads(requested, 1) * len(untrained)
        else:
            threads = jobs.num_threads(requested, len(untrained))
        num_threads = dict(zip(untrained, threads, strict=True))
        shared = [] if agent.depends_on_seed else untrained[1:]

        def start(number: int, num_threads: dict[int, int] = num_threads) -> Work:
            saved = seeds[number].start()
            job = Job(
                world,
                agent,
                seed=number if agent.depends_on_seed else SHARED_SEED,
                evaluations=params.training.evaluations,
                num_threads=num_threads[number],
                demonstrations=demonstrations,
                checkpoint=saved.content if saved else None,
            )
            return partial(
                seed_run.run,
                job,
                params.training,
                seconds=saved.seconds if saved else 0.0,
                candidates=saved.candidates if saved else (),
                checkpoint_seconds=params.compute.checkpoint_seconds,
            )

        rejected = []
        running = [number for number in untrained if number not in shared]
        for number, report in jobs.stream(start, running, workers, display.say, "seed {}".format):
            if not all(seeds[each].take(report) for each in (number, *shared)):
                rejected.append(number)
        untrained = rejected


def _demonstrations(root: Path, agent: AgentBlock) -> bytes | None:
    """Return what an agent learns from, if it learns from demonstrations."""
    if not agent.learns_from_demonstrations:
        return None
    return read_bytes(Paths(root).demonstrations(agent.algorithm), f"demonstrate@{agent.algorithm}")


def _timing_table(agent: str, timing: Mapping[int, Sequence[tuple[int, float]]]) -> str:
    """Return the content of `timing.csv`, from control steps and seconds by seed."""
    rows = [
        {"agent": agent, "seed": seed, "env_steps": env_steps, "seconds": f"{seconds:.3f}"}
        for seed, own in timing.items()
        for env_steps, seconds in own
    ]
    return tables.to_csv(rows, ["agent", *curves.TIMING_COLUMNS])
