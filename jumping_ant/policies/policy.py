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
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.archive import from_array, to_array
from jumping_ant.policies.actions import ActionSet

FORMAT = 3
HEADER = "policy.json"
OWNER = "owner.json"
LARGEST = 100_000  # observations, or motors, of a policy that is read
_TABLE = "commands.npy"

Array = NDArray[np.float64]
Header = Mapping[str, Any]
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
    header = json.loads(entries[HEADER])
    if header["format"] != FORMAT:
        raise ValueError(f"format {header['format']!r} instead of {FORMAT}")
    observations, motors = header["num_observations"], int(header["num_motors"])
    observations = None if observations is None else int(observations)
    for number in (observations, motors):
        if number is not None and not 0 < number <= LARGEST:
            raise ValueError(f"{number} observations or motors")
    return Interface(action_set(header, entries), observations, motors)


def action_set(header: Header, entries: Entries) -> ActionSet:
    """Read an action set from a policy file's entries."""
    table = to_array(entries[_TABLE]) if _TABLE in entries else None
    if table is not None and (table.ndim != 2 or not table.size):
        raise ValueError(f"a table of commands of shape {table.shape}")
    if table is not None and not (np.abs(table) <= 1).all():  # NaN fails this too
        raise ValueError("a table of commands above the peak torque")
    hold, amplitude = int(header["hold"]), float(header["amplitude"])
    if hold < 1:
        raise ValueError(f"actions held for {hold} control steps")
    if not 0 < amplitude <= 1:
        raise ValueError(f"torques of {amplitude} times the peak torque")
    levels = int(header["levels"]) if "levels" in header else None
    if levels is not None and (table is not None or not 2 <= levels <= LARGEST):
        raise ValueError(f"{levels} levels of each motor")
    return ActionSet(table, amplitude, hold, levels)
