"""Episodes under a perturbation, kept state by state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.experiment.models import Params
from jumping_ant.policies.policy import Policy
from jumping_ant.robustness.perturbations import Condition
from jumping_ant.robustness.perturbed import PerturbedVectorEnv
from jumping_ant.sim import rollout
from jumping_ant.sim.rewards import PREFIX, active
from jumping_ant.sim.rollout import SideBySide
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World


class RecordedVectorEnv(PerturbedVectorEnv):
    """One perturbed environment that keeps the state after every simulation step.

    Attributes:
        states: Positions and velocities, the start state first.
    """

    def __init__(self, world: World, condition: Condition, start: int) -> None:
        super().__init__(world, [(condition, start)])
        self.states: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []

    @property
    def substeps(self) -> int:
        """Simulation steps per control step."""
        return int(self._num_substeps[0])

    def keep(self) -> None:
        """Keep the present state."""
        self.states.append((self.qpos[0].copy(), self.qvel[0].copy()))

    def _simulate(self, running: NDArray[np.int64] | None) -> None:
        for _ in range(self.substeps):
            self.batch.step()
            self.keep()


def check_film(params: Params, seconds: float) -> None:
    """Raise an InputError if other time steps are filmed that give no whole number a frame.

    Args:
        params: All parameters.
        seconds: Of a control step [s].
    """
    fps, steps = params.record.fps, params.robustness.perturbations.integration
    if params.robustness.filmed == "integration" and any(
        round(own / seconds) % fps for own in steps
    ):
        raise InputError(
            f"robustness.filmed: given integration, of {', '.join(f'{own:g}' for own in steps)} "
            f"steps per {seconds:g} s, allowed: steps of which each frame has a whole number at "
            f"record.fps, {fps}; or another perturbation, or null"
        )


@dataclass(frozen=True)
class Player:
    """Who plays: an agent's policy of a seed."""

    agent: str
    seed: int
    policy: Policy


def play(
    world: World, episode_steps: int, player: Player, condition: Condition, start: int
) -> Trajectory:
    """Play an episode as `playing.returns` does, and keep it; its torques are those that acted.

    Args:
        world: The robot and the task.
        episode_steps: Length of the episode [control steps].
        player: Who plays.
        condition: The perturbation and its level.
        start: Seed of the start state.
    """
    short = world.env.model_copy(update={"max_episode_steps": episode_steps})
    envs = RecordedVectorEnv(World(world.xml, short), condition, start)
    alone = SideBySide([(player.policy, start)])
    observations = envs.begin()
    envs.keep()
    torques, rewards = [], []
    terms: dict[str, list[float]] = {name: [] for name in active(world.env.reward)}
    controls = envs.batch.bind("ctrl")
    for step in rollout.steps(envs, observations, alone.act, alone.hold):
        torques.append(controls[0] / world.anatomy.control_limits)
        rewards.append(float(step.rewards[0]))
        for name, values in terms.items():
            values.append(float(step.infos[PREFIX + name][0]))
    qpos, qvel = map(np.array, zip(*envs.states, strict=True))
    return Trajectory(
        qpos=qpos,
        qvel=qvel,
        torques=np.array(torques),
        rewards=np.array(rewards),
        terms={name: np.array(values) for name, values in terms.items()},
        agent=player.agent,
        seed=player.seed,
        episode=0,
        episode_return=sum(rewards),
        timestep=envs.dt / envs.substeps,
        frame_skip=envs.substeps,
    )
