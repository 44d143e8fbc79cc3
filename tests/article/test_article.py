"""The article's settings."""

from typing import Any

import pytest
from dvc.utils.hydra import to_hydra_overrides

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import article, presets

OFF_POLICY_SETTINGS = {
    "robot": "edited",
    "actions.hold": 1,
    "episode_steps": None,
    "long_episodes": 0,
    "tumbled_starts": 0,
    "sparse_rewards": False,
    "num_envs": 1,
    "learning_rate": 0.005,
    "final_learning_rate": 0.005,
    "buffer_size": 1_000_000,
    "gamma": 0.99,
    "n_steps": 1,
    "gradient_steps": 1,
    "velocity_scale": 1.0,
}
DQN_SETTINGS = OFF_POLICY_SETTINGS | {
    "actions.kind": "commands",
    "actions.amplitude": 0.5,
    "total_steps": 1_000_000,
    "learning_starts": 50_000,
    "batch_size": 32,
    "tau": 1.0,
    "train_freq": 4,
    "target_update_interval": 10_000,
    "exploration_fraction": 0.2,
    "exploration_initial_eps": 1.0,
    "exploration_final_eps": 0.05,
    "max_grad_norm": 10.0,
    "net_arch": [64, 64],
}
SAC_SETTINGS = OFF_POLICY_SETTINGS | {
    "actions.kind": "torques",
    "actions.amplitude": 1.0,
    "total_steps": 100_000,
    "learning_starts": 100,
    "batch_size": 256,
    "tau": 0.005,
    "train_freq": 1,
    "ent_coef": 0.005,
    "net_arch": [256, 256],
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
# What trains, and how often the curve gets a row: no result depends on them.
ASIDE = {"algorithm", "log_interval"}


def flat(block: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a block's values by dotted key."""
    values: dict[str, Any] = {}
    for key, value in block.items():
        nested = isinstance(value, dict) and key not in ("joint_gear", "edits")
        values |= flat(value, f"{prefix}{key}.") if nested else {prefix + key: value}
    return values


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("robot", flat(article.ROBOT.model_dump())),
        ("env", flat(article.ENV.model_dump())),
        ("agents.dqn", DQN_SETTINGS),
        ("agents.sac", SAC_SETTINGS),
        ("agents.pgpe", PGPE_SETTINGS),
    ],
)
def test_the_preset_sets_every_value_as_the_article_did(
    name: str, settings: dict[str, Any]
) -> None:
    """Whatever params.yaml says: it neither lacks a value nor leaves one to params.yaml."""
    words = (PROJECT_ROOT / "presets" / "article").read_text(encoding="utf-8").split()
    overrides = {own.key_or_group: own.value() for own in to_hydra_overrides(words[1::2])}
    assert overrides["seeds"] == [30, 31, 32, 33, 34, 35, 36, 37]
    assert overrides["training.publish"] == "final"
    block: Any = presets.load("article").model_dump()
    for part in name.split("."):
        block = block[part]
    keys = {f"{name}.{key}": value for key, value in settings.items()}
    ours = {key: value for key, value in overrides.items() if key.startswith(f"{name}.")}
    assert {key: ours[key] for key in ours if not key.endswith("log_interval")} == keys
    assert {key: value for key, value in flat(block).items() if key not in ASIDE} == settings


def test_a_preset_that_is_not_there_names_those_that_are() -> None:
    with pytest.raises(InputError, match="preset: given 'artcle', allowed: .*article, .*smoke"):
        presets.load("artcle")
