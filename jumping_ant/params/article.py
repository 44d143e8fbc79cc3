"""The article's robot and task as parameters.

Source: Mauro Di Pietro, "Robotics with Python: Q-Learning vs Actor-Critic vs Evolutionary
Algorithms", 2025, and `assets/custom_ant.xml` of github.com mdipietro09/RoboticsPy.
"""

from jumping_ant.params.blocks import EnvParams, RewardParams, RobotParams, TorsoHeightParams

ROBOT = RobotParams(
    source="ant",
    density=3.0,
    gear=300.0,
    joint_gear={},
    torso_radius=0.25,
    leg_length=1.0,
    damping=0.5,
    friction=[0.6, 0.3, 0.3],
    # Its file says 0.01, of which MuJoCo 2.3.6 took the larger of two, where today's adds them up.
    contact_margin=0.005,
    edits={},
)
# The article sets no time limit; episodes that are compared need one.
ENV = EnvParams(
    frame_skip=5,
    reset_noise_scale=0.1,
    drop_height=1.3,
    max_episode_steps=1000,
    min_torso_height=0.2,
    max_torso_height=None,
    max_tilt=None,
    commands=[
        [0.0] * 8,
        [1.0] * 8,
        [-1.0] * 8,
        [1.0] * 4 + [-1.0] * 4,
        [-1.0] * 4 + [1.0] * 4,
    ],
    reward=RewardParams(torso_height=TorsoHeightParams(weight=10.0, floor=0.6, span=1.0)),
)
