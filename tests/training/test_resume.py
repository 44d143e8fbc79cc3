"""Training ends at any time, and resumes: kills, signals, dead workers, other seeds."""

import os
import re
import shutil
import signal
import threading
import time
from functools import partial
from pathlib import Path
from typing import Any

import psutil
import pytest
import small_agents
from small_disk import small_disk
from small_project import read_csv
from small_training import ONE_OF_EACH, TRAINED, KillError, digests, forget, small_params

from jumping_ant.agents.events import Checkpoint
from jumping_ant.agents.job import Job
from jumping_ant.base.errors import StoppedError
from jumping_ant.params import params_file
from jumping_ant.params.blocks import ComputeParams
from jumping_ant.params.model import Params
from jumping_ant.sim.world import World
from jumping_ant.training import driver, seed_run
from jumping_ant.training.checkpoints import checkpoint_key
from jumping_ant.training.seed_files import SeedFiles
from jumping_ant.training.seed_run import Report


def with_many_checkpoints() -> Params:
    """Return small parameters with a checkpoint after every round of work."""
    compute = ComputeParams(workers=1, checkpoint_seconds=1e-9, live_after_seconds=0)
    return small_params(1).model_copy(update={"compute": compute})


def interrupt(monkeypatch: pytest.MonkeyPatch, seed: int, checkpoint: int) -> None:
    """Have training end after the n-th checkpoint of a seed, with a row written behind it."""
    original = SeedFiles.take
    seen = []

    def take(self: Any, report: Report) -> None:
        if len(seen) == checkpoint:
            raise KillError
        original(self, report)
        if isinstance(report.event, Checkpoint) and self.number == seed:
            seen.append(report.event.env_steps)

    monkeypatch.setattr(SeedFiles, "take", take)


@pytest.mark.parametrize("agent", ONE_OF_EACH)
def test_a_killed_run_resumes_to_the_same_bytes(
    project: Path, agent: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As do the trainers of all algorithms, for which tests/agents/test_catalogue.py looks."""
    settings, often = small_params(1), with_many_checkpoints()
    driver.train(project, settings, agent)
    expected = digests(project / "models")
    forget(project)
    for seed, checkpoint in ((0, 1), (5, 2)):
        shutil.rmtree(project / "models")  # as DVC does before a stage runs
        with monkeypatch.context() as patch, pytest.raises(KillError):
            interrupt(patch, seed, checkpoint)
            driver.train(project, often, agent)
    shutil.rmtree(project / "models")
    capsys.readouterr()
    driver.train(project, often, agent)
    assert digests(project / "models") == expected
    said = capsys.readouterr().err
    assert f"{agent}: seed 0: trained before" in said
    assert f"{agent}: seed 5: resumes from" in said
    left = {path.name for path in (project / ".checkpoints").rglob("*") if path.is_file()}
    assert left == {"lock", "seed-0.finished", "seed-5.finished"}
    for seed in ("0", "5"):
        timing = read_csv(project / "results" / "timing" / agent / "timing.csv")
        seconds = [float(row["seconds"]) for row in timing if row["seed"] == seed]
        assert seconds == sorted(seconds) and len(seconds) > 1


def test_a_full_disk_ends_training_and_the_next_run_completes_it(project: Path) -> None:
    driver.train(project, small_params(1), "pgpe")
    expected = digests(project / "models")
    forget(project)
    often = with_many_checkpoints()
    room_for_a_curve = small_disk(2_000)
    with room_for_a_curve, pytest.raises(OSError, match="File too large"):
        driver.train(project, often, "pgpe")
    driver.train(project, often, "pgpe")
    assert digests(project / "models") == expected


@pytest.mark.parametrize("agent", TRAINED)
def test_threads_change_nothing_across_a_checkpoint(robot_xml: str, agent: str) -> None:
    settings = small_params(1)
    run = partial(reports_of, robot_xml, settings, agent)
    whole = run(num_threads=1)
    first = run(num_threads=2, stop_after=2)
    assert isinstance(first[-1].event, Checkpoint)
    rest = run(num_threads=1, checkpoint=first[-1].event.content, seconds=first[-1].seconds)
    told = [repr(report.event) for report in first[:-1] + rest]  # a NaN equals no other
    assert told == [repr(report.event) for report in whole]
    assert rest[0].seconds > first[-1].seconds


def reports_of(
    xml: str,
    settings: Params,
    agent: str,
    num_threads: int,
    stop_after: int | None = None,
    checkpoint: bytes | None = None,
    seconds: float = 0.0,
) -> list[Report]:
    """Train seed 0, asked to stop after so many reports."""
    stop, block = threading.Event(), settings.agent(agent)
    known = small_agents.demonstrations(xml) if block.learns_from_demonstrations else None
    evaluations = settings.training.evaluations
    job = Job(World(xml, settings.env), block, 0, evaluations, num_threads, known, checkpoint)
    reports = []
    for report in seed_run.run(job, settings.training, range(9), stop, seconds):
        reports.append(report)
        if len(reports) == stop_after:
            stop.set()
    return reports


def test_what_results_depend_on_is_in_the_key(robot_xml: str) -> None:
    settings = small_params(1)
    agent, training = settings.agents["sac"], settings.training
    world = World(robot_xml, settings.env)
    key = checkpoint_key(world, training, agent)
    assert key == checkpoint_key(World(robot_xml, small_params(2).env), training, agent)
    easier = settings.env.model_copy(update={"min_torso_height": 0.1})
    changed = {
        "robot": (World(robot_xml + " ", settings.env), training, agent),
        "agent": (world, training, agent.model_copy(update={"gamma": 0.5})),
        "algorithm": (world, training, settings.agents["pgpe"]),
        "task": (World(robot_xml, easier), training, agent),
        "snapshots": (world, training.model_copy(update={"evaluation_seed": 1}), agent),
    }
    keys = {key} | {checkpoint_key(*what) for what in changed.values()}
    assert len(keys) == len(changed) + 1


def test_a_signal_ends_training_with_a_checkpoint(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = small_params(1)
    driver.train(project, settings, "sac")
    expected = digests(project / "models")
    more = settings.model_dump()
    more["seeds"] = [5, 0]  # not the same request as before
    shutil.rmtree(project / ".checkpoints")
    settings = params_file.check(more)
    curve = project / "models" / "sac" / "seed-5" / "curve.csv"
    curve.unlink()

    def send() -> None:
        while not curve.exists() or curve.read_text(encoding="utf-8").count("\n") < 2:
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGTERM)

    sender = threading.Thread(target=send)
    sender.start()
    with pytest.raises(StoppedError, match="sac is not trained yet; the next run resumes: seed"):
        driver.train(project, settings, "sac")
    sender.join()
    capsys.readouterr()
    driver.train(project, settings, "sac")
    assert "resumes from" in capsys.readouterr().err
    assert digests(project / "models") == expected


def test_a_dead_worker_is_replaced_from_the_checkpoint(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    driver.train(project, small_params(1), "pgpe")
    expected = digests(project / "models")
    shutil.rmtree(project / ".checkpoints")
    slow = small_params(2).model_dump()
    slow["compute"]["checkpoint_seconds"] = 1e-9

    def kill_one() -> None:
        folder = project / ".checkpoints"
        while not list(folder.rglob("*.checkpoint")):
            time.sleep(0.001)
        workers = [
            process
            for process in psutil.Process().children(recursive=True)
            if "spawn_main" in " ".join(process.cmdline())
        ]
        for worker in workers:  # the one that has written a checkpoint, and its neighbour
            worker.kill()

    killer = threading.Thread(target=kill_one)
    killer.start()
    driver.train(project, params_file.check(slow), "pgpe")
    killer.join()
    told = capsys.readouterr().err
    assert re.search(r"pgpe: seed \d: its worker died \(SIGKILL\), and another takes over", told)
    assert digests(project / "models") == expected
