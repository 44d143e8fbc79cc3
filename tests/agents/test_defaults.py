"""A block that leaves out what has a default is the library's algorithm."""

import inspect
from pkgutil import resolve_name
from typing import Any

import pytest
import small_agents
from evotorch.algorithms import CMAES
from evotorch.optimizers import ClipUp
from sb3_contrib import ARS

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim.env import RobotEnv, article_world

SB3 = [*small_agents.of_package("off_policy"), *small_agents.of_package("on_policy")]


def defaults_of(constructor: Any) -> dict[str, Any]:
    """Return the defaults of parameters; None stands for several, or for what is off."""
    parameters = inspect.signature(constructor).parameters.values()
    found = {each.name: each.default for each in parameters if each.default is not each.empty}
    return {name: value for name, value in found.items() if value is not None}


def own_defaults(name: str) -> dict[str, Any]:
    fields = ALGORITHMS[name].settings.model_fields
    return {key: field.default for key, field in fields.items() if not field.is_required()}


@pytest.mark.parametrize("name", SB3)
def test_settings_have_the_defaults_of_stable_baselines3(name: str) -> None:
    learner, own = resolve_name(ALGORITHMS[name].learner), own_defaults(name)
    theirs = defaults_of(learner.policy_aliases["MlpPolicy"]) | defaults_of(learner)
    shared = own.keys() & theirs.keys()
    assert len(shared) > 5
    assert {key: own[key] for key in shared} == {key: theirs[key] for key in shared}


@pytest.mark.filterwarnings("ignore:.n_steps=")
@pytest.mark.parametrize("name", SB3)
def test_networks_have_the_sizes_of_stable_baselines3(name: str) -> None:
    learner, settings = resolve_name(ALGORITHMS[name].learner), small_agents.agents()[name]
    robot: Any = {
        "commands": "CartPole-v1",
        "torques": "Pendulum-v1",
        "levels": RobotEnv(article_world(), actions=ActionSet(levels=2)),
    }[settings.actions.kind]  # type: ignore[attr-defined]
    replay = {"buffer_size": 10} if "buffer_size" in own_defaults(name) else {}
    sizes = learner("MlpPolicy", robot, **replay).policy.net_arch
    actors = sizes["pi"] if isinstance(sizes, dict) else sizes  # ours are those of all networks
    assert own_defaults(name)["net_arch"] == actors


@pytest.mark.parametrize(
    ("name", "library", "shared"),
    [
        ("pgpe", ClipUp, {"momentum"}),
        ("cmaes", CMAES, {"separable"}),
        ("ars", ARS, {"learning_rate", "delta_std"}),
    ],
)
def test_searchers_have_the_defaults_of_their_library(
    name: str, library: Any, shared: set[str]
) -> None:
    own, theirs = own_defaults(name), defaults_of(library)
    assert {key: own[key] for key in shared} == {key: theirs[key] for key in shared}


@pytest.mark.parametrize("name", ALGORITHMS)
def test_defaults_are_allowed(name: str) -> None:
    """Pydantic does not check them."""
    settings = ALGORITHMS[name].settings
    block = next(agent for agent in small_agents.PARAMS.agents.values() if agent.algorithm == name)
    least = settings.model_validate(block.model_dump(exclude=set(own_defaults(name))))
    assert settings.model_validate(least.model_dump()) == least
