"""What a compiled robot is made of, against the simulator."""

import mujoco
import numpy as np
import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.sim import robot
from jumping_ant.sim.anatomy import Anatomy

# Positions, velocities, motors, observations, and whether the torso is free, as Gymnasium tells.
ROBOTS = {
    "ant": (15, 14, 8, 27, True),
    "hopper": (6, 6, 3, 11, False),
    "walker2d": (9, 9, 6, 17, False),
    "half_cheetah": (9, 9, 6, 17, False),
    "humanoid": (24, 23, 17, 45, True),
    "robots/tripod.xml": (13, 12, 6, 23, True),
}


def load(source: str) -> mujoco.MjModel:
    return robot.load(robot.source_path(source).read_text(encoding="utf-8"))


@pytest.mark.parametrize("source", ROBOTS)
def test_sizes_and_the_torsos_place_and_tilt_are_the_simulators(source: str) -> None:
    model = load(source)
    anatomy, data = Anatomy.of(model), mujoco.MjData(model)
    sizes = anatomy.num_positions, anatomy.num_velocities, anatomy.num_motors
    assert (*sizes, anatomy.num_observations, anatomy.is_free) == ROBOTS[source]
    assert model.body(anatomy.torso).name == "torso"
    generator = np.random.default_rng(0)
    for _ in range(20):
        qpos = model.qpos0 + generator.normal(size=model.nq)
        data.qpos[:] = qpos  # its quaternion is of any length
        mujoco.mj_kinematics(model, data)
        torso = data.body(anatomy.torso)
        np.testing.assert_allclose(anatomy.places(qpos[None])[0], torso.xpos, atol=1e-12)
        assert anatomy.heights(qpos[None])[0] == pytest.approx(torso.xpos[2])
        assert anatomy.uprightness(qpos[None])[0] == pytest.approx(torso.xmat[8])
    assert anatomy.uprightness(model.qpos0[None])[0] == 1.0


@pytest.mark.parametrize("source", ROBOTS)
def test_peak_torques_act_on_the_motors_joints(source: str) -> None:
    model = load(source)
    anatomy, data = Anatomy.of(model), mujoco.MjData(model)
    data.ctrl[:] = 3 * anatomy.control_limits  # clipped there
    mujoco.mj_forward(model, data)
    acting = data.qfrc_actuator[model.jnt_dofadr[anatomy.motor_joints]]
    np.testing.assert_allclose(acting, anatomy.peak_torques)


FREE, LEG = "<freejoint/>", '<body><joint name="knee"/><geom size="0.1"/></body>'
MOTOR = '<motor joint="knee"/>'
SLIDES = '<joint type="slide" axis="0 0 1" name="z"/><joint type="slide" axis="1 0 0"/>'
FIXED = '<body><joint name="arm"/><geom size="0.1"/></body></body><body><freejoint/>'
PUSHER = '<motor name="m" joint="knee" ctrllimited="true" ctrlrange="0 1"/>'


@pytest.mark.parametrize(
    ("joints", "more", "motor", "message"),
    [
        ("", "", "", "given 0 bodies that move relative to the world"),
        (FREE, "</body><body><freejoint/>", MOTOR, "given 2 bodies that move relative to the w"),
        ('<joint name="neck"/>', "", MOTOR, "on the joints neck, allowed: a free joint, or slides"),
        (f"{SLIDES}<joint/>", "", MOTOR, "on the joints z, a nameless one, a nameless one, allo"),
        (FREE, "", "", "given no motor"),
        (
            "",
            FIXED,
            '<motor joint="arm"/>',
            "given the joint arm before those of the torso, allowed",
        ),
        (FREE, '<site name="jet"/>', '<motor name="jet" site="jet"/>', "motor jet drives no joint"),
        (FREE, "", PUSHER, r"m has controls in \[0, 1\], allowed: a range symmetric about zero"),
    ],
)
def test_what_is_built_otherwise_is_refused(
    joints: str, more: str, motor: str, message: str
) -> None:
    leg = LEG if joints else ""
    body = f'<body name="torso">{joints}<geom size="0.1"/>{leg}{more}<geom size="0.1"/></body>'
    xml = f"<mujoco><worldbody>{body}</worldbody><actuator>{motor}</actuator></mujoco>"
    with pytest.raises(InputError, match=f"robot: .*{message}"):
        Anatomy.of(robot.load(xml))
