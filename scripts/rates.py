"""How fast this machine is: stages as it ran them, and else a second of simulation.

`.cost.json` keeps what stages took here, beside what `scripts.workload` says of them; nothing
leaves the machine. The rate of a stage is the ratio of the two: its own, else that of the stages
most like it.
"""

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from jumping_ant.actions import ActionSet
from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base import machine
from jumping_ant.base.files import PROJECT_ROOT, write_json
from jumping_ant.params import article
from jumping_ant.params.blocks import TorqueParams
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.sim import robot, rollout
from jumping_ant.sim.world import World
from scripts import workload

FILE = ".cost.json"
LEAST_SHARE = 1 / 3  # of a stage's work that is kept: shorter runs say less of longer ones
EPISODES, STEPS, REPEATS = 16, 30, 3


class Took(NamedTuple):
    """What a stage took, and what `scripts.workload` says of it [s, core-seconds]."""

    algorithm: str  # of its agent, or none
    seconds: float
    core_seconds: float
    modelled: float
    modelled_core: float


class Rates:
    """Ratios of what stages take here to what `scripts.workload` says of them."""

    def __init__(self, root: Path = PROJECT_ROOT) -> None:
        self._path = project_of(root) / FILE
        self._took: dict[str, Took] = {}
        with suppress(OSError, ValueError, TypeError, KeyError):  # none yet, or damaged
            content = json.loads(self._path.read_text(encoding="utf-8"))
            if content["machine"] == _machine():
                self._took = {name: Took(*took) for name, took in content["stages"].items()}
        self.speed = 1.0 if self._took else step_seconds(ant()) / workload.STEP

    def __bool__(self) -> bool:
        return bool(self._took)

    def of(self, stage: str, algorithm: str) -> tuple[float, float, bool]:
        """Return a stage's ratios of seconds and core-seconds, and whether they are its own."""
        own = _likeness(stage, algorithm)
        for number, level in enumerate(own):
            like = [
                took
                for name, took in self._took.items()
                if _likeness(name, took.algorithm)[number] == level
            ]
            if like:
                _, seconds, core_seconds, modelled, modelled_core = zip(*like, strict=True)
                ratios = sum(seconds) / sum(modelled), sum(core_seconds) / sum(modelled_core)
                return *ratios, number == 0
        return self.speed, self.speed, False

    def keep(self, took: Mapping[str, Took]) -> None:
        """Keep what stages took, but for those that had far less to do than before."""
        for name, one in took.items():
            before = self._took.get(name)
            if not before or one.modelled >= LEAST_SHARE * before.modelled:
                self._took[name] = one
        write_json(self._path, {"machine": _machine(), "stages": self._took})


def _likeness(stage: str, algorithm: str) -> tuple[Any, ...]:
    """Return what a stage may have in common with others: the most telling first."""
    kind = stage.partition("@")[0]
    package = ALGORITHMS[algorithm].package if algorithm in ALGORITHMS else ""
    return stage, (kind, algorithm), (kind, package), kind, None


def _machine() -> list[Any]:
    return [machine.processor(), machine.num_cores()]


def project_of(root: Path) -> Path:
    """Return the project's folder, also from the copy of a preset."""
    return root.parents[1] if root.parent.name == ".presets" else root


def ant() -> World:
    """Return the Ant of `workload.STEP`."""
    return World(robot.build(article.ROBOT), article.ENV)


def step_seconds(world: World) -> float:
    """Return the CPU seconds of a control step on one core, in a few short episodes."""
    short = World(world.xml, world.env.model_copy(update={"max_episode_steps": STEPS}))
    torques = TorqueParams(kind="torques", amplitude=1.0, hold=1)
    actions = ActionSet.of(torques, world.env.commands)
    policy = UniformPolicy(0, actions, world.anatomy.num_motors)
    found = []
    for _ in range(REPEATS):
        started = time.process_time()
        episodes = rollout.run(short, policy, range(EPISODES))
        found.append((time.process_time() - started) / sum(len(one.rewards) for one in episodes))
    return min(found)
