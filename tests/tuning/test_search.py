"""The course of a study, with returns that the tests give instead of trainings."""

import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
import small_agents
from numpy.typing import NDArray
from optuna.pruners import WilcoxonPruner
from optuna.samplers._tpe.sampler import _get_pruned_trial_score
from optuna.trial import TrialState, create_trial
from small_study import RANGES, small_params

from jumping_ant.agents import kernels
from jumping_ant.agents.job import Job
from jumping_ant.base.errors import StoppedError
from jumping_ant.experiment import params_file
from jumping_ant.sim.world import World
from jumping_ant.tuning import objective, outcome, search, space, study, tune
from jumping_ant.tuning.objective import Fault, Measured
from jumping_ant.tuning.search import Search

NEVER = (10.0, float("inf"))


@pytest.fixture(autouse=True)
def small_ranges(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(space.RANGES, "pgpe", RANGES)


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[optuna.Study]:
    address = f"{study.FILE}{tmp_path}/study.db"
    with study.opened(address, "test", "tpe", 0.01, None) as found:
        yield found


def make(
    opened: optuna.Study, said: list[str] | None = None, trials: int = 4, **tuning: Any
) -> Search:
    params = small_params(trials, episodes=10, **tuning)
    task = tune.task_of(Path(), params, "pgpe")
    return Search(
        opened, study.FILE, task, say=(said or []).append if said is None else said.append
    )


def measured(*returns: float, onset: tuple[float, float] = (0.0, 1.0)) -> Measured:
    return Measured(returns, 5.0, onset)


def around(mean: float) -> Measured:
    return measured(*(mean + offset for offset in range(-5, 5)))


def noted(mean: float) -> dict[str, Any]:
    """Return what a trial notes of a seed."""
    return {"return": mean, "seconds": 1.0, "onset": (0.0, 1.0), "bests": [], "is_cut": False}


def states(opened: optuna.Study) -> list[str]:
    return [trial.state.name for trial in opened.trials]


def test_a_trial_trains_its_seeds_one_after_another(opened: optuna.Study) -> None:
    found = make(opened)
    assert next(found) == (0, 0)
    found.take((0, 0), around(100))
    assert next(found) == (0, 1)
    assert next(found) == (1, 0), "another worker begins the next trial"
    found.take((0, 1), around(120))
    found.take((1, 0), around(300))
    assert next(found) == (1, 1)
    assert states(opened) == ["COMPLETE", "RUNNING"]
    # Half way from the mean, 109.5, to the worse seed.
    assert opened.trials[0].value == pytest.approx(104.5)


def test_no_more_trials_begin_than_asked_for(opened: optuna.Study) -> None:
    found, told = make(opened), []
    for key in found:
        told.append(key)
        found.take(key, around(100 + key[0]))
    assert told == [(trial, seed) for trial in range(4) for seed in range(2)]
    assert list(make(opened)) == []
    assert len(list(make(opened, seeds=2).task.space.distributions)) == len(RANGES)


def test_a_trial_that_returns_less_in_every_episode_ends_early(opened: optuna.Study) -> None:
    said: list[str] = []
    found = make(opened, said)
    for key, mean in (((0, 0), 100), ((0, 1), 100), ((1, 0), 50)):
        assert next(found) == key
        found.take(key, around(mean))
    assert next(found) == (2, 0)
    assert states(opened) == ["COMPLETE", "PRUNED", "RUNNING"]
    assert opened.trials[1].user_attrs["reason"] == "less than trial 0"
    assert said[1].startswith(
        "trial 1: 49.5; ended early, less than trial 0; best 99.5 of trial 0;"
    )


def test_a_trial_that_returns_less_in_some_episodes_goes_on(opened: optuna.Study) -> None:
    found = make(opened)
    for key, own in (((0, 0), around(100)), ((0, 1), around(100))):
        next(found)
        found.take(key, own)
    next(found)
    mixed = around(100)
    found.take(
        (1, 0), measured(*(own + (9 if i % 2 else -12) for i, own in enumerate(mixed.returns)))
    )
    assert next(found) == (1, 1)


def test_the_sampler_ranks_trials_that_ended_early_by_their_values(opened: optuna.Study) -> None:
    """Not by their last episodes, nor by how many they have played."""
    found = make(opened, trials=6)
    for _ in range(2):
        found.take(next(found), around(5000))
    low, high = [100.0] * 9 + [150.0], [3000.0] * 9 + [10.0]
    wild = Fault("ValueError: not finite")
    for own in (measured(*low), measured(*high), wild):
        found.take(next(found), own)
    assert next(found) == (4, 0)
    found.take((4, 0), around(5001))
    found.take(next(found), wild)
    pruned = opened.get_trials(states=[TrialState.PRUNED])
    assert [trial.number for trial in pruned] == [1, 2, 3, 4]
    assert {trial.last_step for trial in pruned} == {20}, "after those of all episodes"
    scores = [_get_pruned_trial_score(trial, opened) for trial in pruned]
    assert [scores.index(own) for own in sorted(set(scores))] == [1, 0, 2]
    assert scores[2] == scores[3], "the worst, also with a lucky first seed"


def test_killed_as_it_ended_a_trial(opened: optuna.Study, monkeypatch: pytest.MonkeyPatch) -> None:
    found = make(opened, trials=3)
    for _ in range(2):
        found.take(next(found), around(100))
    with monkeypatch.context() as context:
        context.setattr(opened, "tell", lambda *_, **__: sys.exit(1))
        with pytest.raises(SystemExit):
            found.take(next(found), around(50))
    before = opened.trials[1].intermediate_values
    with pytest.warns(UserWarning, match="already reported"):
        make(opened, trials=3)
    assert states(opened) == ["COMPLETE", "PRUNED"]
    assert opened.trials[1].intermediate_values == before
    assert opened.trials[1].user_attrs["reason"] == "less than trial 0"


def test_what_diverges_is_told_with_its_reason(opened: optuna.Study) -> None:
    said: list[str] = []
    found = make(opened, said)
    next(found)
    found.take((0, 0), Fault("ValueError: not finite"))
    assert states(opened) == ["PRUNED"] and opened.trials[0].value is None
    told = "no value; ended early, ValueError: not finite; none complete yet; 3 left, "
    assert said[0].startswith(f"trial 0: {told}")


def test_a_trial_that_diverges_at_its_second_seed_has_no_value(opened: optuna.Study) -> None:
    """However good its first one was."""
    found = make(opened, trials=3)
    for key, own in (((0, 0), around(900)), ((0, 1), Fault("ValueError: not finite"))):
        assert next(found) == key
        found.take(key, own)
    for mean in (100, 200):
        for _ in range(2):
            found.take(next(found), around(mean))
    first, *others = opened.trials
    assert len(search.seeds_of(first)) == 1 and search.value_of(first, found.task.tuning) is None
    least, *_ = (trial.values[0] for trial in others)
    assert outcome.values(opened.trials, found.task.tuning)[:2] == [least, least]
    assert len(outcome.as_complete(opened, found.task.tuning).trials) == 2


def test_a_seed_ends_where_it_is_among_the_worst(opened: optuna.Study) -> None:
    said: list[str] = []
    found = make(opened, said, trials=6)
    assert found._floors() == [-np.inf] * 2, "nothing to compare with"
    for trial in range(4):
        for seed in range(2):
            bests = (100.0 + trial + seed, 200.0 + trial + seed)
            found.take(next(found), replace(around(100), bests=bests))
    assert found._floors() == [-np.inf, np.quantile([200, 201, 201, 202, 202, 203, 203, 204], 0.25)]
    found.take(next(found), replace(around(100), bests=(100.0, 150.0), is_cut=True))
    reason = "seed 1 was among the worst at evaluation 2 of 2"
    assert opened.trials[4].user_attrs["reason"] == reason
    assert f"trial 4: 99.5; ended early, {reason}; " in said[-1]


def test_killed_between_the_end_of_a_seed_and_that_of_its_trial(opened: optuna.Study) -> None:
    found = make(opened)
    trial = study.begin(opened, found.task.space.distributions)
    trial.set_user_attr("seed 0", noted(50.0) | {"bests": [50.0], "is_cut": True})
    make(opened)
    assert states(opened) == ["PRUNED"]


def test_a_trial_whose_machine_falls_silent_is_taken_over_at_the_end(
    opened: optuna.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until then, a search that has nothing else left says when that machine was heard of."""
    monkeypatch.setattr(study, "taking_turns", lambda storage: nullcontext())
    found = make(opened, trials=2)
    found.storage = "postgresql://nowhere"
    elsewhere = study.begin(opened, found.task.space.distributions)
    elsewhere.set_user_attr(study.OWNER, "cellar 1 a")
    for _ in range(2):
        found.take(next(found), around(100))
    elsewhere.set_user_attr(study.SIGN, time.time() - 3600.0)
    monkeypatch.setattr("jumping_ant.compute.jobs.stream", lambda *_: iter(()))
    with pytest.raises(StoppedError, match="trial 0 on cellar, heard of 60 minutes ago"):
        search.run(found, 1)
    assert list(found) == []
    elsewhere.set_user_attr(study.SIGN, time.time() - 7 * 3600.0)
    assert next(found) == (0, 0)
    assert list(found) == [], "once"


def test_settings_that_are_refused_train_nothing(
    opened: optuna.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: object, chosen: object, share: float = 1.0) -> None:
        raise space.RefusedError("n_top is 9")

    found = make(opened)
    monkeypatch.setattr(space.Space, "agent_with", refuse)
    assert list(found) == [] and states(opened) == ["PRUNED"] * 4
    assert opened.trials[0].user_attrs["reason"] == "refused: n_top is 9"


def test_trials_may_compete_for_seconds(opened: optuna.Study) -> None:
    found = make(opened, target_return=6500.0)
    for key, seconds in (((0, 0), 20.0), ((0, 1), 24.0), ((1, 0), 9.0)):
        assert next(found) == key
        onset = (1.0, seconds) if key[0] == 0 else NEVER
        found.take(key, measured(7000.0, onset=onset))
    assert opened.trials[0].value == pytest.approx(-22 - 0.5 * 2)
    assert opened.trials[1].user_attrs["reason"] == "seed 1 never returned 6500"
    assert search.value_of(opened.trials[1], found.task.tuning) is None


def test_killed_between_the_last_seed_and_the_end_of_its_trial(opened: optuna.Study) -> None:
    found = make(opened)
    trial = study.begin(opened, found.task.space.distributions)
    for seed in range(2):
        trial.set_user_attr(f"seed {seed}", noted(50.0))
    again = make(opened)
    assert states(opened) == ["COMPLETE"] and opened.trials[0].value == 50.0
    assert next(again) == (1, 0)


@pytest.mark.parametrize(
    ("between", "within"), [(330, 1135), (401, 1511), (283, 1151)], ids=["dqn", "sac", "pgpe"]
)
def test_what_ends_early_is_mostly_worse(between: float, within: float) -> None:
    """As docs/tuning.md says, with the standard deviations of the committed run.

    The best is that of ten equal settings, and so a lucky one.
    """
    generator = np.random.default_rng(0)
    tuning = params_file.load().tuning
    pruner = WilcoxonPruner(p_threshold=tuning.prune_level)

    def drawn(mean: float, seeds: int = 1) -> NDArray[np.float64]:
        own = generator.normal(mean, between, (seeds, 1))
        return own + generator.normal(0, within, (seeds, tuning.episodes))

    def reports(returns: NDArray[np.float64]) -> dict[int, float]:
        return dict(enumerate(returns.ravel().tolist()))

    def value(returns: NDArray[np.float64]) -> float:
        return search.value(returns.mean(axis=1).tolist(), tuning.spread_penalty)

    def share(less: float) -> float:
        ended = 0
        for _ in range(300):
            shown = optuna.create_study(direction="maximize")
            best = max((drawn(7000, tuning.seeds) for _ in range(10)), key=value)
            shown.add_trial(create_trial(value=value(best), intermediate_values=reports(best)))
            own = reports(drawn(7000 - less))
            running = create_trial(state=TrialState.RUNNING, intermediate_values=own)
            ended += pruner.prune(shown, running)
        return ended / 300

    assert 0.18 < share(0) < 0.32 and share(1600) > 0.85


@pytest.mark.parametrize(
    ("of_seeds", "penalty", "value"),
    [
        ([100.0], 0.5, 100),
        ([100.0, 120.0], 0.0, 110),
        ([100.0, 120.0], 1.0, 100),  # the worse one
        ([0.0, 100.0, 110.0, 500.0], 0.0, 105),  # of four seeds the best and the worst are left out
        ([0.0, 100.0, 110.0, 500.0], 0.2, 105 - 0.2 * (105 + 5 + 5 + 395) / 4),
    ],
)
def test_a_value_is_a_mean_less_a_penalty(
    of_seeds: Sequence[float], penalty: float, value: float
) -> None:
    assert search.value(of_seeds, penalty) == pytest.approx(value)


def job(robot_xml: str, algorithm: str, **settings: Any) -> Job[Any]:
    agent = small_agents.agents()[algorithm]
    env = small_agents.PARAMS.env.model_copy(update={"max_episode_steps": 40})
    own = type(agent).model_validate(agent.model_dump() | settings)
    return Job(World(robot_xml, env), own, objective.SEARCH[0], evaluations=2)


def measure(
    given: Job[Any], target: float | None = None, floors: Sequence[float] = ()
) -> list[Measured | Fault]:
    kernels.use()
    training = objective.validated_apart(small_agents.PARAMS.training)
    starts = objective.SEARCH[:3]
    return list(objective.measure(given, training, starts, target, floors, threading.Event()))


def test_a_training_is_measured_from_its_start_states(robot_xml: str) -> None:
    (found,) = measure(job(robot_xml, "snes"))
    (again,) = measure(job(robot_xml, "snes"), target=0.0)
    assert isinstance(found, Measured) and isinstance(again, Measured)
    assert len(found.returns) == 3 and len(set(found.returns)) == 3
    assert again.returns == found.returns and found.onset == (0.0, float("inf"))
    low, high = again.onset
    assert low == 0.0 < high <= again.seconds, "the first evaluation returned more than nothing"


def test_a_training_ends_below_a_floor(robot_xml: str) -> None:
    (whole,) = measure(job(robot_xml, "snes"), floors=[-np.inf])
    assert isinstance(whole, Measured) and not whole.is_cut and len(whole.bests) == 2
    assert whole.bests[0] <= whole.bests[1]
    (above,) = measure(job(robot_xml, "snes"), floors=whole.bests)
    assert isinstance(above, Measured) and above.returns == whole.returns
    (cut,) = measure(job(robot_xml, "snes"), floors=[whole.bests[0] + 1])
    assert isinstance(cut, Measured) and cut.is_cut and cut.bests == whole.bests[:1]
    assert len(cut.returns) == 3


def test_a_learner_whose_numbers_run_away_is_a_fault(robot_xml: str) -> None:
    wild = job(robot_xml, "snes", stdev_learning_rate=1e6, center_learning_rate=1e6)
    (found,) = measure(wild)
    assert isinstance(found, Fault) and "numbers that are not finite" in found.reason


def test_an_error_of_the_program_is_no_divergence(
    robot_xml: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("DefaultCPUAllocator: can't allocate memory")

    monkeypatch.setattr(objective.rollout, "returns", fail)
    with pytest.raises(RuntimeError, match="can't allocate"):
        measure(job(robot_xml, "snes"))


def test_a_network_whose_numbers_run_away_is_a_fault(robot_xml: str) -> None:
    given = job(robot_xml, "ppo")
    wild = {"learning_rate": 1e30, "final_learning_rate": 1e30}
    (found,) = measure(replace(given, agent=given.agent.model_copy(update=wild)))
    assert isinstance(found, Fault) and "to satisfy the constraint" in found.reason


def test_a_training_that_is_stopped_measures_nothing(robot_xml: str) -> None:
    stop = threading.Event()
    stop.set()
    given = replace(job(robot_xml, "snes"), evaluations=1)
    training = objective.validated_apart(small_agents.PARAMS.training)
    assert list(objective.measure(given, training, objective.SEARCH[:1], None, (), stop)) == []
