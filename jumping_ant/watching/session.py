"""What one open page says to the native simulator, and what it gets to hear.

The messages are those of `jumping_ant/play/worker.js`, which does the same in the page itself.
"""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.experiment.models import Params
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot as robots
from jumping_ant.sim.world import World
from jumping_ant.watching import trained
from jumping_ant.watching.simulation import Json, Simulation

Kind = Literal["edited", "unedited"]  # of robots

MOST_SECONDS = 0.012  # of simulating in a row, so that messages are read
MOST_DEBT = 0.1  # [s] that is made up for; on a slower machine, time passes more slowly


class _Visitor:
    """Who drives a robot with torques that stay until others are chosen."""

    actions = ActionSet()

    def __init__(self, torques: Sequence[float]) -> None:
        self.torques = np.array(torques)

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin an episode."""

    def act(self, observations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the torques, (1, num_motors)."""
        return self.torques[None]


class Session:
    """The robots of one page; a method for each kind of message."""

    def __init__(self, root: Path, params: Params) -> None:
        self._root, self._params = root, params
        self._slots: dict[int, Simulation] = {}
        self._visitor = _Visitor(params.env.commands[0])
        self._levels: dict[str, float] = {}
        self._is_running, self._speed = False, 1.0
        self._debt, self._last = 0.0, time.monotonic()

    def begin(self) -> list[Json]:
        """Return the first message."""
        return [{"kind": "ready", "version": mujoco.mj_versionString()}]

    def hear(self, message: Json) -> list[Json]:
        """Do what a message says, and return answers.

        Raises:
            AttributeError, LookupError, TypeError, ValueError: It is no message of the page, or
                names a policy that is not there.
        """
        return getattr(self, f"_hear_{message.pop('kind')}")(**message) or []

    def tick(self) -> list[Json]:
        """Simulate what time has passed, and return where the robots are."""
        now, passed = time.monotonic(), time.monotonic() - self._last
        self._last = now
        if not self._is_running or not self._slots:
            return []
        most = MOST_DEBT * max(1.0, self._speed)
        self._debt = min(self._debt + self._speed * passed, most)
        step = next(iter(self._slots.values())).model.opt.timestep
        while self._debt >= step and time.monotonic() - now < MOST_SECONDS:
            for own in self._slots.values():
                own.advance()
            self._debt -= step
        return self._show(min(1.0, self._debt / step))

    def _show(self, share: float = 1.0) -> list[Json]:
        """Return where the robots are, `share` of the way from the last step's place."""
        frames = [{"slot": slot} | own.frame() for slot, own in self._slots.items()]
        return [{"kind": "frame", "share": share, "frames": frames}]

    def _hear_place(
        self, slot: int, robot: Kind | None, policy: Json | None, start: Json | None
    ) -> list[Json]:
        """Put a robot into a slot, or with `robot` None none."""
        self._slots.pop(slot, None)
        if robot is None or start is None:
            return []
        self._slots[slot] = self._simulation(robot, policy, start)
        model = self._slots[slot].model
        motors = [model.actuator(index).name for index in range(model.nu)]
        placed = {"kind": "robot", "slot": slot, "geoms": _geoms(model), "motors": motors}
        return [placed, *self._show()]

    def _hear_restart(self) -> list[Json]:
        for slot, own in self._slots.items():
            self._slots[slot] = Simulation(own.world, own.policy, own.start, self._levels)
        self._debt = 0.0
        return self._show()

    def _hear_run(self, running: bool, speed: float) -> None:
        self._is_running, self._speed = running, float(speed)
        self._debt, self._last = 0.0, time.monotonic()

    def _hear_step(self) -> list[Json]:
        """Advance all robots by a control step."""
        for own in self._slots.values():
            own.step()
        self._debt = 0.0
        return self._show()

    def _hear_perturb(self, levels: Mapping[str, float]) -> None:
        self._levels = {name: float(level) for name, level in levels.items()}
        for own in self._slots.values():
            own.perturb(self._levels)

    def _hear_drive(self, torques: Sequence[float]) -> None:
        """Set the torques of robots that the visitor drives."""
        self._visitor.torques = _numbers(torques, len(self._params.env.commands[0]))

    def _hear_pull(self, slot: int, target: Sequence[float] | None) -> None:
        if slot in self._slots:
            self._slots[slot].target = None if target is None else _numbers(target, 3)

    def _hear_push(self, force: Sequence[float]) -> None:
        for own in self._slots.values():
            own.shove(_numbers(force, 3))

    def _hear_outrun(self, robot: Kind, policy: Json, start: Json, steps: int) -> list[Json]:
        """Play an episode of some control steps as fast as it goes, and answer its return."""
        own = self._simulation(robot, policy, start)
        while not own.has_ended and own.num_steps < steps:
            own.step()
        return [{"kind": "answer", "answer": own.total}]

    def _simulation(self, robot: Kind, named: Json | None, start: Json) -> Simulation:
        """Begin an episode of the policy of an agent and a seed, or else of the visitor."""
        policy: Policy = self._visitor
        if named is not None:
            policy = trained.load(self._root, self._params, named["agent"], named["seed"])
        world = World(robots.read(self._root, robot), self._params.env)
        return Simulation(world, policy, start, self._levels)


def _numbers(given: Sequence[float], count: int) -> NDArray[np.float64]:
    numbers = np.array(given, dtype=np.float64)
    if numbers.shape != (count,):
        raise ValueError(f"given {given}, allowed: {count} numbers")
    return numbers


def _geoms(model: mujoco.MjModel) -> list[Json]:
    """Return the shapes of a robot's parts."""
    return [
        {
            "type": int(model.geom_type[i]),
            "size": model.geom_size[i].tolist(),
            "colour": model.geom_rgba[i].tolist(),
            "world": bool(model.geom_bodyid[i] == 0),
        }
        for i in range(model.ngeom)
    ]
