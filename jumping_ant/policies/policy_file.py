"""Read policy files of every kind."""

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import InputError, told
from jumping_ant.policies.blind import OpenLoopPolicy, OscillatorPolicy, UniformPolicy
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

OWNER = "owner.json"
Owner = tuple[str, int]  # an agent and a seed

# By what a file's header says: most kinds are named after an algorithm with such a network.
KINDS: dict[str, Any] = {
    "uniform": UniformPolicy,
    "open_loop": OpenLoopPolicy,
    "oscillator": OscillatorPolicy,
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


def owned(content: bytes, owner: Owner) -> bytes:
    """Return a policy file's content with the agent and the seed that it is of."""
    agent, seed = owner
    stated = json.dumps({"agent": agent, "seed": seed}).encode()
    return pack({**Archive(content), OWNER: stated})


def load(path: Path) -> Policy:
    """Read a policy file; one that is missing or damaged is an InputError."""
    return _open(path)[0]


def read_interface(path: Path) -> Interface:
    """Read the inputs and outputs of a policy (see `load`)."""
    return _open(path)[1]


def parse(source: bytes | BinaryIO) -> Policy:
    """Read a policy file's content, or an open policy file; others are an InputError."""
    return _parse(source)[0]


def _open(path: Path) -> tuple[Policy, Interface]:
    try:
        with path.open("rb") as file:
            return _parse(file)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; `dvc repro` trains it") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _parse(source: bytes | BinaryIO) -> tuple[Policy, Interface]:
    try:
        entries = Archive(source)
        interface = interface_of(entries)
        policy: Policy = KINDS[entries.json(HEADER)["kind"]].from_entries(interface, entries)
        policy.start([0])
        shape = policy.act(np.zeros((1, interface.num_observations or 1))).shape
        if shape != (1, interface.num_motors):
            raise ValueError(f"torques of shape {shape} for {interface.num_motors} motors")
    except Exception as error:  # any error here means that the file is damaged
        raise InputError(
            f"policy file: given what is not a policy ({told(error)}); "
            "allowed: a policy.zip that `dvc repro` trained"
        ) from error
    return policy, interface
