"""The interface of policies, and the header of policy files.

A policy file is a zip archive. Its entry `policy.json` says which kind of policy it is; the arrays
are stored next to it, as `.npy` entries or, for agents of Stable-Baselines3, in the entries that
Stable-Baselines3 itself writes (so that `SAC.load` and `DQN.load` read the same file). Only numbers
are read from it: the structure comes from this package's classes. Equal policies give equal bytes.
Once it is published, `owner.json` says whose it is: the agent and the seed.

A policy decides every `hold` control steps; its torques are held in between. The code that
steps the simulation handles this.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from jumping_ant.base.archive import from_array, pack, to_array
from jumping_ant.policies.actions import ActionSet

FORMAT = 3
HEADER = "policy.json"
_TABLE = "commands.npy"

Array = NDArray[np.float64]
Size = Annotated[int, Field(ge=1, le=100_000)]
Entries = Mapping[str, bytes]


class Policy(Protocol):
    """The policy of any agent, regardless of what trained it."""

    @property
    def actions(self) -> ActionSet:
        """The set of actions to choose from, and how many control steps a choice is held."""

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; row `i` of later observations belongs to seed `i`."""

    def act(self, observations: Array) -> Array:
        """Return torques in [-1, 1], (n, num_motors), for observations (n, num_observations).

        A row's torques depend on its observation, not on the rows beside it. A matrix product of n
        rows rounds by n and by the place of a row, so policies multiply row by row.
        """


class Stateless:
    """What policies share whose torques depend on the observation alone."""

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""


@dataclass(frozen=True)
class Interface:
    """The inputs and outputs of a policy, as its file's header states them."""

    actions: ActionSet
    num_observations: int | None  # None if the policy ignores them
    num_motors: int


class _Header(BaseModel):
    model_config = ConfigDict(strict=True)

    format: Literal[3]
    hold: Annotated[int, Field(ge=1, le=10**6)]
    amplitude: Annotated[float, Field(gt=0, le=1)]
    num_observations: Size | None
    num_motors: Size
    levels: Annotated[int, Field(ge=2, le=100_000)] | None = None


def to_file(
    kind: str, interface: Interface, arrays: Mapping[str, Any] | None = None, **fields: int
) -> bytes:
    """Return the content of the file of a policy that is arrays by name, and fields of its own."""
    entries = {f"{name}.npy": from_array(array) for name, array in (arrays or {}).items()}
    return pack(header_entries(kind, interface, **fields) | entries)


def header_entries(kind: str, interface: Interface, **fields: int) -> dict[str, bytes]:
    """Return the header of a policy file, and the table of commands if there is one."""
    actions = interface.actions
    header = {
        "format": FORMAT,
        "kind": kind,
        "hold": actions.hold,
        "amplitude": actions.amplitude,
        "num_observations": interface.num_observations,
        "num_motors": interface.num_motors,
        **({} if actions.levels is None else {"levels": actions.levels}),
        **fields,
    }
    entries = {HEADER: json.dumps(header).encode()}
    return entries if actions.table is None else entries | {_TABLE: from_array(actions.table)}


def interface_of(entries: Entries) -> Interface:
    """Read the inputs and outputs of a policy from a policy file's entries."""
    header = _Header.model_validate_json(entries[HEADER])
    table = to_array(entries[_TABLE]) if _TABLE in entries else None
    if table is not None:
        is_within = table.ndim == 2 and table.size and (np.abs(table) <= 1).all()  # NaN is not
        if not is_within or header.levels:
            raise ValueError(f"a table of commands of shape {table.shape}, or beyond peak torques")
    actions = ActionSet(table, header.amplitude, header.hold, header.levels)
    return Interface(actions, header.num_observations, header.num_motors)


def arrays_of(entries: Entries, **shapes: tuple[int | None, ...]) -> dict[str, NDArray[Any]]:
    """Read arrays of these shapes from a policy file's entries."""
    arrays = {name: to_array(entries[f"{name}.npy"]) for name in shapes}
    for name, array in arrays.items():
        if array.shape != shapes[name] or not np.isfinite(array).all():
            raise ValueError(f"{name}: given shape {array.shape}, allowed: {shapes[name]}, finite")
    return arrays
