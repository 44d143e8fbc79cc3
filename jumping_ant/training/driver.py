"""The driver of the `train` stage, which writes trainers' events to files.

Only the driver accesses files while training runs (see `seed_files`). Wall-clock times and the
machine, which equal trainings need not share, are kept apart in `timing.csv` and `machines.json`.
A killed run resumes where it stopped (see `checkpoints`); the resulting files are the same.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Checkpoint, Finished
from jumping_ant.agents.job import Job
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import portable, progress, tables
from jumping_ant.base.errors import StoppedError
from jumping_ant.base.files import read_bytes, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.compute import jobs
from jumping_ant.compute.processes import Work
from jumping_ant.params import inputs
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import curves, seed_run
from jumping_ant.training.checkpoints import DRIVER, Checkpoints, checkpoint_key
from jumping_ant.training.seed_files import SeedFiles

SHARED_SEED = 0  # of a search whose result every seed of an agent shares


def train(root: Path, params: Params, agent_name: str) -> None:
    """Train every seed of an agent, each from its last checkpoint.

    Reads a robot in the project's `assets/`; writes `models/<agent>/` and the agent's `timing.csv`,
    `machines.json` and `training.json`.

    Raises:
        InputError: There is no such agent, or no robot yet.
        WorkerError: The workers of one seed died repeatedly.
        StoppedError: A signal asked training to stop; another call resumes from there.
        OSError: A file cannot be written; another call resumes from the last checkpoint.
    """
    agent = params.agent(agent_name)
    world = World(robot.read(root, agent.robot), params.env)
    demonstrations = _demonstrations(root, agent)

    def say(line: str) -> None:
        progress.say(f"{agent_name}: {line}")

    if not portable.is_supported():
        say(portable.UNSUPPORTED)
    code = {file: inputs.code_of(file) for file in training_code(agent.algorithm, DRIVER)}

    def require_same_code() -> None:  # before a worker imports it, and before its work is kept
        inputs.refuse((file for file, it in code.items() if inputs.differs(file, it)), agent_name)

    key = checkpoint_key(world, params.training, agent, demonstrations)
    checkpoints = Checkpoints(root, agent_name, key, say)
    paths = Paths(root).agent(agent_name)
    with ExitStack() as stack:
        stack.enter_context(checkpoints.opened(params.seeds))
        paths.training.unlink(missing_ok=True)  # DVC removes it; else it would be of other files
        seeds = {
            seed: stack.enter_context(
                SeedFiles(agent_name, seed, agent.max_env_steps, paths.seed(seed), checkpoints)
            )
            for seed in params.seeds
        }
        _run(world, params, agent, demonstrations, seeds, say, require_same_code)
        if unfinished := [seed for seed in seeds.values() if not seed.finished]:
            places = ", ".join(f"seed {seed.number} at {seed.saved_steps:,}" for seed in unfinished)
            raise StoppedError(f"{agent_name} is not trained yet; the next run resumes: {places}")
        trained = {number: seed.finished for number, seed in seeds.items() if seed.finished}
        rows = [
            {"agent": agent_name, "seed": number, "env_steps": steps, "seconds": f"{seconds:.3f}"}
            for number, saved in trained.items()
            for steps, seconds in saved.timing
        ]
        machines = {str(number): saved.machine for number, saved in trained.items()}
        written = {str(number): paths.seed(number).digests() for number in trained}
        write_all(
            {
                paths.timing: tables.to_csv(rows, ["agent", *curves.TIMING_COLUMNS]),
                paths.machines: to_json(machines),
                paths.training: to_json(written),
            }
        )


def _run(
    world: World,
    params: Params,
    agent: AgentBlock,
    demonstrations: bytes | None,
    seeds: Mapping[int, SeedFiles],
    say: Callable[[str], None],
    require_same_code: Callable[[], None],
) -> None:
    """Train the seeds that are not finished.

    A baseline runs in this process, and once for all seeds if its result does not depend on them.
    """
    requested = params.compute.workers
    untrained = [number for number, seed in seeds.items() if not seed.finished]
    if not untrained:
        return
    if agent.is_baseline:
        workers, threads = 0, jobs.num_threads(requested, 1) * len(untrained)
    else:
        workers = jobs.num_workers(requested, len(untrained))
        threads = jobs.num_threads(requested, len(untrained))
    num_threads = dict(zip(untrained, threads, strict=True))
    alone, alike = (untrained, []) if agent.depends_on_seed else (untrained[:1], untrained[1:])

    def start(number: int) -> Work:
        require_same_code()
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
            params.training.block(job.seed),
            seconds=saved.seconds if saved else 0.0,
            candidates=saved.candidates if saved else (),
            checkpoint_seconds=params.compute.checkpoint_seconds,
        )

    for number, report in jobs.stream(start, alone, workers, say, "seed {}".format):
        if isinstance(report.event, Checkpoint | Finished):
            require_same_code()
        for each in (number, *alike):
            seeds[each].take(report)


def _demonstrations(root: Path, agent: AgentBlock) -> bytes | None:
    """Return what an agent learns from, if it learns from demonstrations."""
    if not agent.learns_from_demonstrations:
        return None
    return read_bytes(Paths(root).demonstrations(agent.algorithm), f"demonstrate@{agent.algorithm}")
