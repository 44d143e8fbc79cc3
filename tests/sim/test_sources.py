"""Robots other than the Ant: Gymnasium's, and files of the project."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.params.blocks import GYMNASIUM_ROBOTS, RobotParams
from jumping_ant.sim import robot

AS_IT_COMES = RobotParams(
    source="hopper",
    density=None,
    gear=None,
    joint_gear={},
    torso_radius=None,
    leg_length=None,
    damping=None,
    friction=None,
    contact_margin=None,
    edits={},
)


def other(source: str, **changes: Any) -> mujoco.MjModel:
    return robot.load(robot.build(AS_IT_COMES.model_copy(update={"source": source} | changes)))


@pytest.mark.parametrize("source", [*GYMNASIUM_ROBOTS, "robots/tripod.xml"])
def test_without_edits_a_robot_is_its_source_to_the_last_bit(source: str) -> None:
    plain = mujoco.MjModel.from_xml_path(str(robot.source_path(source)))
    states = []
    for model in (plain, other(source)):
        data, generator = mujoco.MjData(model), np.random.default_rng(0)
        for _ in range(50):
            data.ctrl[:] = generator.uniform(-1, 1, model.nu)
            mujoco.mj_step(model, data, nstep=5)
        states.append(np.concatenate([data.qpos, data.qvel]))
    np.testing.assert_array_equal(*states)
    text = robot.unedited(AS_IT_COMES.model_copy(update={"source": source}))
    assert robot.load(text).body_subtreemass[0] == plain.body_subtreemass[0]


def test_the_knobs_turn_any_robot() -> None:
    plain, changed = (
        other("half_cheetah"),
        other("half_cheetah", density=500.0, friction=[0.9, 0.5, 0.5]),
    )
    np.testing.assert_allclose(changed.body_mass.sum(), plain.body_mass.sum() * 0.8, rtol=0.3)
    assert (changed.geom_friction == [0.9, 0.5, 0.5]).all()
    limp, long = other("hopper", damping=0.25), other("hopper", leg_length=1.5)
    np.testing.assert_array_equal(limp.dof_damping, [0, 0, 0, 0.25, 0.25, 0.25])
    foot = long.geom("foot_geom")
    assert foot.size[1] == pytest.approx(1.5 * 0.195)
    assert long.geom("torso_geom").size[1] == other("hopper").geom("torso_geom").size[1]


def test_the_gear_is_the_peak_torque_where_controls_are_limited_otherwise() -> None:
    model = other("humanoid", gear=100.0)  # whose controls end at 0.4
    np.testing.assert_allclose(model.actuator_gear[:, 0] * model.actuator_ctrlrange[:, 1], 100.0)


def test_knobs_that_a_robot_has_not_are_refused() -> None:
    with pytest.raises(InputError, match="robot.torso_radius: this robot has no geom named"):
        other("humanoid", torso_radius=0.2)


def test_a_source_is_a_file_of_the_project(tmp_path: Path) -> None:
    own = AS_IT_COMES.model_copy(update={"source": "robots/mine.xml"})
    with pytest.raises(InputError, match=r"given 'robots/mine.xml', which is not a file, allowed"):
        robot.build(own, tmp_path)
    long = AS_IT_COMES.model_copy(update={"source": f"robots/{'a' * 300}.xml"})
    with pytest.raises(InputError, match=r"given 'robots/a+.xml', which is not a file, allowed"):
        robot.build(long, tmp_path)
    write_text(tmp_path / "robots" / "mine.xml", "<mujoco>")
    with pytest.raises(InputError, match=r"robot.source: mine.xml: not valid MJCF: no element"):
        robot.build(own, tmp_path)
    write_text(
        tmp_path / "robots" / "mine.xml", robot.source_path("hopper").read_text(encoding="utf-8")
    )
    assert robot.load(robot.build(own, tmp_path)).nu == 3
    summary = robot.summarize(own, robot.build(own, tmp_path), tmp_path)
    assert summary["source"]["file"] == "robots/mine.xml"


def test_a_source_may_include_others_in_all_that_is_built_from_it(tmp_path: Path) -> None:
    """Also in the summary, which once read the source as text, without its folder."""
    text = robot.source_path("hopper").read_text(encoding="utf-8")
    motors = text[text.index("<actuator>") : text.index("</mujoco>")]
    write_text(tmp_path / "robots" / "motors.xml", f"<mujocoinclude>{motors}</mujocoinclude>")
    include = '<include file="motors.xml"/>'
    write_text(tmp_path / "robots" / "mine.xml", text.replace(motors, include))
    write_text(tmp_path / "robots" / "whole.xml", text)
    made = []
    for name in ("mine", "whole"):
        own = AS_IT_COMES.model_copy(update={"source": f"robots/{name}.xml"})
        xml = robot.build(own, tmp_path)
        summary = robot.summarize(own, xml, tmp_path)
        texts = [
            text.replace(f"jumping_{name}", "") for text in (xml, robot.unedited(own, tmp_path))
        ]
        made.append([*texts, summary["before"], summary["after"]])
    assert made[0] == made[1]


def test_motors_of_one_joint_need_names(tmp_path: Path) -> None:
    motors = '<actuator><motor joint="a"/><motor joint="a"/></actuator>'
    body = '<body><joint name="a"/><geom size="1"/></body>'
    xml = f"<mujoco><worldbody>{body}</worldbody>{motors}</mujoco>"
    write_text(tmp_path / "robots" / "mine.xml", xml)
    own = AS_IT_COMES.model_copy(update={"source": "robots/mine.xml"})
    with pytest.raises(InputError, match=r"^robot.source: robots/mine.xml: .* repeated name 'a'"):
        robot.build(own, tmp_path)
