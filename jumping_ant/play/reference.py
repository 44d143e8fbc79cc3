"""What the native simulator does, for the page's modules to be compared with (`verification.js`).

States are rows of positions, velocities and, before a step, the solver's accelerations.
"""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.play.content import start
from jumping_ant.play.policies import array_to_json
from jumping_ant.policies.policy import Policy
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World

Array = NDArray[np.float64]

STEPS = 40  # [simulation steps] over which the largest error is reported
STATES = 1000  # of which each is followed by a control step, and observations
LONGEST = 2000  # [simulation steps] that divergence is looked for


def record(
    world: World,
    policy: Policy,
    robot: str,
    seeds: Sequence[int],
    num_states: int = STATES,
    longest: int = LONGEST,
) -> dict[str, Any]:
    """Return the reference of a policy.

    Args:
        world: The robot and the task.
        policy: The policy.
        robot: The robot's name in the page's content.
        seeds: Of the held-out starts.
        num_states: Number of recorded states and observations, from all episodes.
        longest: Number of simulation steps recorded of each episode.
    """
    played = [_Episode(world, policy, seed, longest) for seed in seeds]
    rows = np.linspace(0, sum(len(own.before) for own in played) - 1, num_states).astype(int)
    observations = np.concatenate([own.observations for own in played])
    chosen = observations[np.arange(num_states) % len(observations)]
    policy.start([seeds[0]])
    return {
        "robot": robot,
        "steps": STEPS,
        "start": seeds[0],
        **{
            name: array_to_json(np.concatenate([getattr(own, name) for own in played])[rows])
            for name in ("before", "after", "controls")
        },
        "rollouts": [
            {
                "start": start(world, seed),
                "states": array_to_json(own.states),
                "torques": array_to_json(own.controls / world.anatomy.control_limits),
            }
            for seed, own in zip(seeds, played, strict=True)
        ],
        "observations": array_to_json(chosen),
        "torques": array_to_json(np.concatenate([policy.act(own[None]) for own in chosen])),
    }


class _Episode:
    """The first simulation steps of an episode of a policy, in the native simulator.

    Attributes:
        before: State before each control step, (T, num_positions + 2 num_velocities).
        controls: The motors' controls in it, (T, num_motors).
        after: State after it, (T, num_positions + num_velocities).
        observations: At each decision, (decisions, num_observations).
        states: After each simulation step, (T * frame_skip, num_positions + num_velocities).
    """

    def __init__(self, world: World, policy: Policy, seed: int, longest: int) -> None:
        task, model = Task(world), world.model
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = (start(world, seed)[name] for name in ("qpos", "qvel"))
        mujoco.mj_forward(model, data)
        policy.start([seed])
        found: dict[str, list[Array]] = {"before": [], "controls": [], "observations": []}
        states = []
        for number in range(longest // world.env.frame_skip):
            if number % policy.actions.hold == 0:
                observation = task.observe(data.qpos[None], data.qvel[None])
                torques = policy.act(observation)[0]
                found["observations"].append(observation[0])
            data.ctrl[:] = torques * world.anatomy.control_limits
            found["before"].append(np.concatenate([data.qpos, data.qvel, data.qacc_warmstart]))
            found["controls"].append(data.ctrl.copy())
            for _ in range(world.env.frame_skip):
                mujoco.mj_step(model, data)
                states.append(np.concatenate([data.qpos, data.qvel]))
            height = world.anatomy.heights(data.qpos[None])[0]
            if height < (world.env.min_torso_height or -np.inf):
                break
        self.before, self.controls, self.observations = (np.array(own) for own in found.values())
        self.states = np.array(states)
        self.after = self.states[world.env.frame_skip - 1 :: world.env.frame_skip]
