# /// script
# requires-python = "==3.11.*"
# dependencies = [
#     "gymnasium[mujoco]==0.28.1",
#     "mujoco==2.3.6",
#     "numpy==1.26.4",
#     "stable-baselines3==2.0.0",
#     "torch==1.13.1",
# ]
# ///
"""Train the article's DQN with its author's own versions of the libraries, and test it as he did.

Usage: uv run --script scripts/article_original.py SEED TESTS

Prints the versions and the total reward of each test as JSON. It knows nothing of this project: it
is the other side of a comparison that says whether the project's own DQN is the article's (see
`scripts.article_runs`, which calls it). What the author left to chance is seeded, and networks are
computed on the processor, although on Linux torch comes with CUDA, several gigabytes.
"""

import argparse
import json
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN

NAMES = ("gymnasium", "mujoco", "numpy", "stable-baselines3", "torch")
TRAINING_STEPS = 1_000_000
TEST_STEPS = 1_000
# What the author changed in Gymnasium's ant.xml, by element: attributes that were set and now are.
EDITS = {
    "default/joint": {"damping": ("1", "0.5")},
    "default/geom": {"density": ("5.0", "3.0"), "friction": ("1 0.5 0.5", "0.6 0.3 0.3")},
    "actuator/motor": {"gear": ("150", "300")},
}
ONES = np.ones(4)
COMMANDS = 0.5 * np.array(
    [
        np.zeros(8),
        np.ones(8),
        -np.ones(8),
        np.concatenate([ONES, -ONES]),
        np.concatenate([-ONES, ONES]),
    ]
)

gym.register(
    "Article-v0", entry_point="gymnasium.envs.mujoco.ant_v4:AntEnv"
)  # without a time limit


def main() -> None:
    """Parse the command line, train, test and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("tests", type=int)
    options = parser.parse_args()
    versions = {name: metadata.version(name) for name in NAMES}
    with ant_file() as path:
        returns = run(path, options.seed, options.tests, TRAINING_STEPS)
    print(json.dumps({"versions": versions, "returns": returns}))


@contextmanager
def ant_file() -> Iterator[str]:
    """Yield the path of the article's robot: Gymnasium's, edited."""
    assets = Path(gym.__file__).parent / "envs" / "mujoco" / "assets"
    tree = ET.parse(assets / "ant.xml")
    for place, attributes in EDITS.items():
        for element in tree.findall(place):
            for name, (before, after) in attributes.items():
                if element.get(name) != before:
                    raise ValueError(f"{place} {name}: given {element.get(name)}, allowed {before}")
                element.set(name, after)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "ant.xml")
        tree.write(path)
        yield path


class Jump(gym.Wrapper):
    """Rewards Gymnasium's Ant-v4 for the height of its torso, and offers five commands."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.action_space = gym.spaces.Discrete(len(COMMANDS))

    def step(self, action: Any) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Apply a command; only a torso below 0.2 m ends an episode."""
        observation, _, _, truncated, info = self.env.step(COMMANDS[int(action)])
        height = float(self.env.unwrapped.data.qpos[2])  # type: ignore[attr-defined]
        reward = 10 * float(np.clip(height - 0.6, 0, 1))
        return observation, reward, height < 0.2, truncated, info


def make_env(path: str) -> Jump:
    """Return the article's environment."""
    return Jump(gym.make("Article-v0", xml_file=path, disable_env_checker=True))


def run(path: str, seed: int, num_tests: int, steps: int, **settings: Any) -> list[float]:
    """Train, and return the total reward of each test.

    Args:
        path: The robot's file.
        seed: Seed of training and tests.
        num_tests: Number of tests of the final model.
        steps: Control steps of training.
        settings: Of DQN, beyond the article's.
    """
    torch.set_num_threads(1)
    env = make_env(path)
    model = DQN(
        "MlpPolicy",
        env,
        learning_rate=0.005,
        exploration_fraction=0.2,
        exploration_final_eps=0.05,
        device="cpu",
        seed=seed,
        **settings,
    )
    model.learn(steps)
    starts, noise = np.random.SeedSequence(seed).generate_state(2)
    np.random.seed(noise)  # of `predict`, which explores
    return [_test(env, model, int(starts) + number) for number in range(num_tests)]


def _test(env: Jump, model: DQN, start: int) -> float:
    """Return the total of the rewards in a test, which goes on where an episode would end."""
    observation, _ = env.reset(seed=start)
    total = 0.0
    for _ in range(TEST_STEPS):
        action, _ = model.predict(observation)
        observation, reward, *_ = env.step(action)
        total += reward
    return total


if __name__ == "__main__":
    main()
