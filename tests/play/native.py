"""What the native simulator does, for the page's modules to be compared with (`verification.js`).

States are rows of positions, velocities and, before a step, the solver's accelerations.
"""

from collections import defaultdict
from typing import Any

import mujoco
import numpy as np

from jumping_ant.play.content import start
from jumping_ant.play.policies import array_to_json
from jumping_ant.policies.policy import Policy
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World

STEPS = 40  # [simulation steps] over which the largest error is reported
STATES = 40  # of which each is followed by a control step, and observations


def record(world: World, policy: Policy, robot: str, seed: int, longest: int) -> dict[str, Any]:
    """Return the reference of a policy: an episode of at most `longest` simulation steps."""
    arrays = {name: np.array(rows) for name, rows in play(world, policy, seed, longest).items()}
    rows = np.linspace(0, len(arrays["before"]) - 1, STATES).astype(int)
    observations = arrays["observations"]
    observations = observations[np.arange(STATES) % len(observations)]
    policy.start([seed])
    rollout = {
        "start": start(world, seed),
        "states": array_to_json(arrays["states"]),
        "torques": array_to_json(arrays["controls"] / world.anatomy.control_limits),
    }
    return {
        "robot": robot,
        "steps": STEPS,
        "start": seed,
        **{name: array_to_json(arrays[name][rows]) for name in ("before", "after", "controls")},
        "rollouts": [rollout],
        "observations": array_to_json(observations),
        "torques": array_to_json(np.concatenate([policy.act(row[None]) for row in observations])),
    }


def play(world: World, policy: Policy, seed: int, longest: int) -> dict[str, list[np.ndarray]]:
    """Return `states` after each simulation step, `observations` at each decision, and of each
    control step the states `before` and `after` it and the motors' `controls`."""
    task, data, skip = Task(world), mujoco.MjData(world.model), world.env.frame_skip
    data.qpos[:], data.qvel[:] = (start(world, seed)[name] for name in ("qpos", "qvel"))
    mujoco.mj_forward(world.model, data)
    policy.start([seed])
    rows: dict[str, list[np.ndarray]] = defaultdict(list)
    for number in range(longest // skip):
        if number % policy.actions.hold == 0:
            observation = task.observe(data.qpos[None], data.qvel[None])
            torques = policy.act(observation)[0]
            rows["observations"].append(observation[0])
        data.ctrl[:] = torques * world.anatomy.control_limits
        rows["before"].append(np.concatenate([data.qpos, data.qvel, data.qacc_warmstart]))
        rows["controls"].append(data.ctrl.copy())
        for _ in range(skip):
            mujoco.mj_step(world.model, data)
            rows["states"].append(np.concatenate([data.qpos, data.qvel]))
        rows["after"].append(rows["states"][-1])
        if world.anatomy.heights(data.qpos[None])[0] < (world.env.min_torso_height or -np.inf):
            break
    return rows
