"""The article's robot and task, in numbers, and what it printed.

Source: Mauro Di Pietro, "Robotics with Python: Q-Learning vs Actor-Critic vs Evolutionary
Algorithms", 2025; the robot is `assets/custom_ant.xml` of its repository, github.com
mdipietro09/RoboticsPy, and the printed values are the outputs of its `mujoco_gym.ipynb`.
"""

from jumping_ant.params import EnvParams, RewardParams, RobotParams

ROBOT = RobotParams(
    density=3.0,
    gear=300.0,
    joint_gear={},
    torso_radius=0.25,
    leg_length=1.0,
    damping=0.5,
    friction=0.6,
    torsional_friction=0.3,
    rolling_friction=0.3,
)
# The article sets no time limit; episodes that are compared need one.
ENV = EnvParams(
    frame_skip=5,
    reset_noise_scale=0.1,
    max_episode_steps=1000,
    min_torso_height=0.2,
    reward=RewardParams(floor=0.6, span=1.0, scale=10.0),
)
