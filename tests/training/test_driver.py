"""The driver of training: files, validation, kills, and which policy is published."""

import csv
import hashlib
import json
import os
import re
import shutil
import signal
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import small_agents

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Finished, Snapshot
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.base.archive import pack_state
from jumping_ant.base.errors import InputError, StoppedError
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.params.blocks import ComputeParams
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.training import compute, driver
from jumping_ant.training.checkpoints import Saved

AGENTS = {name: row(agent) for name, agent in small_agents.PARAMS.agents.items()}
TRAINED = sorted(
    {
        agent.algorithm: name
        for name, agent in small_agents.PARAMS.agents.items()
        if not AGENTS[name].is_baseline
    }.values()
)
SMALL_OF_ALL = [*TRAINED, "random", "random-commands", "metronome"]


def small_params(workers: int) -> Params:
    settings = small_agents.PARAMS.model_dump()
    settings["seeds"] = [0, 5]
    settings["env"]["max_episode_steps"] = 40
    settings["training"]["evaluations"] = 2
    settings["compute"]["workers"] = workers
    for name in SMALL_OF_ALL:
        settings["agents"][name] |= small_agents.SMALL[settings["agents"][name]["trainer"]]
    return params_file.check(settings)


@pytest.fixture
def project(tmp_path: Path, robot_xml: str) -> Path:
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "edited.xml").write_text(robot_xml)
    return tmp_path


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def forget(project: Path) -> None:
    """Remove what the next training would resume from."""
    shutil.rmtree(project / ".checkpoints")


def test_workers_change_no_byte(project: Path) -> None:
    """Inline and on Ray: models and curves are the same files."""
    runs = []
    for workers in (1, 2):
        driver.train(project, small_params(workers), "pgpe")
        runs.append(digests(project / "models"))
        forget(project)
    assert runs[0] == runs[1]
    names = {"curve.csv", "final.zip", "machine.json", "policy.zip"}
    assert set(runs[0]) == {f"pgpe/seed-{seed}/{name}" for seed in (0, 5) for name in names}


def test_every_agent_reports_the_same_from_workers(robot_xml: str) -> None:
    """Inline and on Ray, where each of two processes trains one agent after another."""
    params = small_params(2)
    keys = [(agent, seed) for agent in SMALL_OF_ALL for seed in params.seeds]

    def start(key: tuple[str, int]) -> compute.Job:
        agent = params.agent(key[0])
        return partial(driver.train_seed, robot_xml, params.env, agent, params.training, key[1])

    runs = []
    for workers in (1, 2):
        reports: dict[tuple[str, int], list[driver.Report]] = {key: [] for key in keys}
        for key, report in compute.stream(start, keys, workers):
            reports[key].append(replace(report, seconds=0.0))
        runs.append(reports)
    assert repr(runs[0]) == repr(runs[1])  # rows hold NaN, which equals nothing
    assert all(isinstance(reports[-1].event, Finished) for reports in runs[0].values())


def test_no_older_policy_stands_by_a_new_curve(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver.train(project, small_params(1), "pgpe")
    forget(project)
    often = small_params(1).model_copy(
        update={"compute": ComputeParams(workers=1, checkpoint_seconds=1e-9)}
    )
    with monkeypatch.context() as patch, pytest.raises(KillError):
        interrupt(patch, 0, 1)
        driver.train(project, often, "pgpe")
    assert not list((project / "models").rglob("*.zip"))


class KillError(Exception):
    """Stands for a kill: nothing is tidied up after it."""


def interrupt(monkeypatch: pytest.MonkeyPatch, seed: int, checkpoint: int) -> None:
    """Have training end after the n-th checkpoint of a seed, with a row written behind it."""
    original = driver._Seed.take
    seen = []

    def take(self: Any, report: driver.Report) -> bool:
        if len(seen) == checkpoint:
            raise KillError
        is_taken = original(self, report)
        if isinstance(report.event, Checkpoint) and self.number == seed:
            seen.append(report.event.env_steps)
        return is_taken

    monkeypatch.setattr(driver._Seed, "take", take)


@pytest.mark.parametrize("agent", TRAINED)
def test_a_killed_run_goes_on_to_the_same_bytes(
    project: Path, agent: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = small_params(1)
    driver.train(project, settings, agent)
    expected = digests(project / "models")
    forget(project)
    often = settings.model_copy(
        update={"compute": ComputeParams(workers=1, checkpoint_seconds=1e-9)}
    )
    for seed, checkpoint in ((0, 1), (0, 2), (5, 1), (5, 2)):
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
        timing = rows(project / "results" / "agents" / agent / "timing.csv")
        seconds = [float(row["seconds"]) for row in timing if row["seed"] == seed]
        assert seconds == sorted(seconds) and len(seconds) > 1


@pytest.mark.parametrize("agent", ["pgpe", "sac"])
def test_a_checkpoint_of_wrong_content_gives_way_to_the_one_before(
    project: Path, agent: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its digest is right: it was written by another version, or by someone else."""
    settings = small_params(1)
    driver.train(project, settings, agent)
    expected = digests(project / "models")
    forget(project)
    often = settings.model_copy(
        update={"compute": ComputeParams(workers=1, checkpoint_seconds=1e-9)}
    )
    with monkeypatch.context() as patch, pytest.raises(KillError):
        interrupt(patch, 5, 2)
        driver.train(project, often, agent)
    for path in (project / ".checkpoints").rglob("*"):
        if path.name in ("seed-5.2.checkpoint", "seed-0.finished"):
            saved = Saved.from_bytes(path.read_bytes())
            path.write_bytes(replace(saved, content=pack_state({"state": 1})).to_bytes())
    capsys.readouterr()
    driver.train(project, settings, agent)
    said = capsys.readouterr().err
    assert "seed-5.2.checkpoint cannot be resumed from (KeyError" in said
    assert "seed 0: trained before, but not used (policy file: given" in said
    assert said.count("seed 5: resumes from") == 2
    assert digests(project / "models") == expected


def test_a_training_that_memory_is_too_small_for_is_refused(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = small_params(2)
    large = settings.agent("sac").model_copy(update={"buffer_size": 10**9})
    settings = settings.model_copy(update={"agents": {**settings.agents, "sac": large}})
    words = r"agents.sac: given sizes that need about 4\d\d\.\d GiB of memory, 2 seeds at a time"
    with pytest.raises(InputError, match=words):
        driver.train(project, settings, "sac")


@pytest.mark.parametrize("agent", TRAINED)
def test_threads_change_nothing_across_a_checkpoint(robot_xml: str, agent: str) -> None:
    settings = small_params(1)
    run = partial(train_seed, robot_xml, settings, agent)
    whole = run(num_threads=1)
    first = run(num_threads=2, stop_after=2)
    assert isinstance(first[-1].event, Checkpoint)
    at = first[-1].event
    saved = Saved(at.env_steps, first[-1].seconds, [], None, "", None, b"", at.content)
    rest = run(num_threads=1, saved=saved)
    told = [repr(report.event) for report in first[:-1] + rest]  # a NaN equals no other
    assert told == [repr(report.event) for report in whole]
    assert rest[0].seconds > first[-1].seconds


def train_seed(
    xml: str,
    settings: Params,
    agent: str,
    num_threads: int,
    stop_after: int | None = None,
    saved: Saved | None = None,
) -> list[driver.Report]:
    """Train seed 0, asked to stop after so many reports."""
    stop = threading.Event()
    reports = []
    for report in driver.train_seed(
        xml, settings.env, settings.agent(agent), settings.training, 0, stop, num_threads, saved
    ):
        reports.append(report)
        if len(reports) == stop_after:
            stop.set()
    return reports


def test_a_new_seed_trains_alone(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = small_params(1)
    more = settings.model_copy(update={"seeds": [0, 5, 6]})
    driver.train(project, more, "pgpe")
    expected = digests(project / "models")
    driver.train(project, settings, "pgpe")
    shutil.rmtree(project / "models")
    capsys.readouterr()
    driver.train(project, more, "pgpe")
    said = capsys.readouterr().err
    assert said.count("trained before") == 3, "a seed that was dropped meanwhile, too"
    assert digests(project / "models") == expected


def test_a_training_is_done_again_only_once_dvc_has_recorded_it(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Else something went wrong after it had finished, and it is not thrown away."""
    settings = small_params(1)
    timing = project / "results" / "agents" / "pgpe" / "timing.csv"

    def is_trained() -> bool:
        """Train, as DVC calls it; return whether any seed was trained."""
        shutil.rmtree(project / "models", ignore_errors=True)
        timing.unlink(missing_ok=True)
        capsys.readouterr()
        driver.train(project, settings, "pgpe")
        return "seed 5: trained before" not in capsys.readouterr().err

    def record() -> None:
        digest = hashlib.md5(timing.read_bytes(), usedforsecurity=False).hexdigest()
        (project / "dvc.lock").write_text(f"- path: {timing}\n  hash: md5\n  md5: {digest}\n")

    assert is_trained()
    first = timing.read_text()
    assert not is_trained() and timing.read_text() == first
    record()
    assert is_trained() and timing.read_text() != first, "`dvc repro --force`"
    assert not is_trained(), "forced, but stopped before DVC recorded it"
    record()
    assert is_trained()


def test_nothing_is_written_through_a_link_into_the_cache(project: Path) -> None:
    """`cache.type: symlink` makes links of outputs; DVC unlinks only what it knows."""
    settings = small_params(1)
    cached = project / "cached"
    for name in ("curve.csv", "policy.zip", "final.zip", "machine.json"):
        path = project / "models" / "pgpe" / "seed-0" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        cached.write_text("in the cache")
        path.symlink_to(cached)
    driver.train(project, settings, "pgpe")
    assert cached.read_text() == "in the cache"
    assert not any(path.is_symlink() for path in (project / "models").rglob("*"))


def test_what_results_depend_on_is_in_the_key(robot_xml: str) -> None:
    settings = small_params(1)
    agent = settings.agents["sac"]
    key = driver.dependencies(robot_xml, settings, agent)
    assert key == driver.dependencies(robot_xml, small_params(2), agent)
    easier = settings.env.model_copy(update={"min_torso_height": 0.1})
    changed = {
        "robot": (robot_xml + " ", settings, agent),
        "agent": (robot_xml, settings, agent.model_copy(update={"gamma": 0.5})),
        "trainer": (robot_xml, settings, settings.agents["pgpe"]),
        "task": (robot_xml, settings.model_copy(update={"env": easier}), agent),
    }
    keys = {key} | {driver.dependencies(*what) for what in changed.values()}
    assert len(keys) == len(changed) + 1


def test_a_machine_is_named_beside_each_policy(project: Path) -> None:
    driver.train(project, small_params(1), "pgpe")
    for seed in (0, 5):
        path = project / "models" / "pgpe" / f"seed-{seed}" / "machine.json"
        told = json.loads(path.read_text())
        assert told == machine.describe()
        assert told["cpu"] and told["blas_threads"] == 1
        assert set(told["versions"]) >= {"mujoco", "numpy", "torch"}


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
        while not curve.exists() or curve.read_text().count("\n") < 2:
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
    settings = small_params(2)
    driver.train(project, settings, "pgpe")
    expected = digests(project / "models")
    shutil.rmtree(project / ".checkpoints")
    slow = settings.model_dump()
    slow["compute"] = {"workers": 2, "checkpoint_seconds": 1e-9}

    def kill_one() -> None:
        folder = project / ".checkpoints"
        while not list(folder.rglob("*.checkpoint")):
            time.sleep(0.001)
        workers = [
            process
            for process in psutil.Process().children(recursive=True)
            if "ray::_Worker" in " ".join(process.cmdline())
        ]
        workers[0].kill()

    killer = threading.Thread(target=kill_one)
    killer.start()
    driver.train(project, params_file.check(slow), "pgpe")
    killer.join()
    told = capsys.readouterr().err
    assert re.search(r"pgpe: seed \d: its worker died, and another takes over", told)
    assert digests(project / "models") == expected


@pytest.mark.parametrize("agent", TRAINED)
def test_curve_and_timing(project: Path, agent: str) -> None:
    driver.train(project, small_params(1), agent)
    for seed in (0, 5):
        curve = rows(project / "models" / agent / f"seed-{seed}" / "curve.csv")
        assert list(curve[0])[:7] == list(driver.COLUMNS)
        steps = [int(row["env_steps"]) for row in curve]
        assert steps == sorted(steps)
        evaluated = [row for row in curve if row["evaluation_return_mean"]]
        assert len(evaluated) == 2
        assert all(row["return_mean"] == "" for row in evaluated), "one row, one kind of return"
        assert int(evaluated[-1]["env_steps"]) == steps[-1]
        timing = [row for row in rows(project / "results" / "agents" / agent / "timing.csv")]
        own = [row for row in timing if row["seed"] == str(seed)]
        assert [int(row["env_steps"]) for row in own] == steps
        seconds = [float(row["seconds"]) for row in own]
        assert seconds == sorted(seconds) and seconds[-1] > 0


@pytest.mark.parametrize("agent", ["random", "random-commands"])
def test_a_baseline_is_there_at_once(project: Path, agent: str) -> None:
    driver.train(project, small_params(2), agent)
    curve = rows(project / "models" / agent / "seed-5" / "curve.csv")
    assert [row["env_steps"] for row in curve] == ["0"]
    assert float(curve[0]["evaluation_return_mean"]) >= 0


def with_training(**changes: Any) -> Params:
    settings = small_params(1)
    return settings.model_copy(update={"training": settings.training.model_copy(update=changes)})


def snapshots(project: Path, settings: Params, agent: str, seed: int) -> dict[bytes, float]:
    """Return each snapshot of a run and its mean return in the validation episodes."""
    xml = (project / "assets" / "edited.xml").read_text()
    rules = settings.training
    seeds = [rules.evaluation_seed + i for i in range(rules.evaluation_episodes)]
    block = settings.agents[agent]
    events = trainer_of(block)(Job(xml, settings.env, block, seed, rules.evaluations))
    policy_files = [event.policy for event in events if isinstance(event, Snapshot)]
    assert len(policy_files) == rules.evaluations
    means = {}
    for content in policy_files:
        episodes = rollout.run(xml, settings.env, policy_file.parse(content), seeds)
        means[content] = float(np.mean([episode.rewards.sum() for episode in episodes]))
    return means


@pytest.mark.parametrize("agent", TRAINED)
def test_the_best_snapshot_in_validation_is_published(project: Path, agent: str) -> None:
    """And the last policy beside it."""
    settings = with_training(evaluations=3)
    driver.train(project, settings, agent)
    for seed in settings.seeds:
        folder = project / "models" / agent / f"seed-{seed}"
        means = snapshots(project, settings, agent, seed)
        best = max(means, key=means.__getitem__)
        assert len(means) == 3, "each snapshot differs: it learned"
        assert (folder / "policy.zip").read_bytes() == best
        assert (folder / "final.zip").read_bytes() == list(means)[-1]
        curve = rows(folder / "curve.csv")
        told = [float(row["evaluation_return_mean"] or "nan") for row in curve]
        assert np.nanmax(told) == means[best]


@pytest.mark.parametrize("agent", TRAINED)
def test_the_last_policy_is_published_if_asked_for(project: Path, agent: str) -> None:
    settings = with_training(evaluations=3, publish="final")
    driver.train(project, settings, agent)
    for seed in settings.seeds:
        folder = project / "models" / agent / f"seed-{seed}"
        last = list(snapshots(project, settings, agent, seed))[-1]
        assert (folder / "policy.zip").read_bytes() == (folder / "final.zip").read_bytes() == last


def test_of_equal_snapshots_the_first_is_published(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a later one that is worse never is, whatever came in between a kill and a resume."""
    settings = with_training(evaluations=4)
    settings = settings.model_copy(
        update={"compute": ComputeParams(workers=1, checkpoint_seconds=1e-9)}
    )
    scores = iter([5.0, 9.0, 9.0, 2.0] * 2 + [0.0] * 4)  # the first seed's come first
    seen = []
    original = driver._Seed.take

    def take(self: Any, report: driver.Report) -> bool:
        if isinstance(report.event, Snapshot):
            seen.append((self.number, report.event.policy))
            report = replace(report, returns=(next(scores),))
        is_taken = original(self, report)
        if isinstance(report.event, Checkpoint) and len(seen) == 3 and not stopped:
            stopped.append(True)
            raise KillError
        return is_taken

    stopped: list[bool] = []
    monkeypatch.setattr(driver._Seed, "take", take)
    agent = "pgpe"
    with pytest.raises(KillError):
        driver.train(project, settings, agent)
    assert len(seen) == 3 and not list((project / "models").rglob("*.zip"))
    driver.train(project, settings, agent)
    folder = project / "models" / agent / "seed-0"
    ours = [policy for number, policy in seen if number == 0]
    assert len(set(ours)) == 4
    assert (folder / "policy.zip").read_bytes() == ours[1]
    assert (folder / "final.zip").read_bytes() == ours[3]


def test_unknown_agent_is_refused(project: Path) -> None:
    names = ", ".join(small_params(1).agents)
    with pytest.raises(InputError, match=f"given 'nobody', allowed: {names}$"):
        driver.train(project, small_params(1), "nobody")
    assert not (project / "models").exists()


def test_missing_robot_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="dvc repro build"):
        driver.train(tmp_path, small_params(1), "random")
