"""One recorded episode: every simulation step's state, every control step's torques and reward."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.archive import Archive, from_array, pack, to_array
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import content
from jumping_ant.sim.mjcf import TIMESTEPS
from jumping_ant.sim.rewards import PREFIX, TERMS

LEAST, MOST = TIMESTEPS


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode of T control steps of k = `frame_skip` simulation steps each."""

    qpos: NDArray[np.float64]  # after every simulation step, the start state first, (T * k + 1, nq)
    qvel: NDArray[np.float64]  # likewise, (T * k + 1, nv)
    torques: NDArray[np.float64]  # over peak torques, held in each control step, (T, num_motors)
    rewards: NDArray[np.float64]  # (T,)
    terms: dict[str, NDArray[np.float64]]  # contribution of each term to the reward, (T,) each
    agent: str
    seed: int  # of the agent
    episode: int  # its number among those of the seed
    episode_return: float
    timestep: float  # of the simulation [s]
    frame_skip: int

    def __post_init__(self) -> None:
        steps = len(self.torques)
        if steps == 0 or not LEAST <= self.timestep <= MOST or self.frame_skip < 1:
            raise ValueError(
                f"given {steps} control steps of {self.frame_skip} simulation steps of "
                f"{self.timestep} s; allowed: at least one of each, of a positive duration"
            )
        rows = steps * self.frame_skip + 1
        for name, length in {"qpos": rows, "qvel": rows, "torques": steps}.items():
            shape = getattr(self, name).shape
            if len(shape) != 2 or shape[0] != length or shape[1] == 0:
                raise ValueError(f"{name}: given shape {shape}, allowed: {length} rows")
        for name, values in {"rewards": self.rewards, **self.terms}.items():
            if values.shape != (steps,):
                raise ValueError(f"{name}: given shape {values.shape}, allowed: {(steps,)}")

    def check(self, model: mujoco.MjModel) -> None:
        """Raise an InputError unless the trajectory fits a robot."""
        given = self.qpos.shape[1], self.qvel.shape[1], self.torques.shape[1]
        if given != (model.nq, model.nv, model.nu):
            raise InputError(
                "trajectory: given states of {} positions and {} velocities and {} torques, "
                "allowed: the robot's {}, {} and {}; it is of another robot; run `dvc repro` "
                "to evaluate this one".format(*given, model.nq, model.nv, model.nu)
            )
        if self.timestep != model.opt.timestep:
            raise InputError(
                f"trajectory: given a time step of {self.timestep:g} s, allowed: the robot's "
                f"{model.opt.timestep:g} s; run `dvc repro` to evaluate this one"
            )

    def rows(self, stride: int = 1, seconds: float = np.inf) -> NDArray[np.int64]:
        """Return every `stride`-th row of these seconds, before any state that is not finite."""
        finite = np.isfinite(self.qpos).all(axis=1) & np.isfinite(self.qvel).all(axis=1)
        broken = np.flatnonzero(~finite)
        end = int(broken[0]) if broken.size else len(self.qpos)
        if end == 0:
            raise InputError("trajectory: its first state is not finite: nothing to show")
        last = min(end - 1, int(min(seconds / self.timestep + 1e-6, end)))
        return np.arange(0, last + 1, stride)

    def to_bytes(self) -> bytes:
        """Return the content of an `.npz` file; equal trajectories give equal bytes."""
        terms = {PREFIX + name: values for name, values in self.terms.items()}
        fields = {name: value for name, value in vars(self).items() if name != "terms"}
        # Uncompressed: trajectories hardly compress, and the bytes would depend on the compressor's
        # version. NumPy's own archives depend on Python's.
        return pack({f"{name}.npy": from_array(value) for name, value in (fields | terms).items()})


def frame_stride(timestep: float, fps: int) -> int:
    """Return the number of simulation steps from one frame to the next."""
    rate = round(1 / timestep)
    if fps > rate or rate % fps:
        divisors = [str(number) for number in range(1, rate + 1) if rate % number == 0]
        raise InputError(
            f"record.fps: given {fps}, allowed: the divisors of the simulation's {rate} Hz: "
            f"{', '.join(divisors)}"
        )
    return rate // fps


def load(path: Path) -> Trajectory:
    """Read a trajectory; anything wrong with it is an InputError."""
    try:
        archive = Archive(content(path))
        values = {name.removesuffix(".npy"): to_array(archive[name]) for name in archive}
        kinds: dict[str, Any] = {field.name: field.type for field in fields(Trajectory)}
        scalars = [name for name, kind in kinds.items() if kind in (str, int, float)]
        given: dict[str, Any] = {name: _scalar(name, values.pop(name), kinds) for name in scalars}
        for name, array in values.items():
            if array.dtype != np.float64:
                raise ValueError(f"{name}: given numbers of {array.dtype}, allowed: float64")
        terms = {name: values.pop(PREFIX + name) for name in TERMS if PREFIX + name in values}
        given |= values
        return Trajectory(**given, terms=terms)
    except Exception as error:  # the file is missing or damaged
        reason = " ".join(str(error).split())
        raise InputError(f"trajectory: cannot read {path}: {reason}") from error


def _scalar(name: str, value: NDArray[Any], kinds: dict[str, Any]) -> Any:
    """Return a single text, whole number or number, of the kind that it must be."""
    kind = kinds[name]
    if value.shape or value.dtype.kind not in {str: "U", int: "iu", float: "f"}[kind]:
        given = f"{value.dtype} of shape {value.shape}"
        raise ValueError(f"{name}: given {given}, allowed: {kind.__name__}")
    return kind(value)
