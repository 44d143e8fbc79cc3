"""Decisions labelled with what a trained policy does, and the file of such demonstrations."""

import json
from dataclasses import dataclass

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.base.archive import Archive, from_array, pack, to_array
from jumping_ant.base.errors import InputError, told
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

FORMAT = 1
_HEADER, _EXPERT = "demonstrations.json", "expert.zip"
_ARRAYS = ("observations.npy", "torques.npy", "returns.npy")


@dataclass(frozen=True)
class Labelled:
    """Decisions in the order of their episodes, with the torques of the expert in each."""

    observations: NDArray[np.float32]  # (n, num_observations)
    torques: NDArray[np.float32]  # of the expert, over peak torques, (n, num_motors)
    returns: NDArray[np.float64]  # of the episode that ends with a decision, (n,); NaN elsewhere

    def __len__(self) -> int:
        return len(self.returns)

    def __getitem__(self, rows: slice) -> "Labelled":
        return Labelled(self.observations[rows], self.torques[rows], self.returns[rows])

    def episodes(self) -> list["Labelled"]:
        """Return the episodes, each complete."""
        ends = np.flatnonzero(~np.isnan(self.returns)) + 1
        starts = [0, *ends[:-1]]
        return [self[start:end] for start, end in zip(starts, ends, strict=True)]


@dataclass(frozen=True)
class Demonstrations:
    """What an expert did, and the expert itself."""

    labelled: Labelled  # complete episodes
    expert: bytes  # content of its policy file

    def to_bytes(self) -> bytes:
        """Return the file's content; equal demonstrations give equal bytes."""
        header = {_HEADER: json.dumps({"format": FORMAT}).encode(), _EXPERT: self.expert}
        arrays = map(from_array, vars(self.labelled).values())
        return pack(header | dict(zip(_ARRAYS, arrays, strict=True)))

    @classmethod
    def from_bytes(cls, content: bytes) -> "Demonstrations":
        """Read a file's content; no code in it is run."""
        try:
            entries = Archive(content)
            if (found := entries.json(_HEADER)["format"]) != FORMAT:
                raise ValueError(f"format {found!r} instead of {FORMAT}")
            labelled = Labelled(*(to_array(entries[name]) for name in _ARRAYS))
            observations, torques, returns = vars(labelled).values()
            if not (observations.ndim == torques.ndim == 2 and returns.ndim == 1):
                raise ValueError("arrays of other dimensions")
            if any(array.dtype.kind != "f" for array in (observations, torques, returns)):
                raise ValueError("arrays of other kinds")
            if not len(observations) == len(torques) == len(returns) > 0:
                raise ValueError("arrays of different lengths, or empty ones")
            if not (np.isfinite(observations).all() and (np.abs(torques) <= 1).all()):
                raise ValueError("numbers that are not finite, or torques above the peak torque")
            if np.isnan(returns[-1]) or np.isinf(returns).any():
                raise ValueError("an episode without a return")
            return cls(labelled, entries[_EXPERT])
        except Exception as error:  # any error here means that the file is damaged
            raise InputError(
                f"demonstrations: given what are none ({told(error)}); "
                "allowed: the file that `dvc repro` makes of a trained agent"
            ) from error


def concatenated(parts: list[Labelled]) -> Labelled:
    """Return all decisions, in order."""
    columns = zip(*(vars(part).values() for part in parts), strict=True)
    return Labelled(*(np.concatenate(column) for column in columns))


def play(
    world: World,
    actor: Policy,
    expert: Policy,
    seeds: list[int],
    episode_steps: int,
    tumbled_starts: float,
    num_threads: int = 1,
) -> Labelled:
    """Run an episode of the actor for each seed, all in parallel, and ask the expert at each step.

    The actor may be the expert itself. Both hold their choices for equally long. Episodes are
    truncated after `episode_steps` control steps; a share of them, `tumbled_starts`, start in the
    air, in any orientation.
    """
    count = len(seeds)
    envs = RobotVectorEnv(
        world,
        count,
        num_threads,
        AutoresetMode.DISABLED,
        ActionSet(hold=actor.actions.hold),
        np.full(count, episode_steps),
        tumbled_starts,
    )
    observations, _ = envs.reset(seed=seeds)
    actor.start(seeds)
    if expert is not actor:
        expert.start(seeds)
    seen, labels = [], []
    totals, lengths = np.zeros(count), np.zeros(count, dtype=np.int64)
    for step in rollout.steps(envs, observations, actor.act):
        label = step.actions if actor is expert else expert.act(step.observations)
        seen.append(step.observations.astype(np.float32))
        labels.append(label.astype(np.float32))
        totals += step.rewards
        lengths += step.alive
    episodes = zip(np.stack(seen, 1), np.stack(labels, 1), lengths, totals, strict=True)
    return concatenated(
        [
            Labelled(each[:length], label[:length], np.append(np.full(length - 1, np.nan), total))
            for each, label, length, total in episodes
        ]
    )
