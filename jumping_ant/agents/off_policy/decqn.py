"""Decoupled Q-networks: DQN with a head for each motor.

Seyde et al. 2023, "Solving Continuous Control via Q-learning". A network has the values of each
level of each motor, and the value of a choice is their mean over the motors, so that the best
choice has each motor's best level: 8 motors of 2 levels take 16 outputs instead of 256. As there,
each motor explores on its own. Unlike there, targets are the target network's highest values, all
transitions are replayed alike, and layers are not normalised.
"""

from typing import Any, ClassVar, cast

from gymnasium import spaces
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork
from torch import Tensor

from jumping_ant.agents.off_policy.lean.learners import LeanDQN


class DecoupledPolicy(DQNPolicy):
    """The policy of DQN, whose network has the values of each level of each motor."""

    def make_q_net(self) -> QNetwork:
        """Return a network with an output for each level of each motor."""
        levels = cast(spaces.MultiDiscrete, self.action_space).nvec
        self.net_args["action_space"] = spaces.Discrete(int(levels.sum()))
        return super().make_q_net()

    def _predict(self, obs: Any, deterministic: bool = True) -> Tensor:
        num_motors = len(cast(spaces.MultiDiscrete, self.action_space).nvec)
        values: Tensor = self.q_net(obs)
        return values.view(len(values), num_motors, -1).argmax(2)


class _OnLevels(OffPolicyAlgorithm):
    """Accepts levels of motors in place of the actions that a derived class names."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        settings["supported_action_spaces"] = (spaces.MultiDiscrete,)
        super().__init__(*args, **settings)


class DecQN(LeanDQN, _OnLevels):
    """DQN with a head for each motor (Seyde et al. 2023); `_OnLevels` replaces what DQN accepts."""

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {"MlpPolicy": DecoupledPolicy}
