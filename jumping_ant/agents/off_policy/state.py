"""All that a training of DQN or SAC resumes from: the state of the model and of its world.

Networks, optimisers, replay memory, counters, simulations, and every generator of random numbers
that is drawn from.
"""

from typing import Any, cast

import numpy as np
import torch

from jumping_ant.agents.off_policy.learners import LeanDQN, LeanSAC
from jumping_ant.agents.off_policy.vec_env import SB3VecEnv
from jumping_ant.base.archive import pack_state, unpack_state

# Numbers that Stable-Baselines3's loop keeps.
COUNTERS = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
DQN_COUNTERS = ("_n_calls", "exploration_rate")


def capture(model: LeanDQN | LeanSAC, own: Any) -> bytes:
    """Return the state of a model that is between two rounds of `learn`.

    Args:
        model: The model; its environments are a `SB3VecEnv`.
        own: What its trainer keeps beside it, as JSON can express it.
    """
    return pack_state(
        {
            "learner": {name: vector.numpy() for name, vector in model.vectors.items()},
            "replay": model.replay_buffer.save_state(),
            "envs": cast(SB3VecEnv, model.env).save_state(),
            "last_obs": model._last_obs,
            "counters": {name: getattr(model, name) for name in _counters(model)},
            "logged": {key: float(value) for key, value in model.logger.name_to_value.items()},
            "actions": model.action_space.np_random.bit_generator.state,
            "numpy": np.random.get_state(legacy=False),
            "torch": torch.get_rng_state().numpy(),
            "own": own,
        }
    )


def restore(model: LeanDQN | LeanSAC, content: bytes) -> Any:
    """Put a fresh model into a captured state.

    Args:
        model: Made with the same parameters, and set up to learn.
        content: What `capture` returned.

    Returns:
        What its trainer kept beside it.
    """
    state = unpack_state(content)
    for name, vector in model.vectors.items():
        vector.copy_(torch.from_numpy(state["learner"][name]))
    model.replay_buffer.load_state(state["replay"])
    cast(SB3VecEnv, model.env).load_state(state["envs"])
    model._last_obs = state["last_obs"]
    for name, value in state["counters"].items():
        setattr(model, name, value)
    for key, value in state["logged"].items():
        model.logger.record(key, value)
    model.action_space.np_random.bit_generator.state = state["actions"]
    np.random.set_state(state["numpy"])
    torch.set_rng_state(torch.from_numpy(state["torch"]))
    return state["own"]


def _counters(model: LeanDQN | LeanSAC) -> tuple[str, ...]:
    return COUNTERS + DQN_COUNTERS if isinstance(model, LeanDQN) else COUNTERS
