"""The article's settings and its printed values."""

import inspect
from typing import Any

import pytest
from dvc.utils.hydra import to_hydra_overrides
from evotorch.optimizers import ClipUp
from stable_baselines3 import DQN, SAC

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import article, presets

ROBOT = {
    "source": "ant",
    "density": 3,
    "gear": 300,
    "joint_gear": {},
    "torso_radius": 0.25,
    "leg_length": 1.0,
    "damping": 0.5,
    "friction": [0.6, 0.3, 0.3],
    "contact_margin": 0.005,
    "edits": {},
}
ENV = {
    "frame_skip": 5,
    "reset_noise_scale": 0.1,
    "drop_height": 1.3,  # idle, as no start is tumbled
    "max_episode_steps": 1000,
    "min_torso_height": 0.2,
    "max_torso_height": None,
    "max_tilt": None,
    "commands": [[0] * 8, [1] * 8, [-1] * 8, [1] * 4 + [-1] * 4, [-1] * 4 + [1] * 4],
    "reward.torso_height.weight": 10.0,
    "reward.torso_height.floor": 0.6,
    "reward.torso_height.span": 1.0,
    "reward.forward_velocity": None,
    "reward.alive": None,
    "reward.control_cost": None,
    "reward.upright": None,
}
DQN_SETTINGS = {
    "robot": "edited",
    "actions.kind": "commands",
    "actions.amplitude": 0.5,
    "actions.hold": 1,
    "total_steps": 1_000_000,
    "episode_steps": None,
    "long_episodes": 0,
    "tumbled_starts": 0,
    "sparse_rewards": False,
    "num_envs": 1,
    "learning_rate": 0.005,
    "final_learning_rate": 0.005,
    "buffer_size": 1_000_000,
    "learning_starts": 50_000,
    "batch_size": 32,
    "tau": 1.0,
    "gamma": 0.99,
    "n_steps": 1,
    "train_freq": 4,
    "gradient_steps": 1,
    "target_update_interval": 10_000,
    "exploration_fraction": 0.2,
    "exploration_initial_eps": 1.0,
    "exploration_final_eps": 0.05,
    "max_grad_norm": 10.0,
    "net_arch": [64, 64],
    "velocity_scale": 1.0,
}
SAC_SETTINGS = {
    "robot": "edited",
    "actions.kind": "torques",
    "actions.amplitude": 1.0,
    "actions.hold": 1,
    "total_steps": 100_000,
    "episode_steps": None,
    "long_episodes": 0,
    "tumbled_starts": 0,
    "sparse_rewards": False,
    "num_envs": 1,
    "learning_rate": 0.005,
    "final_learning_rate": 0.005,
    "buffer_size": 1_000_000,
    "learning_starts": 100,
    "batch_size": 256,
    "tau": 0.005,
    "gamma": 0.99,
    "n_steps": 1,
    "train_freq": 1,
    "gradient_steps": 1,
    "ent_coef": 0.005,
    "net_arch": [256, 256],
    "velocity_scale": 1.0,
}
PGPE_SETTINGS = {
    "robot": "edited",
    "actions.kind": "torques",
    "actions.amplitude": 1.0,
    "actions.hold": 1,
    "generations": 100,
    "population_size": 20,
    "episode_steps": 200,
    "center_learning_rate": 0.005,
    "stdev_learning_rate": 0.1,
    "stdev_init": 0.1,
    "max_speed": 0.015,
    "momentum": 0.9,
    "decrease_rewards_by": 1.0,
    "observation_normalization": True,
}
BLOCKS = {
    "robot": ROBOT,
    "env": ENV,
    "agents.dqn": DQN_SETTINGS,
    "agents.sac": SAC_SETTINGS,
    "agents.pgpe": PGPE_SETTINGS,
}
# What says what trains and how often the curve gets a row, on which no result depends.
ASIDE = {"algorithm", "log_interval"}


def flat(block: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a block's values by dotted key."""
    values: dict[str, Any] = {}
    for key, value in block.items():
        nested = isinstance(value, dict) and key not in ("joint_gear", "edits")
        values |= flat(value, f"{prefix}{key}.") if nested else {prefix + key: value}
    return values


def overrides() -> dict[str, Any]:
    """Return what the preset overrides: values by dotted key."""
    words = (PROJECT_ROOT / "presets" / "article").read_text(encoding="utf-8").split()
    return {override.key_or_group: override.value() for override in to_hydra_overrides(words[1::2])}


@pytest.mark.parametrize("name", BLOCKS)
def test_the_preset_sets_every_value_as_the_article_did(name: str) -> None:
    """Whatever params.yaml says: what the preset leaves out is found missing here."""
    own = {
        key.removeprefix(f"{name}."): value
        for key, value in overrides().items()
        if key.startswith(f"{name}.") and not key.endswith("log_interval")
    }
    assert own == BLOCKS[name]


@pytest.mark.parametrize("name", BLOCKS)
def test_the_preset_leaves_no_setting_to_params_yaml(name: str) -> None:
    block: Any = presets.load("article").model_dump()
    for part in name.split("."):
        block = block[part]
    settings = {key: value for key, value in flat(block).items() if key not in ASIDE}
    assert settings == BLOCKS[name]


def test_the_article_trains_eight_seeds_and_tests_the_final_models() -> None:
    given = overrides()
    assert given["seeds"] == [30, 31, 32, 33, 34, 35, 36, 37]
    assert given["training.publish"] == "final"


def test_the_pinned_environment_is_that_of_the_preset() -> None:
    params = presets.load("article")
    assert (params.robot, params.env) == (article.ROBOT, article.ENV)


@pytest.mark.parametrize(
    ("algorithm", "settings", "given"),
    [
        # learning_starts was 50,000 in Stable-Baselines3 2.0.0, and 100 in later versions
        (DQN, DQN_SETTINGS, {"learning_rate", "exploration_fraction", "learning_starts"}),
        (SAC, SAC_SETTINGS, {"learning_rate", "ent_coef"}),
        (ClipUp, PGPE_SETTINGS, {"max_speed"}),
    ],
)
def test_what_the_article_does_not_set_is_the_librarys_default(
    algorithm: Any, settings: dict[str, Any], given: set[str]
) -> None:
    parameters = inspect.signature(algorithm).parameters
    shared = (set(settings) & set(parameters)) - given
    assert len(shared) >= 1
    assert {name: parameters[name].default for name in shared} == {
        name: settings[name] for name in shared
    }


def test_a_preset_that_is_not_there_names_those_that_are() -> None:
    with pytest.raises(InputError, match="preset: given 'artcle', allowed: .*article, .*smoke"):
        presets.load("artcle")
