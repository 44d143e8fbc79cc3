"""Search spaces: what may be chosen, in the terms of the settings and of Optuna."""

import optuna
import pytest

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.ranges import OneOf
from jumping_ant.params import presets
from jumping_ant.tuning import space
from jumping_ant.tuning.space import RANGES, RefusedError, Space, space_of
from jumping_ant.tuning.task import SearchSettings

LEARNERS = {name: own for name, own in ALGORITHMS.items() if not own.is_baseline}
FAMILIES = presets.load("families")  # with the agents of params.yaml
AGENTS = {name: own for name, own in FAMILIES.agents.items() if not own.is_baseline}


def test_every_learner_has_ranges_of_its_settings() -> None:
    assert RANGES.keys() == LEARNERS.keys()
    for name, ranges in RANGES.items():
        assert ranges.keys() <= LEARNERS[name].settings.model_fields.keys(), name


@pytest.mark.parametrize("name", AGENTS)
def test_the_present_settings_and_what_is_drawn_can_be_chosen(name: str) -> None:
    """With the share of the budget that trials get."""
    own = space_of(name, AGENTS[name])
    assert all(range_.has(getattr(own.agent, key)) for key, range_ in own.ranges.items())
    assert own.agent_with(own.present) == own.agent, "so rounding must leave them as they are"
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for _ in range(20):
        trial = study.ask()
        own.suggest(trial)
        own.agent_with(trial.params, SearchSettings().share)


@pytest.mark.parametrize("algorithm", RANGES)
def test_every_end_of_every_range_is_a_setting(algorithm: str) -> None:
    """By itself: some settings do not fit each other, and are refused together."""
    agent = next(own for own in AGENTS.values() if own.algorithm == algorithm)
    room = {"total_steps": 10**9, "n_top": 1}.items()
    fitting = agent.model_dump() | {key: own for key, own in room if hasattr(agent, key)}
    for key, own in RANGES[algorithm].items():
        for value in own.values if isinstance(own, OneOf) else (own.low, own.high):
            type(agent).model_validate(fitting | {key: value})


def test_settings_survive_optuna_and_keep_the_budget() -> None:
    assert space.decode(space.encode([128, 128])) == [128, 128]
    agent = AGENTS["sac"].model_copy(update={"learning_rate": 0.00123456})
    sac, pgpe = Space(agent, RANGES["sac"]), space_of("pgpe", AGENTS["pgpe"])
    assert sac.chosen(sac.present | {"tau": 0.0123456}) == {"tau": 0.0123}, "the present as it is"
    assert sac.agent_with({"gamma": 0.95}, 0.5).max_env_steps == 27_000
    other = pgpe.agent_with({"population_size": 40, "episode_steps": 100})
    assert other.max_env_steps == AGENTS["pgpe"].max_env_steps
    assert pgpe.changes(other) == {"population_size": 40, "episode_steps": 100}
    with pytest.raises(RefusedError, match="^n_top is 9, but population_size has 5 directions"):
        space_of("ars", AGENTS["ars"]).agent_with({"n_top": 9, "population_size": 10})
