"""The perturbations of the robustness stage, and the levels of each.

`jumping_ant.sim.perturbations` applies them. All agents play the same starts and disturbances, so
that their returns at a level are paired.
"""

from typing import NamedTuple


class Levels(NamedTuple):
    """The levels of a perturbation."""

    about: str  # the unit, and what a level is
    values: tuple[float, ...]  # from mild to severe


# Masses and forces are for the Ant, whose torso has 0.2 kg and which weighs 5 N. The largest mass
# is that of RRLS, so that returns can be set beside those of its robust Ant: Zouitine et al. 2024,
# "RRLS: Robust Reinforcement Learning Suite", arXiv 2406.08406.
LEVELS = {
    "torso_mass": Levels(
        "[kg] Mass of the torso; its inertia grows with it.", (0.3, 0.5, 0.8, 1.2, 1.7, 2.3, 3)
    ),
    "friction": Levels(
        "[-] Factor on the sliding friction of parts and floor.",
        (0.8, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05),
    ),
    "gravity": Levels("[-] Factor on gravity.", (1.1, 1.25, 1.5, 1.75, 2, 2.5, 3)),
    "slope": Levels(
        "[degrees] Slope of the floor, in a direction of each episode's own: gravity is inclined.",
        (5, 10, 15, 20, 25, 30, 40),
    ),
    "damping": Levels("[-] Factor on the damping of every joint.", (1.5, 2, 3, 4, 6, 8, 12)),
    "motor_strength": Levels(
        "[-] Factor on the torque of every motor.", (0.9, 0.8, 0.7, 0.6, 0.5, 0.35, 0.2)
    ),
    "dead_motors": Levels(
        "[-] Share of motors without torque, which ones is each episode's own.",
        (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875),
    ),
    "integration": Levels(
        "[-] Simulation steps per control step, by the integrator implicitfast.",
        (50, 40, 30, 20, 14, 10, 7),
    ),
    "observation_noise": Levels(
        "[m, rad] Standard deviation of noise on observed positions; of velocities 10 times [1/s].",
        (0.1, 0.2, 0.5, 1, 2, 5, 10),
    ),
    "lost_sensors": Levels(
        "[-] Share of observed values that read 0, which ones is each episode's own.",
        (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7),
    ),
    "observation_delay": Levels("[control steps] Age of observations.", (1, 2, 3, 4, 5, 6, 7)),
    "action_delay": Levels(
        "[control steps] Time from a torque's choice until it acts.", (1, 2, 3, 4, 5, 6, 7)
    ),
    "push": Levels(
        "[N] Horizontal force on the torso, for a control step in every second, in any direction.",
        (5, 10, 20, 40, 60, 80, 100),
    ),
    "tilt": Levels(
        "[degrees] Tilt of the torso at the start, in the air, in a direction of the episode's "
        "own.",
        (25, 50, 75, 100, 125, 150, 180),
    ),
}
