"""A robot and its task, and what is derived from them."""

from dataclasses import dataclass
from functools import cached_property

import mujoco

from jumping_ant.params.blocks import EnvParams
from jumping_ant.sim import robot
from jumping_ant.sim.anatomy import Anatomy


@dataclass(frozen=True)
class World:
    """A robot and its task; an InputError is raised where they are first used and do not fit."""

    xml: str  # the robot as MJCF
    env: EnvParams

    def __reduce__(self) -> tuple[type["World"], tuple[str, EnvParams]]:
        return World, (self.xml, self.env)  # another process compiles the robot itself

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The compiled robot, which all users share: it must not be changed."""
        return robot.load(self.xml)

    @cached_property
    def anatomy(self) -> Anatomy:
        """The robot's sizes and coordinates."""
        return Anatomy.of(self.model)

    @property
    def dt(self) -> float:
        """Duration of a control step [s]."""
        return float(self.model.opt.timestep) * self.env.frame_skip
