"""The driver of training: files, workers, validation, and which policy is published."""

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small_agents
from small_project import read_csv
from small_training import ONE_OF_EACH, digests, small_params

from jumping_ant.agents.events import Finished, Snapshot
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine, portable
from jumping_ant.base.paths import Paths
from jumping_ant.compute import jobs
from jumping_ant.compute.processes import Work
from jumping_ant.params.model import Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World
from jumping_ant.training import curves, driver, seed_run
from jumping_ant.training.seed_run import Report


def test_an_agent_reports_the_same_from_workers(robot_xml: str) -> None:
    """Inline and in workers, where each of two processes trains one agent after another."""
    params, demonstrations = small_params(2), small_agents.demonstrations(robot_xml)

    def start(name: str) -> Work:
        agent = params.agent(name)
        shown = demonstrations if agent.learns_from_demonstrations else None
        job = Job(World(robot_xml, params.env), agent, 5, params.training.evaluations, 1, shown)
        return partial(seed_run.run, job, params.training, params.training.block(0))

    runs = []
    for workers in (1, 2):
        reports: dict[str, list[Report]] = {name: [] for name in ONE_OF_EACH}
        for name, report in jobs.stream(start, ONE_OF_EACH, workers):
            reports[name].append(replace(report, seconds=0.0))
        runs.append(reports)
    assert repr(runs[0]) == repr(runs[1])  # rows hold NaN, which equals nothing
    assert all(isinstance(reports[-1].event, Finished) for reports in runs[0].values())


def test_nothing_is_written_through_a_link_into_the_cache(project: Path) -> None:
    """`cache.type: symlink` makes links of outputs; DVC unlinks only what it knows."""
    settings = small_params(1)
    cached = project / "cached"
    for name in ("curve.csv", "policy.zip", "final.zip", "validation.csv"):
        path = project / "models" / "pgpe" / "seed-0" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        cached.write_text("in the cache", encoding="utf-8")
        path.symlink_to(cached)
    driver.train(project, settings, "pgpe")
    assert cached.read_text(encoding="utf-8") == "in the cache"
    assert not any(path.is_symlink() for path in (project / "models").rglob("*"))


def test_machines_and_digests_are_kept_apart_from_policies(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also of seeds that were trained before."""
    monkeypatch.setattr(portable, "is_supported", lambda: False)
    paths = Paths(project).agent("pgpe")
    for _ in range(2):
        driver.train(project, small_params(1), "pgpe")
        assert portable.UNSUPPORTED in capsys.readouterr().err
        machines = json.loads(paths.machines.read_text(encoding="utf-8"))
        assert machines == {"0": machine.describe(), "5": machine.describe()}
        kept = json.loads(paths.training.read_text(encoding="utf-8"))
        for seed in (0, 5):
            written = digests(paths.seed(seed).folder)
            assert kept[str(seed)] == written
            assert set(written) == {"curve.csv", "final.zip", "policy.zip", "validation.csv"}
        paths.machines.unlink()


@pytest.mark.parametrize("agent", ONE_OF_EACH)
def test_curve_and_timing(project: Path, agent: str) -> None:
    driver.train(project, small_params(1), agent)
    for seed in (0, 5):
        curve = read_csv(project / "models" / agent / f"seed-{seed}" / "curve.csv")
        assert list(curve[0])[:9] == ["agent", "seed", *curves.COLUMNS]
        assert {(row["agent"], row["seed"]) for row in curve} == {(agent, str(seed))}
        steps = [int(row["env_steps"]) for row in curve]
        assert steps == sorted(steps)
        evaluated = [row for row in curve if row["evaluation_return_mean"]]
        assert len(evaluated) == 2
        assert all(row["return_mean"] == "" for row in evaluated), "one row, one kind of return"
        assert int(evaluated[-1]["env_steps"]) == steps[-1]
        rows = read_csv(Paths(project).agent(agent).timing)
        timing = [row for row in rows if row["seed"] == str(seed)]
        assert [int(row["env_steps"]) for row in timing] == steps
        seconds = [float(row["seconds"]) for row in timing]
        assert seconds == sorted(seconds) and seconds[-1] > 0


def test_seeds_share_a_search_that_does_not_depend_on_them(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A seed that is added later has the same, too."""
    searched = []
    monkeypatch.setattr(
        seed_run, "trainer_of", lambda agent: searched.append(1) or trainer_of(agent)
    )
    settings = small_params(2)
    driver.train(project, settings, "metronome")
    assert len(searched) == 1
    driver.train(project, settings.model_copy(update={"seeds": [0, 5, 6]}), "metronome")
    assert len(searched) == 2 and capsys.readouterr().err.count("trained before") == 2
    folders = [project / "models" / "metronome" / f"seed-{seed}" for seed in (0, 5, 6)]
    policies = [policy_file.parse((folder / "policy.zip").read_bytes()) for folder in folders]
    assert len({policy.to_bytes() for policy in policies}) == 1
    curves = [(folder / "curve.csv").read_text(encoding="utf-8") for folder in folders]
    assert len({re.sub(r"(?m)^metronome,\d,", "", curve) for curve in curves}) == 1


def with_training(**changes: Any) -> Params:
    settings = small_params(1)
    return settings.model_copy(update={"training": settings.training.model_copy(update=changes)})


def snapshots(project: Path, settings: Params, agent: str, seed: int) -> dict[bytes, np.ndarray]:
    """Return each snapshot of a run, as published, and its returns in both rounds of validation."""
    xml = (project / "assets" / "edited.xml").read_text(encoding="utf-8")
    rules, world = settings.training, World(xml, settings.env)
    count = rules.evaluation_episodes + rules.finalist_episodes
    seeds = rules.block(seed)[:count]
    block = settings.agents[agent]
    returns = {}
    job = small_agents.job(world, block, seed, evaluations=rules.evaluations)
    for event in trainer_of(block)(job):
        if isinstance(event, Snapshot):
            episodes = rollout.run(world, policy_file.parse(event.policy), seeds)
            published = policy_file.owned(event.policy, (agent, seed))
            returns[published] = np.array([episode.rewards.sum() for episode in episodes])
    assert len(returns) == rules.evaluations, "each snapshot differs: it learned"
    return returns


@pytest.mark.parametrize("agent", ["pgpe", "sac"])
def test_the_best_of_the_finalists_is_published(project: Path, agent: str) -> None:
    """And the last policy beside it."""
    settings = with_training(evaluations=3, finalists=2)
    driver.train(project, settings, agent)
    for seed in settings.seeds:
        paths = Paths(project).agent(agent).seed(seed)
        returns = snapshots(project, settings, agent, seed)
        first = {policy: float(np.mean(each[:4])) for policy, each in returns.items()}
        finalists = sorted(first, key=first.__getitem__)[-2:]
        means = {policy: float(np.mean(returns[policy])) for policy in finalists}
        assert paths.policy.read_bytes() == max(means, key=means.__getitem__)
        assert paths.final_policy.read_bytes() == list(returns)[-1]
        shown = [row["evaluation_return_mean"] for row in read_csv(paths.curve)]
        assert [float(mean) for mean in shown if mean] == list(first.values())
        rows = read_csv(paths.validation)
        assert {float(row["return_mean"]) for row in rows} == set(means.values())
        assert {row["episodes"] for row in rows} == {"7"}
        steps = [int(row["env_steps"]) for row in rows]
        assert steps == sorted(set(steps))
        assert curves.published_return(project, agent, seed) == max(means.values())


def test_the_last_policy_is_published_if_asked_for(project: Path) -> None:
    settings = with_training(evaluations=3, publish="final")
    driver.train(project, settings, "pgpe")
    for seed in settings.seeds:
        paths = Paths(project).agent("pgpe").seed(seed)
        last, returns = list(snapshots(project, settings, "pgpe", seed).items())[-1]
        assert paths.policy.read_bytes() == paths.final_policy.read_bytes() == last
        (row,) = read_csv(paths.validation)  # which no race preceded
        assert (float(row["return_mean"]), row["episodes"]) == (np.mean(returns[:4]), "4")
