"""From an agent to better settings: search, verdict, files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import optuna

from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.compute import cluster, jobs
from jumping_ant.params import params_file
from jumping_ant.params.model import Params
from jumping_ant.tuning import outcome, search
from jumping_ant.tuning.search import SamplerName
from jumping_ant.tuning.task import SearchSettings, Task, task_of
from jumping_ant.tuning.verdict import NUMBERS, OPEN, UNCHANGED, Fresh

ROUNDS = 4  # at least so many trials follow one another, so that later ones learn from earlier ones


def run(
    root: Path,
    params: Params,
    name: str,
    settings: SearchSettings,
    sampler: SamplerName = "tpe",
    storage: str | None = None,
    say: Callable[[str], None] = print,
) -> None:
    """Search for an agent's settings, from where an earlier call stopped, and write the outcome.

    The storage is by default a file of the project. An agent that cannot be tuned and a storage
    that cannot be used are InputErrors; after a StoppedError a call resumes.
    """
    task = task_of(root, params, name, settings)
    paths = Paths(root).study(name, is_control=sampler == "random")
    address = storage or f"{search.FILE}{paths.study}"
    if cluster.address() and address.startswith(search.FILE):
        raise InputError("storage: given a file, allowed on a cluster: postgresql://USER@HOST/NAME")
    present, ranges = task.space.agent, task.space.ranges.items()
    if outside := [key for key, range_ in ranges if not range_.has(getattr(present, key))]:
        say(f"{name}: outside of what is searched, and so no trial: {', '.join(outside)}")
    workers = jobs.num_workers(params.compute.workers, max(1, settings.trials // ROUNDS))
    key, first = task.study_name(sampler), {} if outside else task.space.present
    with search.opened(address, key, sampler, settings.prune_level, first) as study:
        say(f"{name}: study {key}, {settings.trials} trials")
        threads = jobs.num_threads(params.compute.workers, workers)[0]
        search.run(study, task, workers, threads, say)
        result = outcome.summary(task, sampler, study)
        if sampler == "tpe":
            result |= _verdict(task, study, say)
        table = outcome.rows(task, study)
    files: dict[Path, bytes | str] = {paths.trials: tables.to_csv(table, outcome.COLUMNS)}
    files[paths.summary] = to_json(result)
    if result.get("verdict") == "better":
        content = params_file.read(Paths(root).params)
        files[paths.preset] = outcome.preset(name, task.space, result["settings"], content)
    elif sampler == "tpe":
        paths.preset.unlink(missing_ok=True)  # of an earlier verdict
    write_all(files)
    say(f"{name}: {result.get('verdict', 'drawn')}, see " + ", ".join(map(str, files)))


def _verdict(task: Task, study: optuna.Study, say: Callable[[str], None]) -> dict[str, Any]:
    """Return the verdict on the best trial; without one, or if nothing changes, no number."""
    best = search.best_of(study)
    if best is None or not task.space.chosen(best.params):
        return {"verdict": OPEN if best is None else UNCHANGED} | dict.fromkeys(NUMBERS)
    fresh = Fresh(study, task, best)
    fresh.run(say)
    return fresh.verdict()
