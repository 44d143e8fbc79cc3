"""Searches for settings in MLflow: a run for each study of `results/tuning/`, nested its trials.

They have an experiment of their own.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from mlflow.entities import Run

from jumping_ant.base.errors import printable
from jumping_ant.base.files import blamed, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.tracking import pages
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import failures_as_input_errors, mirrored_alone
from jumping_ant.tracking.store import PARENT, Content, Store

EXPERIMENT = "jumping-ant-tuning"
STUDY, TRIAL, STATE, REASON = "study", "trial", "state", "reason"  # tags
BEST = "best_so_far"  # a study's curve, by trial
STATUS = {"complete": "FINISHED", "pruned": "KILLED"}
NUMBERS = ("trials", "pruned", "best_value", "before", "after", "difference", "low", "high", "p")


def track(root: Path, say: Callable[[str], None]) -> None:
    """Bring MLflow up to date with the studies of a project; a second call changes nothing."""
    summaries = sorted(Paths(root).study("").summary.parent.glob("*.json"))
    if not summaries:
        return
    store = stores.connect(root, EXPERIMENT)
    with failures_as_input_errors(store.uri), mirrored_alone(store.uri, say):
        for path in summaries:
            with blamed("tune", path, path.with_suffix(".csv")):
                _mirror(store, path, path.with_suffix(".csv"), say)


def _mirror(store: Store, path: Path, trials_path: Path, say: Callable[[str], None]) -> None:
    """Write a study's run, unless there is one of these files, and those of its new trials."""
    summary = read_json(path, "tune")
    table = pd.read_csv(trials_path, dtype=str, keep_default_na=False)
    name = summary["study"]
    values = {key: summary[key] for key in NUMBERS if summary.get(key) is not None}
    values |= {f"importance/{key}": share for key, share in summary["importance"].items()}
    runs = store.search(f"tags.{STUDY} = '{name}'")
    known = defaultdict[str, list[Run]](list)
    for run in runs:
        for trial in store.search(f"tags.`{PARENT}` = '{run.info.run_id}'"):
            known[trial.data.tags.get(TRIAL, "")].append(trial)
    complete = table[table["state"] == "complete"]
    best = complete["value"].astype(float).cummax()
    content = Content(
        name=name,
        tags={STUDY: name},
        params={"agent": summary["agent"], "sampler": summary["sampler"]},
        curve={(BEST, int(trial)): it for trial, it in zip(complete["trial"], best, strict=True)},
        metrics=values,
        artifacts={file.name: file for file in (trials_path, path)},
        aside={pages.NOTE: _note(summary)},
    )
    study, verb = store.settle(content, runs)
    rows = table.to_dict("records")
    verbs = [store.settle(_trial(row, study), known[row["trial"]])[1] for row in rows]
    num_new = len(rows) - verbs.count("unchanged")
    if num_new or verb != "unchanged":
        say(printable(f"study {name}: {len(rows)} trials, {num_new} new"))


def _trial(row: Mapping[str, Any], study: Run) -> Content:
    metrics = {"value": float(row["value"])} if row["value"] else {}
    for column, name in {"returns": "return", "seconds": "seconds"}.items():
        for place, value in enumerate(row[column].split(), start=1):
            metrics[f"{name}/seed_{place}"] = float(value)
    reason = {REASON: row["reason"]} if row["reason"] else {}
    return Content(
        name=f"trial {row['trial']}",
        tags={TRIAL: row["trial"], STATE: row["state"]} | reason,
        params={key: str(value) for key, value in json.loads(row["settings"]).items()},
        metrics=metrics,
        status=STATUS[row["state"]],
        place={PARENT: study.info.run_id},
    )


def _note(summary: Mapping[str, Any]) -> str:
    lines = [f"Search for settings of {summary['agent']}."]
    if "verdict" in summary:  # a control has none
        lines += [f"**{summary['verdict']}**.", summary.get("evidence", "")]
    return " ".join(lines).strip()
