"""Policies of the kinds that are numbers alone, as tests save and damage them."""

import numpy as np
from commands import COMMAND_SIGNS

from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import (
    OpenLoopPolicy,
    OscillatorPolicy,
    Oscillators,
    UniformPolicy,
)
from jumping_ant.policies.linear import LinearPolicy

COMMANDS = ActionSet(0.5 * COMMAND_SIGNS, hold=3)


def linear_policy(actions: ActionSet = ActionSet()) -> LinearPolicy:  # noqa: B008 - it is frozen
    generator = np.random.default_rng(1)
    return LinearPolicy(
        weight=generator.normal(0, 0.1, (8, 27)).astype(np.float32),
        bias=generator.normal(0, 0.1, 8).astype(np.float32),
        mean=generator.normal(0, 1, 27).astype(np.float32),
        stdev=generator.uniform(0.5, 2, 27).astype(np.float32),
        weight_spread=generator.uniform(0.1, 0.2, (8, 27)).astype(np.float32),
        bias_spread=generator.uniform(0.1, 0.2, 8).astype(np.float32),
        actions=actions,
    )


def oscillator_policy(actions: ActionSet = ActionSet()) -> OscillatorPolicy:  # noqa: B008
    generator = np.random.default_rng(2)
    amplitudes, phases, offsets = generator.normal(0, 0.5, (3, 8))
    return OscillatorPolicy(
        Oscillators(amplitudes, phases, offsets, np.array([0.5, 0.75])), actions
    )


NUMBERS = {
    "linear": linear_policy(ActionSet(amplitude=0.25, hold=4)),
    "linear levels": linear_policy(ActionSet(amplitude=0.25, hold=4, levels=2)),
    "uniform": UniformPolicy(3, ActionSet(amplitude=0.25, hold=4), 8),
    "uniform commands": UniformPolicy(3, COMMANDS, 8),
    "uniform levels": UniformPolicy(3, ActionSet(levels=3), 8),
    "open loop": OpenLoopPolicy(ActionSet(COMMAND_SIGNS[[3, 4]], hold=3)),
    "oscillator": oscillator_policy(),
    "oscillator levels": oscillator_policy(ActionSet(amplitude=0.5, hold=2, levels=3)),
}
