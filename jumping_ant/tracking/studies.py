"""Searches for settings in MLflow: a run for each study, and nested under it one for each trial.

They have an experiment of their own, so that the table of the comparison stays one of agents and
seeds. As everywhere, files are the source: a study is what `results/tuning/` says of it.
"""

import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any

from mlflow.entities import Run

from jumping_ant.base.files import read_json
from jumping_ant.base.paths import Paths, StudyPaths
from jumping_ant.experiment import trials
from jumping_ant.tracking import pages
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import failures_as_input_errors, mirrored_alone
from jumping_ant.tracking.store import PARENT, Content, Points, Store, children_of

EXPERIMENT = "jumping-ant-tuning"
TIMEOUT_SECONDS, MAX_RETRIES = 20, 1
STUDY, TRIAL, STATE, REASON = "study", "trial", "state", "reason"  # tags
BEST = "best_so_far"  # a study's curve, by trial
STATUS = {"complete": "FINISHED", "pruned": "KILLED"}
NUMBERS = ("trials", "pruned", "best_value", "before", "after", "difference", "low", "high", "p")


def track(root: Path, say: Callable[[str], None]) -> None:
    """Bring MLflow up to date with the studies of a project; a second call changes nothing."""
    found = list(_found(root))
    if not found:
        return
    store = stores.connect(root, TIMEOUT_SECONDS, MAX_RETRIES, EXPERIMENT)
    with failures_as_input_errors(store.uri), mirrored_alone(store.uri, say):
        for paths in found:
            _mirror(store, paths, say)


def _found(root: Path) -> Iterator[StudyPaths]:
    """Yield the files of each study, and of each control."""
    folder = Paths(root).study("").summary.parent
    for summary in sorted(folder.glob("*.json")):
        agent = summary.stem.removesuffix("-random")
        yield Paths(root).study(agent, is_control=summary.stem != agent)


def _mirror(store: Store, paths: StudyPaths, say: Callable[[str], None]) -> None:
    """Write a study's run, unless there is one of these files, and those of its new trials."""
    summary = read_json(paths.summary, "tune")
    name, table = summary["study"], trials.read(paths.trials)
    values = {key: summary[key] for key in NUMBERS if summary.get(key) is not None}
    values |= {f"importance/{key}": own for key, own in summary["importance"].items()}
    found = store.search(f"tags.{STUDY} = '{name}'")
    known = defaultdict[str, list[Run]](list)
    for trial in (it for run in found for it in store.search(children_of(run))):
        known[trial.data.tags.get(TRIAL, "")].append(trial)
    content = Content(
        name=name,
        tags={STUDY: name},
        params={"agent": summary["agent"], "sampler": summary["sampler"]},
        curve=_best_so_far(table),
        metrics=values,
        artifacts={
            path.name: path for path in (paths.trials, paths.summary, paths.page) if path.exists()
        },
        aside={pages.NOTE: _note(summary)},
    )
    study, is_new = store.settle(content, found)
    done = [store.settle(_trial(row, study), known[row["trial"]])[1] for row in table]
    if is_new or any(done):
        say(f"study {name}: {len(table)} trials, {sum(done)} new")


def _trial(row: Mapping[str, Any], study: Run) -> Content:
    own = {"value": trials.value(dict(row))}
    for place, value in enumerate(row["returns"].split()):
        own[f"return/seed_{place + 1}"] = float(value)
    for place, value in enumerate(row["seconds"].split()):
        own[f"seconds/seed_{place + 1}"] = float(value)
    reason = {REASON: row["reason"]} if row["reason"] else {}
    return Content(
        name=f"trial {row['trial']}",
        tags={TRIAL: row["trial"], STATE: row["state"]} | reason,
        params={key: str(value) for key, value in json.loads(row["settings"]).items()},
        metrics={key: value for key, value in own.items() if math.isfinite(value)},
        status=STATUS[row["state"]],
        place={PARENT: study.info.run_id},
    )


def _best_so_far(table: list[dict[str, str]]) -> Points:
    complete = [row for row in table if row["state"] == "complete"]
    best = accumulate(map(trials.value, complete), max)
    return {(BEST, int(row["trial"])): value for row, value in zip(complete, best, strict=True)}


def _note(summary: Mapping[str, Any]) -> str:
    """Return the description of a study's run."""
    lines = [f"Search for settings of {summary['agent']}."]
    if "verdict" in summary:  # a control has none
        lines += [f"**{summary['verdict']}**.", summary.get("evidence", "")]
    return " ".join(lines).strip()
