"""Generators run side by side: inline for one worker, on Ray for more.

Ray is all that knows about processes and machines. It starts locally by default and joins a running
cluster when `RAY_ADDRESS` names one; the code then travels along, so nothing needs to be shared.
"""

import os
from collections.abc import Callable, Hashable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, cast

import ray
import torch
from ray.exceptions import AuthenticationError

import jumping_ant
from jumping_ant.errors import InputError

Key = TypeVar("Key", bound=Hashable)
Job = Callable[[], Iterator[Any]]

OBJECT_STORE_BYTES = (
    256 * 2**20
)  # policies and rows are small; Ray would take a third of the memory


def num_workers(requested: int, num_jobs: int) -> int:
    """Return how many workers to use.

    Args:
        requested: As in `params.yaml`; 0 stands for every core, and on a cluster for every job.
        num_jobs: More workers than jobs are of no use.
    """
    available = num_jobs if _on_cluster() else os.cpu_count() or 1
    return min(requested or available, num_jobs)


def num_threads(requested: int, num_jobs: int) -> list[int]:
    """Return how many threads each job may take, so that no core stands idle at the end.

    Jobs are as many as there are workers at a time, one thread each; those of a last, smaller round
    share the cores.

    Args:
        requested: As in `params.yaml`; 0 stands for every core.
        num_jobs: Jobs in all.
    """
    if _on_cluster():
        return [1] * num_jobs
    cores = requested or os.cpu_count() or 1
    last_round = num_jobs % cores or min(cores, num_jobs)
    return [1] * (num_jobs - last_round) + [cores // last_round] * last_round


def stream(jobs: Mapping[Key, Job], workers: int) -> Iterator[tuple[Key, Any]]:
    """Run generators and yield what they yield, as it comes.

    Args:
        jobs: What makes each generator, by key; to leave this process it must be picklable.
        workers: How many run at once.

    Yields:
        Key and item. The items of one generator come in its order, whatever the others do.

    Raises:
        InputError: `RAY_ADDRESS` names a cluster that cannot be joined.
    """
    return _inline(jobs) if workers == 1 else _on_ray(jobs, workers)


def _inline(jobs: Mapping[Key, Job]) -> Iterator[tuple[Key, Any]]:
    torch.set_num_threads(1)
    for key, job in jobs.items():
        for item in job():
            yield key, item


def _on_ray(jobs: Mapping[Key, Job], workers: int) -> Iterator[tuple[Key, Any]]:
    """Run each job as a Ray task that streams; every other task waits for a free worker."""
    _connect(workers)
    try:
        waiting = list(jobs.items())[::-1]
        running: dict[Any, Key] = {}
        while waiting or running:
            while waiting and len(running) < workers:
                key, job = waiting.pop()
                running[_generate.remote(job)] = key
            ready, _ = ray.wait(list(running), num_returns=1)
            for generator in ready:
                try:
                    yield running[generator], ray.get(next(cast(Iterator[Any], generator)))
                except StopIteration:
                    del running[generator]
    finally:
        ray.shutdown()


@ray.remote(num_cpus=1, num_returns="streaming", max_retries=0)
def _generate(job: Job) -> Iterator[Any]:
    torch.set_num_threads(1)
    yield from job()


def _on_cluster() -> bool:
    return bool(os.environ.get("RAY_ADDRESS"))


def _connect(workers: int) -> None:
    quiet: dict[str, Any] = {"logging_level": "ERROR", "log_to_driver": False}
    if _on_cluster():
        package = str(Path(jumping_ant.__file__).parent)
        try:
            ray.init(runtime_env={"py_modules": [package]}, **quiet)
        except (ConnectionError, AuthenticationError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise InputError(
                f"RAY_ADDRESS: given {os.environ['RAY_ADDRESS']!r}, which cannot be joined "
                f"({reason}); allowed: the address of a running cluster (with RAY_AUTH_MODE=token "
                "and its token, where it asks for one), or unset to compute on this machine"
            ) from error
    else:
        ray.init(
            num_cpus=workers,
            include_dashboard=False,
            object_store_memory=OBJECT_STORE_BYTES,
            **quiet,
        )
