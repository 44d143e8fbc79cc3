"""From an agent to better settings: search, verdict, files."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import optuna

from jumping_ant.agents.training_code import training_code
from jumping_ant.base import effective_code
from jumping_ant.base.files import PROJECT_ROOT, digest, read_bytes, read_json
from jumping_ant.base.paths import Paths, StudyPaths
from jumping_ant.compute import jobs
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import memory, seed_run
from jumping_ant.tuning import outcome, page, search, space
from jumping_ant.tuning import study as studies
from jumping_ant.tuning.search import Search, Task
from jumping_ant.tuning.study import SamplerName
from jumping_ant.tuning.verdict import OPEN, UNCHANGED, Fresh, without_training

CONTROL = "make tune SAMPLER=random"
LOCK = PROJECT_ROOT / "requirements.lock"  # the versions of all libraries


def run(
    root: Path,
    params: Params,
    name: str,
    sampler: SamplerName = "tpe",
    storage: str | None = None,
    say: Callable[[str], None] = print,
) -> None:
    """Search for an agent's settings from where an earlier search stopped, and write what it found.

    Args:
        root: The project's folder.
        params: All parameters.
        name: The agent's name.
        sampler: What draws settings; `random` is a control, which gets no verdict.
        storage: Address of the study's storage; by default a file in the project's folder.
        say: Gets a line for each trial.

    Raises:
        InputError: There is no such agent, it has no search space, it lacks demonstrations or
            memory, or the storage cannot be used.
        StoppedError: A signal asked for a stop; another call resumes.
        WorkerError: The workers of a seed died repeatedly.
    """
    task = task_of(root, params, name)
    paths = Paths(root).study(name, is_control=sampler == "random")
    address = storage or f"{studies.FILE}{paths.study}"
    _tell_of_replaced(root, paths, task, say)
    own = task.space
    if own.outside:
        say(f"{name}: outside of what is searched, and so no trial: {', '.join(own.outside)}")
    key = study_name(task, sampler)
    first = None if own.outside else own.own
    workers = search.num_workers(params.compute.workers, params.tuning.trials)
    memory.check(task.world, name, own.agent, workers, say)
    with studies.opened(address, key, sampler, params.tuning.prune_level, first) as study:
        say(f"{name}: study {key} in {studies.shown(address)}, {params.tuning.trials} trials")
        threads = jobs.num_threads(params.compute.workers, workers)[0]
        search.run(Search(study, address, task, threads, say), workers)
        found = outcome.summary(task, sampler, study)
        if sampler == "tpe":
            found |= _verdict(params, task, study, say)
        _write(root, paths, task, study, found, say)


def _tell_of_replaced(
    root: Path, paths: StudyPaths, task: Task, say: Callable[[str], None]
) -> None:
    """Say before the search if the results that it will replace are of another task."""
    if not paths.summary.is_file():
        return
    rules = read_json(paths.summary, CONTROL).get("rules", {})
    if rules.get("task") != task.digest:
        say(
            f"{task.name}: {paths.summary.relative_to(root)} is of another robot, reward, budget "
            "or settings, and is replaced when this search ends; rename it to keep it"
        )


def task_of(root: Path, params: Params, name: str) -> Task:
    """Return what is tuned; arguments and errors as in `run`."""
    agent = params.agent(name)
    own = space.space_of(name, agent)
    build = robot.build if agent.robot == "edited" else robot.unedited
    demonstrations = None
    if agent.learns_from_demonstrations:
        path = Paths(root).demonstrations(agent.algorithm)
        demonstrations = read_bytes(path, f"demonstrate@{agent.algorithm}")
    world = World(build(params.robot, root), params.env)
    return Task(name, world, own, params.training, params.tuning, demonstrations)


def study_name(task: Task, sampler: SamplerName) -> str:
    """Return the name of a study: that of everything which its trials depend on."""
    code = training_code(task.space.agent.algorithm, Path(seed_run.__file__))
    content = [
        *task.content,
        task.tuning.model_dump(include=outcome.OF_A_STUDY),
        repr(task.space.ranges),
        [search.WORST, search.FEWEST, search.WARM_UP],
        list(map(effective_code.read, sorted(code))),
        digest(LOCK) if LOCK.is_file() else "",
    ]
    number = hashlib.sha256(json.dumps(content).encode()).hexdigest()[:8]
    return f"{task.name}-{sampler}-{number}"


def _verdict(
    params: Params, task: Task, study: optuna.Study, say: Callable[[str], None]
) -> dict[str, Any]:
    """Return the verdict on the best trial, for which nothing is trained if nothing changes."""
    best = search.best_of(study)
    if best is None or not task.space.chosen(best.params):
        return without_training(OPEN if best is None else UNCHANGED)
    num_workers = jobs.num_workers(params.compute.workers, 2 * params.tuning.fresh_seeds)
    agent = task.space.agent_with(best.params)
    episodes = params.evaluate.episodes
    fresh = Fresh(study, task, params.compare, episodes, best.number, agent)
    fresh.run(num_workers, say)
    return fresh.verdict()


def _write(
    root: Path,
    paths: StudyPaths,
    task: Task,
    study: optuna.Study,
    found: dict[str, Any],
    say: Callable[[str], None],
) -> None:
    ended = study.get_trials(deepcopy=False, states=list(outcome.STATES))
    table = outcome.rows(ended, task.space, task.tuning)
    shown = outcome.as_complete(study, task.tuning)
    control = Paths(root).study(task.name, is_control=True).summary
    drawn = found
    if "draws" not in found:  # a search's page shows its control's draws
        drawn = read_json(control, CONTROL) if control.is_file() else {}
    is_its_control = outcome.is_control_of(drawn, found)
    draws = drawn["draws"] if is_its_control else []
    if drawn and not is_its_control:
        path = control.relative_to(root)
        say(f"{task.name}: {path} is of another task, ranges or rules; `{CONTROL}` renews it")
    unit = "Value" if task.tuning.target_return is None else "Minus seconds"
    better = None
    if found.get("verdict") == "better":
        content = params_file.read(Paths(root).params)
        better = outcome.preset(task.name, task.space, found["settings"], content)
    html = page.build(found, table, shown, unit, draws)
    outcome.write(paths, table, found, html, better)
    told = f"{found['verdict']}, " if "verdict" in found else ""
    preset = f"; its settings are presets/{paths.preset.name}" if better else ""
    say(f"{task.name}: {told}see {paths.page.relative_to(root)}{preset}")
