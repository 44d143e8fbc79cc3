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
from jumping_ant.policies.policy import HEADER, OWNER, Entries, Interface, Policy, interface_of

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


def load(path: Path, owner: Owner | None = None) -> Policy:
    """Read a policy file.

    Args:
        path: The file.
        owner: The agent and the seed that it must be of; None if any will do.

    Raises:
        InputError: The file is missing, not a policy file, or that of another agent or seed.
    """
    try:
        with path.open("rb") as file:
            return parse(file, owner)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; `dvc repro` trains it") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def parse(source: bytes | BinaryIO, owner: Owner | None = None) -> Policy:
    """Read a policy file's content, or an open policy file (see `load`).

    Raises:
        InputError: The content is not a policy file, a damaged one, or that of another agent or
            seed.
    """
    try:
        entries = Archive(source)
        header = json.loads(entries[HEADER])
        interface = interface_of(entries)
        policy: Policy = KINDS[header["kind"]].from_entries(header, entries)
        _check_numbers(list(vars(policy).values()))
        policy.start([0])
        shape = policy.act(np.zeros((1, interface.num_observations or 1))).shape
        stated = _owner(entries)
    except Exception as error:  # any error here means that the file is damaged
        raise InputError(
            f"policy file: given what is not a policy ({told(error)}); "
            "allowed: a policy.zip that `dvc repro` trained"
        ) from error
    if shape != (1, interface.num_motors):
        raise InputError(
            f"policy file: given torques of shape {shape}, allowed: {(1, interface.num_motors)}"
        )
    _check_owner(stated, owner)
    return policy


def read_interface(path: Path, owner: Owner | None = None) -> Interface:
    """Read the inputs and outputs of a policy, without reading the policy (see `load`)."""
    try:
        with path.open("rb") as file:
            entries = Archive(file)
            interface, stated = interface_of(entries), _owner(entries)
    except Exception as error:  # as in `load`
        raise InputError(
            f"{path}: not a policy file ({told(error)}); `dvc repro` trains it"
        ) from error
    try:
        _check_owner(stated, owner)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return interface


def _owner(entries: Entries) -> Owner | None:
    """Read which agent and seed a policy file is of; None if it does not say."""
    if OWNER not in entries:
        return None
    stated = json.loads(entries[OWNER])
    return str(stated["agent"]), int(stated["seed"])


def _check_owner(stated: Owner | None, owner: Owner | None) -> None:
    if owner and stated != owner:
        given = f"that of agent {stated[0]}, seed {stated[1]}" if stated else "one of no agent"
        raise InputError(
            f"policy file: given {given}, allowed: that of agent {owner[0]}, seed {owner[1]}; "
            f"run `dvc repro --force train@{owner[0]}`"
        )


def _check_numbers(value: Any) -> None:
    """Raise ValueError if an array, in lists or tuples too, holds a number that is not finite."""
    if isinstance(value, np.ndarray) and not np.isfinite(value).all():
        raise ValueError("numbers that are not finite")
    if isinstance(value, list | tuple):
        for one in value:
            _check_numbers(one)
