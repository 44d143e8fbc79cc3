"""Anybody's runs in an experiment of MLflow."""

import math
from pathlib import Path

from mlflow import MlflowClient

from jumping_ant.base.errors import InputError
from jumping_ant.comparison.runs import Row, parted
from jumping_ant.tracking import connection

METRIC = "evaluation_return_mean"  # as this project's runs have it


def rows(root: Path, experiment: str, metric: str = "") -> list[Row]:
    """Read a metric of all runs of an experiment, each of an agent and a seed.

    These are tags or parameters of the run, `agent` and `seed`, or stand in its name, `DQN_1`.

    Raises:
        InputError: There is no such experiment, or no run with the metric.
    """
    uri, metric = connection.tracking_uri(root), metric or METRIC
    with connection.failures_as_input_errors(uri):
        client = MlflowClient(uri)
        if (found := client.get_experiment_by_name(experiment)) is None:
            names = ", ".join(it.name for it in client.search_experiments())
            raise InputError(f"experiment: given {experiment!r}, allowed: {names}")
        read = []
        for run in client.search_runs([found.experiment_id], max_results=5000):
            if metric not in run.data.metrics:
                continue
            known = run.data.params | run.data.tags
            if "agent" in known and known.get("seed", "").isdecimal():
                agent, seed = known["agent"], int(known["seed"])
            else:
                agent, seed = parted(run.info.run_name or "")
            for point in client.get_metric_history(run.info.run_id, metric):
                seconds = (point.timestamp - run.info.start_time) / 1000
                if math.isfinite(point.value):
                    read.append(Row(agent, seed, point.step, point.value, max(0.0, seconds)))
    if not read:
        raise InputError(f"{experiment}: given no run with {metric}; --metric NAME chooses another")
    return read
