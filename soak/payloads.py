"""Code planted in every kind of file that the project reads, none of which may run."""

import io
import json
import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from jumping_ant.actions import ActionSet
from jumping_ant.base import archive
from jumping_ant.policies import policy_file
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import HEADER, Interface, header_entries
from jumping_ant.sim import trajectory
from jumping_ant.tracking.serving import ServedPolicy
from jumping_ant.training.checkpoints import Checkpoints, Owner, Saved

OWNER = Owner("sac", 0, "key")


@dataclass
class Count:
    """Payloads planted, and those that ran."""

    planted: int = 0
    executed: int = 0


class Payload:
    """An object that creates a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[Callable[[Path], None], tuple[Path]]:
        return Path.touch, (self._path,)


def plant_everywhere(folder: Path) -> Count:
    """Plant a payload in each kind of file, have the project read it, and count.

    Args:
        folder: An empty folder to work in.

    Raises:
        RuntimeError: The payload does not work, so the count would mean nothing.
    """
    mark = folder / "executed"
    pickle.loads(pickle.dumps(Payload(mark)))
    if not mark.exists():
        raise RuntimeError("the payload does not work")
    count = Count()
    for read in _readings(folder, Payload(mark)):
        mark.unlink(missing_ok=True)
        count.planted += 1
        with suppress(Exception):  # refusing it is one way of not running it
            read()
        count.executed += mark.exists()
    return count


def _readings(folder: Path, payload: Payload) -> Iterator[Callable[[], object]]:
    """Yield functions that read a file with a payload in it."""
    for content in _policy_files(payload):
        yield partial(policy_file.parse, content)
        yield partial(_serve, folder, content)
    for saved in _checkpoint_files(payload):
        yield partial(_load_checkpoint, folder, saved)
    for content in _trajectory_files(payload):
        yield partial(_load_trajectory, folder, content)


def _policy_files(payload: Payload) -> Iterator[bytes]:
    saved = io.BytesIO()
    torch.save(payload, saved)
    pickled = pickle.dumps(payload)
    network = header_entries("sac", Interface(ActionSet(), 27, 8))
    linear = dict(archive.Archive(_linear()))
    yield pickled
    yield saved.getvalue()
    yield archive.pack({**network, "policy.pth": pickled})
    yield archive.pack({**network, "policy.pth": saved.getvalue()})
    yield archive.pack({**network, "policy.pth": saved.getvalue(), "data": pickled})
    yield archive.pack({**linear, "weight.npy": pickled})
    yield archive.pack({**linear, "weight.npy": _object_array(payload)})
    yield archive.pack(
        {**archive.Archive(UniformPolicy(0, ActionSet(), 8).to_bytes()), "extra.pkl": pickled}
    )
    yield archive.pack({HEADER: pickled})


def _checkpoint_files(payload: Payload) -> Iterator[bytes]:
    """Yield checkpoints whose digest is right, as an attacker can compute it."""
    saved = Saved(1, 0.0, [], None, "", None, b"", b"")
    pickled = pickle.dumps(payload)
    yield pickled
    yield replace(saved, content=pickled).to_bytes(OWNER)
    values = json.dumps({"learner": {"values": None}}).encode()
    for array in (pickled, _object_array(payload)):
        state = {"values.json": values, "state/learner/values.npy": array}
        yield replace(saved, content=archive.pack(state)).to_bytes(OWNER)


def _trajectory_files(payload: Payload) -> Iterator[bytes]:
    whole = io.BytesIO()
    np.savez(whole, allow_pickle=True, qpos=np.array([payload], dtype=object))
    yield whole.getvalue()
    yield pickle.dumps(payload)


def _object_array(payload: Payload) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.array([payload], dtype=object), allow_pickle=True)
    return buffer.getvalue()


def _linear() -> bytes:
    weight, numbers = np.zeros((8, 27), np.float32), np.zeros(27, np.float32)
    bias = numbers[:8]
    return LinearPolicy(weight, bias, numbers, numbers + 1, weight, bias, ActionSet()).to_bytes()


def _serve(folder: Path, content: bytes) -> None:
    """Read a policy file as a model in MLflow does."""
    path = folder / "policy.zip"
    path.write_bytes(content)
    context = type("Context", (), {"artifacts": {"policy": str(path)}})()
    ServedPolicy().load_context(context)


def _load_checkpoint(folder: Path, content: bytes) -> None:
    """Read a checkpoint as training does."""
    place = folder / ".checkpoints" / OWNER.agent / OWNER.key
    place.mkdir(parents=True, exist_ok=True)
    (place / "seed-0.1.checkpoint").write_bytes(content)
    saved = Checkpoints(folder, OWNER.agent, OWNER.key, print).load(OWNER.seed)
    if saved:
        archive.unpack_state(saved.content)


def _load_trajectory(folder: Path, content: bytes) -> None:
    path = folder / "trajectory.npz"
    path.write_bytes(content)
    trajectory.load(path)
