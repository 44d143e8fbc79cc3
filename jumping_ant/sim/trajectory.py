"""One recorded episode: every simulation step's state, every control step's torques and reward."""

import io
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_bytes


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode of T control steps of k = `frame_skip` simulation steps each.

    Attributes:
        qpos: Positions after every simulation step, the start state first, (T * k + 1, 15).
        qvel: Velocities likewise, (T * k + 1, 14).
        ctrl: Torques over peak torques held in each control step, in [-1, 1], (T, 8).
        reward_height: Height reward of each control step, (T,).
        seed: The agent's seed.
        episode: Number of the episode among that seed's.
        episode_return: Sum of its rewards.
        timestep: Duration of a simulation step [s].
        frame_skip: Simulation steps in a control step.

    Raises:
        ValueError: The arrays' shapes do not fit together.
    """

    qpos: NDArray[np.float64]
    qvel: NDArray[np.float64]
    ctrl: NDArray[np.float64]
    reward_height: NDArray[np.float64]
    seed: int
    episode: int
    episode_return: float
    timestep: float
    frame_skip: int

    def __post_init__(self) -> None:
        steps = len(self.ctrl)
        if steps == 0 or self.timestep <= 0 or self.frame_skip < 1:
            raise ValueError(
                f"given {steps} control steps of {self.frame_skip} simulation steps of "
                f"{self.timestep} s; allowed: at least one of each, of a positive duration"
            )
        rows = steps * self.frame_skip + 1
        expected = {
            "qpos": (rows, 15),
            "qvel": (rows, 14),
            "ctrl": (steps, 8),
            "reward_height": (steps,),
        }
        for name, shape in expected.items():
            given = getattr(self, name).shape
            if given != shape:
                raise ValueError(f"{name}: given shape {given}, allowed: {shape}")

    def rows(self, stride: int = 1, seconds: float = np.inf) -> NDArray[np.int64]:
        """Choose states to show: every `stride`-th of the episode's first seconds.

        An episode may end because its state is not finite; such states are left out.

        Args:
            stride: Simulation steps from one chosen state to the next.
            seconds: Duration to show [s]; the whole of a shorter episode.

        Returns:
            Row numbers of `qpos` and `qvel`, beginning with 0.

        Raises:
            InputError: The episode holds no finite state.
        """
        finite = np.isfinite(self.qpos).all(axis=1) & np.isfinite(self.qvel).all(axis=1)
        broken = np.flatnonzero(~finite)
        end = int(broken[0]) if broken.size else len(self.qpos)
        if end == 0:
            raise InputError("trajectory: its first state is not finite: nothing to show")
        last = min(end - 1, int(min(seconds / self.timestep + 1e-6, end)))
        return np.arange(0, last + 1, stride)

    def save(self, path: Path) -> None:
        """Write an `.npz` file, whole or not at all; equal trajectories make equal bytes."""
        buffer = io.BytesIO()
        # Uncompressed: trajectories are noise to a compressor, and its versions differ. NumPy
        # gives every entry the same date.
        np.savez(buffer, allow_pickle=False, **vars(self))
        write_bytes(path, buffer.getvalue())


def load(path: Path) -> Trajectory:
    """Read a trajectory.

    Raises:
        InputError: The file is missing, damaged, or not a trajectory.
    """
    try:
        with np.load(path, allow_pickle=False) as content:
            return Trajectory(
                qpos=content["qpos"].astype(np.float64, copy=False),
                qvel=content["qvel"].astype(np.float64, copy=False),
                ctrl=content["ctrl"].astype(np.float64, copy=False),
                reward_height=content["reward_height"].astype(np.float64, copy=False),
                seed=int(content["seed"]),
                episode=int(content["episode"]),
                episode_return=float(content["episode_return"]),
                timestep=float(content["timestep"]),
                frame_skip=int(content["frame_skip"]),
            )
    # In this order: no file, a truncated archive, an empty file, no such entry, a lone array,
    # and pickled objects or arrays whose shapes do not fit.
    except (OSError, BadZipFile, EOFError, KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"trajectory: cannot read {path}: {reason}") from error
