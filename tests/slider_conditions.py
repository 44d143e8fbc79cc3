"""What the sliders of the live page set, each at a level that shows."""

from jumping_ant.sim.perturbations import NONE, Condition

CONDITIONS = [
    NONE,
    Condition("gravity", 1.5),
    Condition("friction", 0.1),
    Condition("torso_mass", 1.2),
    Condition("motor_strength", 0.6),
    Condition("damping", 3.0),
    Condition("slope", 20.0),
    Condition("push", 40.0),
    Condition("action_delay", 2.0),
    Condition("observation_delay", 3.0),
]
