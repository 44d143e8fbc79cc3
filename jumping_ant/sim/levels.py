"""The perturbations, and the levels of those that the robustness stage plays.

`jumping_ant.sim.perturbations` applies them. All agents play the same starts and disturbances, so
that their returns at a level are paired.
"""

from typing import NamedTuple


class Levels(NamedTuple):
    """The levels of a perturbation."""

    about: str  # the unit, and what a level is
    most: float  # the most severe level that the live page offers
    values: tuple[float, ...] = ()  # that the stage plays, from mild to severe


# Masses and forces are for the Ant, whose torso has 0.2 kg and which weighs 5 N. The largest mass
# is that of RRLS, so that returns can be set beside those of its robust Ant: Zouitine et al. 2024,
# "RRLS: Robust Reinforcement Learning Suite", arXiv 2406.08406.
LEVELS = {
    "torso_mass": Levels(
        "[kg] Mass of the torso; its inertia grows with it.", 3, (0.5, 0.8, 1.7, 3)
    ),
    "friction": Levels(
        "[-] Factor on the sliding friction of parts and floor.", 0.05, (0.6, 0.3, 0.1, 0.05)
    ),
    "gravity": Levels("[-] Factor on gravity.", 3),
    "slope": Levels(
        "[degrees] Slope of the floor, in a direction of each episode's own: gravity is inclined.",
        40,
    ),
    "damping": Levels("[-] Factor on the damping of every joint.", 12),
    "motor_strength": Levels("[-] Factor on the torque of every motor.", 0.2, (0.8, 0.6, 0.4, 0.2)),
    "observation_noise": Levels(
        "[m, rad] Standard deviation of noise on observed positions; of velocities 10 times [1/s].",
        10,
        (0.1, 0.5, 1, 2),
    ),
    "lost_sensors": Levels(
        "[-] Share of observed values that read 0, which ones is each episode's own.",
        0.7,
        (0.1, 0.2, 0.4, 0.7),
    ),
    "observation_delay": Levels("[control steps] Age of observations.", 7, (1, 2, 3, 5)),
    "action_delay": Levels(
        "[control steps] Time from a torque's choice until it acts.", 7, (1, 2, 3, 5)
    ),
    "push": Levels(
        "[N] Horizontal force on the torso, for a control step in every second, in any direction.",
        100,
        (10, 20, 40, 80),
    ),
}
