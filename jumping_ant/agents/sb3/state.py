"""State that training resumes from: that of the model and of its environments.

It consists of networks, optimisers, replay buffer, counters, simulations, and every random number
generator in use. An on-policy model has no replay buffer, and no experience left between rounds.

Names that Stable-Baselines3 keeps private, those with an underscore, are those of version 2.9.2,
here and in the trainer and the model beside it.
"""

from collections.abc import Iterator, Sequence
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from torch import Tensor

from jumping_ant.agents.sb3.vec_env import SB3VecEnv
from jumping_ant.base.archive import pack_state, unpack_state

# Counters of Stable-Baselines3's training loop.
COUNTERS = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
# What its optimisers keep for each parameter.
MOMENTS = {torch.optim.Adam: ("exp_avg", "exp_avg_sq"), torch.optim.RMSprop: ("square_avg",)}
# Arrays of its replay buffer.
COLUMNS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def capture(model: BaseAlgorithm, counters: Sequence[str], own: Any) -> bytes:
    """Return the state of a model between two rounds of `learn`, and the trainer's own (JSON)."""
    replay = cast(ReplayBuffer | None, getattr(model, "replay_buffer", None))
    return pack_state(
        {
            "learner": {name: vector.numpy() for name, vector in _vectors(model).items()},
            "learning_rates": {
                name: optimizer.param_groups[0]["lr"] for name, optimizer in _optimizers(model)
            },
            "replay": _save_replay(replay) if replay else None,
            "envs": cast(SB3VecEnv, model.env).save_state(),
            "last_obs": model._last_obs,
            "episode_starts": model._last_episode_starts,
            "counters": {name: getattr(model, name) for name in (*COUNTERS, *counters)},
            "logged": {key: float(value) for key, value in model.logger.name_to_value.items()},
            "actions": model.action_space.np_random.bit_generator.state,
            "numpy": np.random.get_state(legacy=False),
            "torch": torch.get_rng_state().numpy(),
            "own": own,
        }
    )


def restore(model: BaseAlgorithm, counters: Sequence[str], content: bytes) -> Any:
    """Put a fresh model, set up to learn, into a captured state; return the trainer's own state."""
    state = unpack_state(content)
    for name, vector in _vectors(model).items():
        vector.copy_(torch.from_numpy(state["learner"][name]))
    for name, optimizer in _optimizers(model):
        optimizer.param_groups[0]["lr"] = state["learning_rates"][name]
    if state["replay"]:
        _load_replay(cast(Any, model).replay_buffer, state["replay"])
    cast(SB3VecEnv, model.env).load_state(state["envs"])
    model._last_obs = state["last_obs"]
    model._last_episode_starts = state["episode_starts"]
    for name in (*COUNTERS, *counters):
        setattr(model, name, state["counters"][name])
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
    for name, optimizer in _optimizers(model):
        vectors |= {f"{name}.{key}": tensor for key, tensor in moments(optimizer).items()}
    variables = model._get_torch_save_params()[1]
    return vectors | {name: _attribute(model, name).detach() for name in variables}


def _optimizers(model: BaseAlgorithm) -> Iterator[tuple[str, torch.optim.Optimizer]]:
    """Yield the optimisers that Stable-Baselines3 saves, with their names."""
    for name in model._get_torch_save_params()[0]:
        part = _attribute(model, name)
        if isinstance(part, torch.optim.Optimizer):
            yield name, part


def _attribute(model: BaseAlgorithm, name: str) -> Any:
    """Return the attribute with a dotted name."""
    part: Any = model
    for key in name.split("."):
        part = getattr(part, key)
    return part


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


def _save_replay(replay: ReplayBuffer) -> dict[str, Any]:
    """Return the stored transitions, and the position of the next one."""
    size = replay.buffer_size if replay.full else replay.pos
    return {"position": replay.pos} | {name: getattr(replay, name)[:size] for name in COLUMNS}


def _load_replay(replay: ReplayBuffer, state: dict[str, Any]) -> None:
    """Load transitions into an empty buffer of the same size."""
    for name in COLUMNS:
        getattr(replay, name)[: len(state[name])] = state[name]
    replay.pos = state["position"]
    replay.full = len(state["rewards"]) == replay.buffer_size
