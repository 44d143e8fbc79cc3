"""Policies as plain JSON, which any page or program can read (docs/live-page.md describes it)."""

import base64
import hashlib
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.archive import Archive, to_array
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import (
    OpenLoopPolicy,
    OscillatorPolicy,
    Oscillators,
    UniformPolicy,
)
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.networks import ActorCritic, GreedyCommands, Network, TanhActor
from jumping_ant.policies.policy import Policy

FORMAT = 1

Arrays = dict[str, NDArray[Any]]
Body = tuple[dict[str, Any], Arrays]  # the policy's own keys, and its numbers


def to_json(policy: Policy) -> dict[str, Any]:
    """Return a policy as JSON values.

    `sha256` is the digest of its numbers: of the arrays' bytes, one after the other.

    Raises:
        TypeError: There is no form for such a policy.
    """
    keys, arrays = _body(policy)
    if policy.actions.table is not None:
        arrays |= {"commands": policy.actions.table}
    total = hashlib.sha256()
    for array in arrays.values():
        total.update(_bytes(array))
    return {
        "format": FORMAT,
        **keys,
        "actions": _actions(policy.actions),
        "arrays": {name: array_to_json(array) for name, array in arrays.items()},
        "sha256": total.hexdigest(),
    }


def _actions(actions: ActionSet) -> dict[str, Any]:
    kind = "torques" if actions.chooses_torques else "levels" if actions.levels else "commands"
    own = {"kind": kind, "amplitude": actions.amplitude, "hold": actions.hold}
    return own if actions.levels is None else own | {"levels": actions.levels}


def array_to_json(array: NDArray[Any]) -> dict[str, Any]:
    """Return an array as JSON values: its shape, and its numbers' bytes as Base64."""
    kind = "float32" if array.dtype == np.float32 else "float64"
    return {"shape": list(array.shape), kind: base64.b64encode(_bytes(array)).decode()}


def _bytes(array: NDArray[Any]) -> bytes:
    """Return numbers row by row, each with its lowest byte first."""
    return np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()


@singledispatch
def _body(policy: Any) -> Body:
    raise TypeError(f"given a {type(policy).__name__}, allowed: a policy of `policy_file`")


@_body.register
def _linear(policy: LinearPolicy) -> Body:
    arrays = {"subtract": policy.mean, "divide": policy.stdev}
    layer = {"weight_0": policy.weight, "bias_0": policy.bias}
    return {"kind": "network", "hidden": "none", "output": "nearest"}, arrays | layer


def _network(policy: Network, hidden: str, output: str) -> Body:
    layers = {
        f"{name}_{number}": array
        for number, layer in enumerate(policy.layers)
        for name, array in zip(("weight", "bias"), layer, strict=True)
    }
    keys = {"kind": "network", "hidden": hidden, "output": output}
    return keys, {"multiply": policy.factors} | layers


@_body.register
def _tanh_actor(policy: TanhActor) -> Body:
    return _network(policy, "relu", "tanh")


@_body.register
def _greedy(policy: GreedyCommands) -> Body:
    return _network(policy, "relu", "best")


@_body.register
def _actor_critic(policy: ActorCritic) -> Body:
    return _network(policy, "tanh", "nearest" if policy.actions.chooses_torques else "best")


@_body.register
def _uniform(policy: UniformPolicy) -> Body:
    return {"kind": "uniform", "noise_seed": policy.seed}, {}


@_body.register
def _open_loop(policy: OpenLoopPolicy) -> Body:
    return {"kind": "cycle"}, {}


@_body.register
def _oscillators(policy: OscillatorPolicy) -> Body:
    entries = Archive(policy.to_bytes())
    return {"kind": "oscillators"}, {
        name: to_array(entries[f"{name}.npy"]) for name in Oscillators.ARRAYS
    }
