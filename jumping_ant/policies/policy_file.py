"""Read policy files of every kind."""

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from jumping_ant.base.archive import Archive
from jumping_ant.base.errors import InputError
from jumping_ant.policies.blind import OpenLoopPolicy, UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.networks import (
    ActorCritic,
    GaussianActor,
    GreedyCommands,
    NormalizedActor,
    QuantileCommands,
    TanhActor,
)
from jumping_ant.policies.policy import HEADER, Interface, Policy, interface_of

KINDS: dict[str, Any] = {
    "uniform": UniformPolicy,
    "open_loop": OpenLoopPolicy,
    "linear": LinearPolicy,
    "sac": GaussianActor,
    "td3": TanhActor,
    "qrdqn": QuantileCommands,
    "tqc": GaussianActor,
    "crossq": NormalizedActor,
    "ddpg": TanhActor,
    "bc": TanhActor,
    "dagger": TanhActor,
    "a2c": ActorCritic,
    "ppo": ActorCritic,
    "dqn": GreedyCommands,
}


def load(path: Path) -> Policy:
    """Read a policy file.

    Raises:
        InputError: The file is missing or not a policy file.
    """
    try:
        with path.open("rb") as file:
            return parse(file)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; `dvc repro` trains it") from error


def parse(source: bytes | BinaryIO) -> Policy:
    """Read a policy file's content, or an open policy file.

    Raises:
        InputError: The content is not a policy file, or a damaged one.
    """
    try:
        entries = Archive(source)
        header = json.loads(entries[HEADER])
        interface = interface_of(entries)
        policy: Policy = KINDS[header["kind"]].from_entries(header, entries)
        _check_numbers(list(vars(policy).values()))
        policy.start([0])
        shape = policy.act(np.zeros((1, interface.num_observations or 1))).shape
    except Exception as error:  # any error here means that the file is damaged
        raise InputError(
            f"policy file: given what is not a policy ({type(error).__name__}: {error}); "
            "allowed: a policy.zip that `dvc repro` trained"
        ) from error
    if shape != (1, interface.num_motors):
        raise InputError(
            f"policy file: given torques of shape {shape}, allowed: {(1, interface.num_motors)}"
        )
    return policy


def read_interface(path: Path) -> Interface:
    """Read the inputs and outputs of a policy, without reading the policy.

    Raises:
        InputError: The file is missing or not a policy file.
    """
    try:
        with path.open("rb") as file:
            return interface_of(Archive(file))
    except Exception as error:  # as in `load`
        raise InputError(f"{path}: not a policy file ({error}); `dvc repro` trains it") from error


def _check_numbers(value: Any) -> None:
    """Raise ValueError if an array, in lists or tuples too, holds a number that is not finite."""
    if isinstance(value, np.ndarray) and not np.isfinite(value).all():
        raise ValueError("numbers that are not finite")
    if isinstance(value, list | tuple):
        for one in value:
            _check_numbers(one)
