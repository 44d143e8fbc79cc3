"""State that training resumes from: that of the model and of its environments.

It consists of networks, optimisers, replay buffer, counters, simulations, and every random number
generator in use. An on-policy model has no replay buffer, and no experience left between rounds.

Names that Stable-Baselines3 keeps private, those with an underscore, are those of version 2.9.2,
here and in the trainer and the model beside it.
"""

from operator import attrgetter
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from torch import Tensor

from jumping_ant.agents.sb3.vec_env import SB3VecEnv
from jumping_ant.base.archive import pack_state, unpack_state

# Counters of Stable-Baselines3's training loop; the last two are those of value-based learners.
COUNTERS = {"num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining"}
COUNTERS |= {"_n_calls", "exploration_rate"}
# What its optimisers keep for each parameter.
MOMENTS = {torch.optim.Adam: ("exp_avg", "exp_avg_sq"), torch.optim.RMSprop: ("square_avg",)}
# Arrays of its replay buffer.
COLUMNS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def capture(model: BaseAlgorithm, own: Any) -> bytes:
    """Return the state of a model between two rounds of `learn`, and the trainer's own (JSON)."""
    buffer: ReplayBuffer | None = getattr(model, "replay_buffer", None)
    replay: dict[str, Any] | None = None
    if buffer:
        replay = {name: getattr(buffer, name)[: buffer.size()] for name in COLUMNS}
        replay["position"] = buffer.pos
    return pack_state(
        {
            "learner": {name: vector.numpy() for name, vector in _vectors(model).items()},
            "learning_rates": {
                name: each.param_groups[0]["lr"] for name, each in _optimizers(model).items()
            },
            "replay": replay,
            "envs": cast(SB3VecEnv, model.env).save_state(),
            "last_obs": model._last_obs,
            "episode_starts": model._last_episode_starts,
            "counters": {name: value for name, value in vars(model).items() if name in COUNTERS},
            "logged": {key: float(value) for key, value in model.logger.name_to_value.items()},
            "actions": model.action_space.np_random.bit_generator.state,
            "numpy": np.random.get_state(legacy=False),
            "torch": torch.get_rng_state().numpy(),
            "own": own,
        }
    )


def restore(model: BaseAlgorithm, content: bytes) -> Any:
    """Put a fresh model, set up to learn, into a captured state; return the trainer's own state."""
    state = unpack_state(content)
    for name, vector in _vectors(model).items():
        vector.copy_(torch.from_numpy(state["learner"][name]))
    for name, optimizer in _optimizers(model).items():
        optimizer.param_groups[0]["lr"] = state["learning_rates"][name]
    if replay := state["replay"]:
        buffer: ReplayBuffer = cast(Any, model).replay_buffer
        for name in COLUMNS:
            getattr(buffer, name)[: len(replay[name])] = replay[name]
        buffer.pos, buffer.full = replay["position"], len(replay["rewards"]) == buffer.buffer_size
    cast(SB3VecEnv, model.env).load_state(state["envs"])
    model._last_obs = state["last_obs"]
    model._last_episode_starts = state["episode_starts"]
    vars(model).update(state["counters"])
    for key, value in state["logged"].items():
        model.logger.record(key, value)
    model.action_space.np_random.bit_generator.state = state["actions"]
    np.random.set_state(state["numpy"])
    torch.set_rng_state(torch.from_numpy(state["torch"]))
    return state["own"]


def _vectors(model: BaseAlgorithm) -> dict[str, Tensor]:
    """Return all tensors that learning modifies, by name; they are not copied."""
    if hasattr(model, "vectors"):
        own: dict[str, Tensor] = model.vectors
        return own
    vectors = {f"policy.{key}": tensor for key, tensor in model.policy.state_dict().items()}
    for name, optimizer in _optimizers(model).items():
        vectors |= {f"{name}.{key}": tensor for key, tensor in moments(optimizer).items()}
    variables = model._get_torch_save_params()[1]
    return vectors | {name: attrgetter(name)(model).detach() for name in variables}


def _optimizers(model: BaseAlgorithm) -> dict[str, torch.optim.Optimizer]:
    """Return the optimisers that Stable-Baselines3 saves."""
    parts = {name: attrgetter(name)(model) for name in model._get_torch_save_params()[0]}
    return {name: each for name, each in parts.items() if isinstance(each, torch.optim.Optimizer)}


def moments(optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """Return what the optimiser keeps for each parameter, which is zero before the first step."""
    moments: dict[str, Tensor] = {}
    parameters = [each for group in optimizer.param_groups for each in group["params"]]
    for number, parameter in enumerate(parameters):
        kept = optimizer.state[parameter]
        if not kept:
            kept |= {"step": torch.zeros(())}
            kept |= {key: torch.zeros_like(parameter) for key in MOMENTS[type(optimizer)]}
        moments |= {f"{number}.{key}": kept[key] for key in ("step", *MOMENTS[type(optimizer)])}
    return moments
