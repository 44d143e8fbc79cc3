"""What holds for every algorithm of the catalogue."""

import json
from dataclasses import dataclass, replace
from functools import cache
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest
import small_agents

from jumping_ant.agents.catalogue import ALGORITHMS, row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.families import BASELINE
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base.archive import Archive
from jumping_ant.base.errors import InputError
from jumping_ant.params.blocks import EnvParams
from jumping_ant.policies import policy_file
from jumping_ant.sim.world import World

AGENTS = small_agents.agents()
LEARNERS = [name for name, algorithm in ALGORITHMS.items() if not algorithm.is_baseline]
ENV: EnvParams = small_agents.PARAMS.env.model_copy(update={"max_episode_steps": 40})


@pytest.mark.parametrize("name", ALGORITHMS)
def test_settings_are_named_and_documented(name: str) -> None:
    settings = ALGORITHMS[name].settings
    assert settings.model_fields["algorithm"].annotation.__args__ == (name,)
    assert all(field.description for field in settings.model_fields.values())
    assert not row(AGENTS[name]).learner or callable(resolve_name(row(AGENTS[name]).learner))
    assert ALGORITHMS[name].is_baseline == (ALGORITHMS[name].family == BASELINE)


@dataclass(frozen=True)
class Run:
    """A whole training, which leaves a checkpoint wherever it can."""

    job: Job[Any]
    events: list[Event]
    used: set[str]  # the settings that it read


@cache
def run_of(name: str, xml: str) -> Run:
    """Train a small agent of an algorithm."""
    used: set[str] = set()
    settings = type(AGENTS[name])

    class Watched(settings):  # type: ignore[valid-type, misc]
        def __getattribute__(self, key: str) -> Any:
            used.add(key)
            return super().__getattribute__(key)

    job = small_agents.job(
        World(xml, ENV), AGENTS[name], seed=3, evaluations=2, is_checkpoint_due=lambda: True
    )
    train = trainer_of(job.agent)
    watched = Watched.model_validate(job.agent.model_dump())
    used.clear()
    events = list(train(replace(job, agent=watched)))
    return Run(job, events, set(used))


@pytest.mark.parametrize("name", ALGORITHMS)
def test_training_ends_with_a_policy_that_acts(name: str, robot_xml: str) -> None:
    run = run_of(name, robot_xml)
    last = run.events[-1]
    assert isinstance(last, Finished)
    assert last.env_steps <= run.job.agent.max_env_steps + 16  # a round may pass the mark
    assert any(isinstance(event, Snapshot) for event in run.events)
    header = json.loads(Archive(last.policy)["policy.json"])
    assert header["kind"] == ALGORITHMS[name].policy_kind
    assert header["num_motors"] == 8 and header["num_observations"] in (27, None)
    logged = {key.partition("/")[2] for key in ALGORITHMS[name].logged}
    extra = [event.extra for event in run.events if isinstance(event, Progress)][-1:]
    assert all(logged <= row.keys() and np.isfinite([*row.values()]).all() for row in extra)
    policy = policy_file.parse(last.policy)
    policy.start(range(3))
    torques = policy.act(np.random.default_rng(0).normal(size=(3, 27)))
    assert torques.shape == (3, 8) and (np.abs(torques) <= 1).all()


@pytest.mark.parametrize("name", ALGORITHMS)
def test_the_seed_alone_determines_the_run(name: str, robot_xml: str) -> None:
    run = run_of(name, robot_xml)
    train = trainer_of(run.job.agent)
    again, other = (list(train(replace(run.job, seed=seed, num_threads=2))) for seed in (3, 4))
    assert repr(again) == repr(run.events), "a NaN equals no other"
    assert repr(other) != repr(run.events)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_training_uses_every_setting(name: str, robot_xml: str) -> None:
    """Whoever takes it: the library's class, its policy or this project's own code."""
    settings = type(AGENTS[name]).model_fields.keys()
    used = run_of(name, robot_xml).used
    assert used >= settings - {"algorithm", "robot"}, "the driver uses these"


@pytest.mark.parametrize("name", LEARNERS)
def test_a_resumed_training_is_the_same_to_the_last_bit(name: str, robot_xml: str) -> None:
    """From every checkpoint of a run, each in a trainer of its own."""
    run = run_of(name, robot_xml)
    events = run.events
    places = [i for i, event in enumerate(events) if isinstance(event, Checkpoint)]
    assert len(places) > 2
    for place in (places[0], places[len(places) // 2], places[-1]):
        rest = list(trainer_of(run.job.agent)(replace(run.job, checkpoint=events[place].content)))
        resumed, whole = (  # checkpoints' content may differ
            [repr(event) for event in part if not isinstance(event, Checkpoint)]
            for part in (rest, events[place + 1 :])
        )
        assert resumed == whole
    cut = events[places[0]].content[:-100]
    with pytest.raises(InputError, match="^seed 3: given a checkpoint that it cannot resume from"):
        list(trainer_of(run.job.agent)(replace(run.job, checkpoint=cut)))
