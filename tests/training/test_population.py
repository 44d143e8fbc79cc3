"""A seed's population on all cores of a Ray cluster, which is started for the tests."""

import tempfile
import threading
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import small_agents
import small_ray
from small_training import digests, forget, small_params

from jumping_ant.agents.events import Checkpoint, Finished, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.compute import jobs
from jumping_ant.compute.cluster_parts import ClusterSpread
from jumping_ant.sim.world import World
from jumping_ant.training import driver, seed_run

CORES = 3
WORLD_STEPS = 40  # of an episode in validation
TRAINING = small_agents.PARAMS.training.model_copy(
    update={"evaluation_episodes": 1, "finalist_episodes": 1}
)


@pytest.fixture(autouse=True, scope="module")
def ray_cluster() -> Iterator[None]:
    """A cluster of one node."""
    port = small_ray.free_port()
    with (
        pytest.MonkeyPatch.context() as monkeypatch,
        tempfile.TemporaryDirectory(prefix="ray") as folder,
    ):
        monkeypatch.setenv("RAY_AUTH_MODE", "disabled")  # not the user's token
        monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{port}")
        with small_ray.started(folder, port, CORES):
            yield


def run(job: Job[Any], *, on_cluster: bool = False) -> tuple[list[bytes], list[bytes]]:
    """Return a seed's policies and its checkpoints, one after every generation."""
    work = partial(seed_run.run, job, TRAINING, checkpoint_seconds=0.0)
    if on_cluster:
        reports = [report for _, report in jobs.stream(lambda _: work, [0], 1)]
    else:
        reports = list(work(threading.Event()))
    events = [report.event for report in reports]
    return (
        [event.policy for event in events if isinstance(event, Snapshot | Finished)],
        [event.content for event in events if isinstance(event, Checkpoint)],
    )


@pytest.mark.parametrize("name", ["pgpe", "oscillator"])
def test_bytes_are_the_same_wherever_a_population_plays(robot_xml: str, name: str) -> None:
    """From the start, and from a checkpoint that another split has left."""
    agent = small_agents.agents()[name].model_copy(
        update={"population_size": 10, "observation_normalization": name == "pgpe"}
    )
    env = small_agents.PARAMS.env.model_copy(update={"max_episode_steps": WORLD_STEPS})
    job = Job(World(robot_xml, env), agent, seed=3, evaluations=2)
    policies, checkpoints = run(job)
    assert len(set(policies)) == 2 and len(set(checkpoints)) == 6
    assert run(replace(job, num_threads=4)) == (policies, checkpoints)
    spread = replace(job, spread=ClusterSpread(1))
    assert run(spread, on_cluster=True) == (policies, checkpoints)
    resumed, _ = run(replace(spread, checkpoint=checkpoints[2]), on_cluster=True)
    assert resumed[-1] == policies[-1]


def test_a_lonely_seed_trains_on_the_cluster_with_the_same_files(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = small_params(0).model_copy(update={"seeds": [5]})
    with monkeypatch.context() as patched:
        patched.setattr(jobs, "_inline", None)
        driver.train(project, settings, "pgpe")
    found = digests(project / "models")
    forget(project)
    monkeypatch.delenv("RAY_ADDRESS")
    driver.train(project, settings, "pgpe")
    assert digests(project / "models") == found
