"""Policies of every kind, of random numbers, for a robot of some sizes."""

import numpy as np

from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import OpenLoopPolicy, OscillatorPolicy, Oscillators, UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.networks import ActorCritic, GreedyCommands, TanhActor
from jumping_ant.policies.policy import Policy

TORQUES = ActionSet(amplitude=0.75, hold=3)
LEVELS = ActionSet(amplitude=0.5, hold=2, levels=3)


def policies(observations: int, motors: int) -> dict[str, Policy]:
    """Return policies for so many observations and motors."""
    generator = np.random.default_rng(5)
    table = generator.choice([-0.5, 0.0, 0.5], (5, motors)).astype(np.float32)
    commands = ActionSet(table, hold=3)

    def numbers(*shape: int) -> np.ndarray:
        return generator.normal(0, 0.3, shape).astype(np.float32)

    def network(kind: type, actions: ActionSet, outputs: int) -> Policy:
        layers = [
            (numbers(16, observations), numbers(16)),
            (numbers(outputs, 16), numbers(outputs)),
        ]
        return kind(np.linspace(0.1, 1, observations, dtype=np.float32), actions, layers)

    def linear(actions: ActionSet, outputs: int) -> Policy:
        weight, bias = numbers(outputs, observations), numbers(outputs)
        stdev = np.linspace(0.5, 2, observations, dtype=np.float32)
        return LinearPolicy(weight, bias, numbers(observations), stdev, weight, bias, actions)

    waves = Oscillators(*generator.normal(0, 0.6, (3, motors)), np.array([0.4, 0.9]))
    return {
        "tanh": network(TanhActor, TORQUES, motors),
        "commands": network(GreedyCommands, commands, 5),
        "levels": network(GreedyCommands, LEVELS, 3 * motors),
        "probable command": network(ActorCritic, commands, 5),
        "mean": network(ActorCritic, TORQUES, motors),
        "linear": linear(TORQUES, motors),
        "linear levels": linear(LEVELS, motors),
        "linear commands": linear(commands, 5),
        "cycle": OpenLoopPolicy(commands),
        "oscillators": OscillatorPolicy(waves, TORQUES),
        "oscillators of levels": OscillatorPolicy(waves, LEVELS),
        "uniform": UniformPolicy(3, TORQUES, motors),
        "uniform commands": UniformPolicy(3, commands, motors),
        "uniform levels": UniformPolicy(4, LEVELS, motors),
    }
