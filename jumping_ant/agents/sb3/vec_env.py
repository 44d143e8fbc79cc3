"""An adapter of the batched environment to Stable-Baselines3's interface."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices

from jumping_ant.sim.vector import RobotVectorEnv


class SB3VecEnv(VecEnv):
    """Adapter of environments with SAME_STEP autoreset to SB3's `VecEnv`.

    Observations become float32, which the networks compute with; this halves the replay buffer.
    The first reset uses the seeds `starts`: SB3's own seeds, `seed + i`, would be shared with
    neighbouring runs. With `sparse_rewards`, the last step of an episode is rewarded with the
    episode's return, and no step before. `finished` collects the returns of episodes, of which SB3
    itself would keep the last hundred.
    """

    def __init__(self, envs: RobotVectorEnv, starts: Sequence[int], sparse_rewards: bool) -> None:
        self.envs = envs
        shape = envs.single_observation_space.shape
        super().__init__(
            envs.num_envs, spaces.Box(-np.inf, np.inf, shape, np.float32), envs.single_action_space
        )
        self._starts: list[int] | None = list(starts)
        self._sparse_rewards = sparse_rewards
        self._actions: NDArray[Any] = np.zeros(0)
        self._returns = np.zeros(envs.num_envs)
        self.finished: list[float] = []

    def reset(self) -> NDArray[np.float32]:
        """Start an episode in every environment."""
        observations, _ = self.envs.reset(seed=self._starts)
        self._starts = None
        self._returns[:] = 0
        return observations.astype(np.float32)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Step all environments; an info is empty, except at the end of an episode."""
        observations, rewards, terminated, truncated, vector_infos = self.envs.step(self._actions)
        self._returns += rewards
        dones = terminated | truncated
        if self._sparse_rewards:
            rewards = np.where(dones, self._returns, 0.0)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in dones.nonzero()[0]:
            infos[index] = {
                "terminal_observation": vector_infos["final_obs"][index].astype(np.float32),
                "TimeLimit.truncated": bool(truncated[index] and not terminated[index]),
            }
            self.finished.append(float(self._returns[index]))
            self._returns[index] = 0
        return observations.astype(np.float32), rewards.astype(np.float32), dones, infos

    def save_state(self) -> dict[str, Any]:
        """Return the state that later steps depend on: arrays and JSON-compatible values."""
        return {
            "returns": self._returns.copy(),
            "finished": self.finished.copy(),
            "envs": self.envs.save_state(),
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state of the same number of environments."""
        self._returns[:], self.finished = state["returns"], list(state["finished"])
        self.envs.load_state(state["envs"])

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the environments, once for each."""
        return [getattr(self.envs, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Raise an error: the environments are one batch."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, **kwargs: Any) -> list[Any]:
        """Raise an error: the environments are one batch."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Return False for each environment: the batch is never wrapped."""
        return [False for _ in self._get_indices(indices)]
