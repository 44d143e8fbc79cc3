"""Search spaces: what may be chosen, in the terms of the settings and of Optuna."""

import optuna
import pytest
import small_agents

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.ranges import OneOf, whole
from jumping_ant.base import imports
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import presets
from jumping_ant.tuning import space
from jumping_ant.tuning.space import RANGES, RefusedError, Space, space_of

LEARNERS = {name: own for name, own in ALGORITHMS.items() if not own.is_baseline}
FAMILIES = presets.load("families")
AGENTS = {
    name: agent
    for name, agent in FAMILIES.agents.items()  # with those of params.yaml
    if not agent.is_baseline
}


def test_every_learner_has_ranges_of_its_own_settings() -> None:
    assert RANGES.keys() == LEARNERS.keys()
    for name, ranges in RANGES.items():
        assert ranges.keys() <= LEARNERS[name].settings.model_fields.keys(), name


@pytest.mark.parametrize("name", AGENTS)
def test_the_present_settings_lie_within_and_can_be_chosen(name: str) -> None:
    own = space_of(name, AGENTS[name])
    assert own.outside == []
    for key, distribution in own.distributions.items():
        assert distribution._contains(distribution.to_internal_repr(own.own[key])), key
    chosen = own.agent_with(own.own)
    assert own.changes(chosen) == {}, "so rounding must leave them as they are"


@pytest.mark.parametrize("algorithm", RANGES)
def test_every_end_of_every_range_is_a_setting(algorithm: str) -> None:
    """By itself: some settings do not fit each other, and are refused together."""
    agent = next(own for own in AGENTS.values() if own.algorithm == algorithm)
    room = {"total_steps": 10**9, "n_top": 1}.items()
    fitting = agent.model_dump() | {key: own for key, own in room if hasattr(agent, key)}
    for key, own in RANGES[algorithm].items():
        for value in own.values if isinstance(own, OneOf) else (own.low, own.high):
            type(agent).model_validate(fitting | {key: value})


def test_no_training_depends_on_the_ranges() -> None:
    """So that to change one makes no stage stale."""
    stages = sorted((PROJECT_ROOT / "stages").glob("[a-z]*.py"))
    read = {file.name for stage in stages for file in imports.closure(stage)}
    assert "algorithms.py" in read and "ranges.py" not in read


def test_values_are_told_apart() -> None:
    assert [whole(1, 4).has(value) for value in (1, 4, 0, 5, True, "2")] == [True] * 2 + [False] * 4
    assert OneOf(([64],)).has([64]) and not OneOf(([64],)).has([32])


def test_lists_and_rounded_numbers_survive_optuna() -> None:
    assert space.decode(space.encode([128, 128])) == [128, 128]
    assert [space.decode(value) for value in (0.00123456, 7, True, "auto")] == [
        *(0.00123, 7, True, "auto")
    ]


def test_a_share_of_the_budget_is_in_control_steps() -> None:
    sac = space_of("sac", AGENTS["sac"])
    assert sac.agent_with({"gamma": 0.95}, 0.5).max_env_steps == 27_000
    pgpe = space_of("pgpe", AGENTS["pgpe"])
    other = pgpe.agent_with({"population_size": 40, "episode_steps": 100})
    assert other.max_env_steps == AGENTS["pgpe"].max_env_steps
    assert pgpe.changes(other) == {"population_size": 40, "episode_steps": 100}


def test_settings_that_do_not_fit_each_other_are_refused() -> None:
    ars = space_of("ars", AGENTS["ars"])
    with pytest.raises(RefusedError, match="^n_top is 9, but population_size has 5 directions"):
        ars.agent_with({"n_top": 9, "population_size": 10})


@pytest.mark.parametrize("name", AGENTS)
def test_what_is_drawn_fits_each_other(name: str) -> None:
    """With the share of the budget that trials get."""
    own, share = space_of(name, AGENTS[name]), FAMILIES.tuning.share
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for _ in range(20):
        own.agent_with(study.ask(own.distributions).params, share)


def test_own_settings_are_not_rounded() -> None:
    agent = AGENTS["sac"].model_copy(update={"learning_rate": 0.00123456})
    own = Space(agent, RANGES["sac"])
    assert own.chosen(own.own) == {} and own.agent_with(own.own) == agent
    assert own.chosen(own.own | {"tau": 0.0123456}) == {"tau": 0.0123}


def test_settings_outside_of_the_ranges_are_named() -> None:
    agent = AGENTS["sac"].model_copy(update={"gamma": 0.5, "ent_coef": "auto"})
    assert Space(agent, RANGES["sac"]).outside == ["gamma", "ent_coef"]


def test_agents_that_learn_nothing_have_none() -> None:
    with pytest.raises(InputError, match="agent: given 'random', allowed: those of dqn, decqn"):
        space_of("random", small_agents.agents()["random"])
