"""Robots from their sources and edits, compiled: their numbers against those of the source."""

import hashlib
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.params import article
from jumping_ant.params.blocks import GYMNASIUM_ROBOTS, RobotParams
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv, article_world

AS_IT_COMES = RobotParams(
    source="ant",
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
MINE = AS_IT_COMES.model_copy(update={"source": "robots/mine.xml"})
MOTORS = ["hip_4", "ankle_4", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3"]
DENSITY = 5.0  # of Gymnasium's Ant [kg/m^3]


def edited(source: str = "ant", **changes: Any) -> mujoco.MjModel:
    return robot.load(robot.build(AS_IT_COMES.model_copy(update={"source": source} | changes)))


def gears(model: mujoco.MjModel) -> dict[str, float]:
    return {name: float(model.actuator(name).gear[0]) for name in MOTORS}


def text(source: str) -> str:
    return robot.source_path(source).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def source(source_xml: str) -> mujoco.MjModel:
    return robot.load(source_xml)


@pytest.mark.parametrize("source", [*GYMNASIUM_ROBOTS, "robots/tripod.xml"])
def test_without_edits_a_robot_is_its_source_to_the_last_bit(source: str) -> None:
    plain = mujoco.MjModel.from_xml_path(str(robot.source_path(source)))
    states = []
    for model in (plain, edited(source)):
        data, generator = mujoco.MjData(model), np.random.default_rng(0)
        for _ in range(50):
            data.ctrl[:] = generator.uniform(-1, 1, model.nu)
            mujoco.mj_step(model, data, nstep=5)
        states.append(np.concatenate([data.qpos, data.qvel]))
    np.testing.assert_array_equal(*states)
    unedited = robot.unedited(AS_IT_COMES.model_copy(update={"source": source}))
    assert robot.load(unedited).body_subtreemass[0] == plain.body_subtreemass[0]


def test_a_joints_gear_wins_over_its_kinds_and_that_over_all() -> None:
    model = edited(gear=200.0, joint_gear={"ankle_2": 50.0, "ankle": 250.0})
    kinds = {name: 200.0 if name.startswith("hip") else 250.0 for name in MOTORS}
    assert gears(model) == kinds | {"ankle_2": 50.0}
    assert [model.joint(i).name for i in model.actuator_trnid[:, 0]] == MOTORS


def test_the_gear_is_the_peak_torque_where_controls_are_limited_otherwise() -> None:
    model = edited("humanoid", gear=100.0)  # whose controls end at 0.4
    np.testing.assert_allclose(model.actuator_gear[:, 0] * model.actuator_ctrlrange[:, 1], 100.0)


def test_torso_radius_sets_the_sphere_and_nothing_else(source: mujoco.MjModel) -> None:
    wide = edited(torso_radius=0.3)
    assert wide.geom("torso_geom").size[0] == 0.3
    masses = source.body_mass.copy()
    masses[source.body("torso").id] = DENSITY * 4 / 3 * np.pi * 0.3**3
    np.testing.assert_allclose(wide.body_mass, masses)
    np.testing.assert_array_equal(wide.body_pos, source.body_pos)


def test_longer_legs_reach_farther(source: mujoco.MjModel) -> None:
    def reach(model: mujoco.MjModel) -> float:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        middle = data.geom("left_ankle_geom").xpos[:2]
        return float(np.hypot(*middle) + model.geom("left_ankle_geom").size[1])

    # Torso to tip: 0.2 + 0.2 + 0.4 along each axis, stretched out in the source's pose.
    long = edited(leg_length=1.5)
    assert reach(source) == pytest.approx(0.8 * np.sqrt(2))
    assert reach(long) == pytest.approx(1.5 * 0.8 * np.sqrt(2))
    thickness = slice(1, None), 0  # the torso's among them
    np.testing.assert_array_equal(long.geom_size[thickness], source.geom_size[thickness])


def test_the_knobs_turn_any_robot() -> None:
    plain = edited("half_cheetah")
    changed = edited("half_cheetah", density=500.0, friction=[0.9, 0.5, 0.5])
    np.testing.assert_allclose(changed.body_mass.sum(), plain.body_mass.sum() * 0.8, rtol=0.3)
    assert (changed.geom_friction == [0.9, 0.5, 0.5]).all()
    limp, long = edited("hopper", damping=0.25), edited("hopper", leg_length=1.5)
    np.testing.assert_array_equal(limp.dof_damping, [0, 0, 0, 0.25, 0.25, 0.25])
    assert long.geom("foot_geom").size[1] == pytest.approx(1.5 * 0.195)
    assert long.geom("torso_geom").size[1] == edited("hopper").geom("torso_geom").size[1]


@pytest.fixture(scope="module")
def articles() -> mujoco.MjModel:
    return robot.load(robot.build(article.ROBOT))


def test_the_articles_robot_weighs_three_fifths(
    articles: mujoco.MjModel, source: mujoco.MjModel
) -> None:
    """3 kg/m^3 instead of 5, torso included."""
    np.testing.assert_allclose(articles.body_mass, source.body_mass * 3 / 5, rtol=1e-12)
    np.testing.assert_allclose(articles.body_inertia, source.body_inertia * 3 / 5, rtol=1e-12)
    torso = 4 / 3 * np.pi * 0.25**3
    # Capsules of radius 0.08; eight are as long as the diagonal of 0.2 m, four of 0.4 m.
    lengths = np.repeat([0.2, 0.4], [8, 4]) * np.sqrt(2)
    legs = sum(np.pi * 0.08**2 * length + 4 / 3 * np.pi * 0.08**3 for length in lengths)
    assert articles.body("torso").mass[0] == pytest.approx(3 * torso)
    assert articles.body_subtreemass[0] == pytest.approx(3 * (torso + legs))


def test_the_articles_robot_is_gymnasiums_but_for_masses_motors_damping_and_friction(
    articles: mujoco.MjModel, source: mujoco.MjModel
) -> None:
    assert gears(articles) == dict.fromkeys(MOTORS, 300.0)
    np.testing.assert_array_equal(articles.dof_damping, np.repeat([0.0, 0.5], [6, 8]))
    np.testing.assert_array_equal(articles.geom_friction, [[0.6, 0.3, 0.3]] * 14)  # floor, too
    assert (articles.geom_condim == 3).all()
    for name in ("geom_size", "geom_pos", "body_pos", "jnt_range", "dof_armature", "geom_gap"):
        np.testing.assert_array_equal(getattr(articles, name), getattr(source, name), err_msg=name)
    assert articles.opt.timestep == source.opt.timestep == 0.01
    assert articles.opt.integrator == source.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4


@pytest.mark.parametrize(("higher", "begins"), [(1e-6, False), (-1e-6, True)])
def test_contacts_of_the_articles_robot_begin_where_they_did_in_its_mujoco(
    articles: mujoco.MjModel, higher: float, begins: bool
) -> None:
    """At the larger of its file's two margins of 0.01 m; MuJoCo 4.0 has the sum of two."""
    data = mujoco.MjData(articles)
    mujoco.mj_forward(articles, data)
    ends = articles.geom_size[:, 0] + np.abs(articles.geom_size[:, 1] * data.geom_xmat[:, 8])
    lowest = (data.geom_xpos[:, 2] - ends)[1:].min()  # without the floor
    data.qpos[2] -= lowest - 0.01 - higher
    mujoco.mj_forward(articles, data)
    assert (data.ncon > 0) is begins


@pytest.mark.parametrize(("seed", "printed"), [(0, 265.6), (1, 222.6), (2, 226.7), (3, 227.3)])
def test_a_held_pose_returns_what_it_does_in_the_articles_mujoco(seed: int, printed: float) -> None:
    """The numbers are those of MuJoCo 2.3.6 and Gymnasium 0.28.1's Ant-v4, with the same starts.

    Command 3 of the article pushes all four feet down: the robot rises and stands still.
    """
    env = RobotEnv(article_world())
    env.reset(seed=seed)
    torques = 0.5 * np.array(article.ENV.commands[3])
    total = sum(env.step(torques)[1] for _ in range(1000))
    assert total == pytest.approx(printed, abs=0.1)
    assert env.envs.qpos[0, 2] == pytest.approx(0.622043, abs=1e-6)  # [m]


def test_no_digit_is_lost_in_the_text() -> None:
    third = 1 / 3
    model = edited(density=third, gear=third)
    assert gears(model)["hip_1"] == third
    assert model.body("torso").mass[0] == pytest.approx(third * 4 / 3 * np.pi * 0.25**3, rel=1e-14)


def test_summary_agrees_with_the_compiled_models(
    source: mujoco.MjModel, robot_xml: str, known_params: Params
) -> None:
    summary = robot.summarize(known_params.robot, robot_xml)
    for part, model in ((summary["before"], source), (summary["after"], robot.load(robot_xml))):
        mass, torques = model.body_subtreemass[0], model.actuator_gear[:, 0]
        assert part["mass"] == pytest.approx(mass)
        assert sum(part["body_mass"].values()) == pytest.approx(mass)
        assert len(part["body_mass"]) == model.nbody - 1
        assert part["peak_torque"] == dict(zip(MOTORS, torques, strict=True))
        assert part["peak_torque_over_weight"] == pytest.approx(torques.sum() / (9.81 * mass))
    digest = hashlib.sha256(robot.source_path("ant").read_bytes()).hexdigest()
    assert summary["source"]["sha256"] == digest
    assert summary["versions"]["mujoco"] == mujoco.__version__


def test_edits_set_attributes_by_element_and_name(source: mujoco.MjModel) -> None:
    edits: Any = {
        "joint": {"ankle_[12]": {"range": [20.0, 60.0], "limited": True}},
        "option": {"*": {"timestep": 0.005}},
        "geom": {"floor": {"condim": 4}},
    }
    model = edited(edits=edits)
    for name in ("ankle_1", "ankle_2"):
        np.testing.assert_allclose(np.degrees(model.joint(name).range), [20, 60])
    np.testing.assert_array_equal(model.joint("ankle_3").range, source.joint("ankle_3").range)
    assert model.opt.timestep == 0.005
    assert (model.geom("floor").condim[0], model.geom("torso_geom").condim[0]) == (4, 3)


def test_edits_of_joints_are_of_bodies_joints() -> None:
    """Gymnasium's humanoid has tendons, whose elements name joints."""
    model = edited("humanoid", edits={"joint": {"*": {"stiffness": 3}}})
    assert (model.jnt_stiffness[1:] == 3).all() and model.ntendon == 2


def test_nameless_bodies_have_names_of_their_own(tmp_path: Path) -> None:
    foot = '<body><joint/><geom size="0.1"/></body>'
    body = f'<body name="torso"><freejoint/><geom size="0.1"/>{foot}{foot}<body name="torso_foot">'
    body += '<geom size="0.1"/></body></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    names = ["world", "torso", "torso_foot_2", "torso_foot_3", "torso_foot"]
    assert robot.body_names(model) == names


@pytest.mark.parametrize(
    ("element", "name", "attributes", "message"),
    [
        ("wheel", "*", {"size": 1}, "wheel: no such element; allowed: .*geom.*"),
        ("joint", "knee*", {"damping": 1}, r"joint.knee\*: matches no name; allowed: root, hip_1"),
        ("joint", "hip*", {"colour": 1}, ".*not valid MJCF: .*unrecognized attribute: 'colour'"),
        ("geom", "floor", {"size": "big"}, "geom.floor: not valid MJCF: "),
        ("geom", "*", {"density": -1}, r"geom.\*: does not compile: "),
        # These pass the same check as files.
        ("texture", "*", {"fileright": "/a"}, ".*given <texture fileright='/a'>"),
        ("texture", "*", {"width": 10**9}, ".*allowed: whole numbers up to 8,192"),
        ("option", "*", {"iterations": 10**9}, ".*allowed: whole numbers up to 200"),
        ("option", "*", {"iterations": 16**9999}, ".*Exceeds the limit"),
        (
            "geom",
            "*",
            {'a=""/><include file="/etc/passwd"/><geom b': 1},
            ".*allowed: names of attributes",
        ),
        ("geom", "*", {"name": "a\nb"}, r".*name='a\\nb'>, allowed: text of one line"),
        ("geom", "*", {"name": "\0"}, ".*not valid MJCF: not well-formed"),
        ("geom", "*", {"name": "\ud800"}, ".*not valid MJCF: 'utf-8' codec can't"),
    ],
)
def test_edits_that_do_not_fit_are_refused(
    element: str, name: str, attributes: Any, message: str
) -> None:
    with pytest.raises(InputError, match=f"^robot.edits.{message}") as caught:
        edited(edits={element: {name: attributes}})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"density": 1e-300}, "robot: these edits do not compile: "),
        ({"leg_length": 1e-300}, "robot: these edits do not compile: "),
        ({"source": "humanoid", "torso_radius": 0.2}, "robot.torso_radius: this robot has no geom"),
        (
            {"joint_gear": {"knee": 1.0}},
            "robot.joint_gear.knee: unknown joint; allowed: hip, ankle, ankle_1, ankle_2, ankle_3, "
            "ankle_4, hip_1, hip_2, hip_3, hip_4",
        ),
        ({"edits": {"option": {"*": {"gravity": "0 0 0"}}}}, "robot: given a weight of 0 N"),
        ({"edits": {"motor": {"hip_1": {"gear": "inf"}}}}, "robot: .* peak torques of inf N"),
        *(
            ({"edits": {"option": {"*": {"timestep": step}}}}, f".*given a time step of {step} s")
            for step in (1e-300, 9e-06, 1.1)
        ),
    ],
)
def test_other_settings_that_do_not_fit_are_refused(changes: Any, message: str) -> None:
    params = AS_IT_COMES.model_copy(update=changes)
    with pytest.raises(InputError, match=f"^{message}"):
        robot.summarize(params, robot.build(params))


def test_read_wants_the_robot_built(tmp_path: Path, robot_xml: str) -> None:
    with pytest.raises(InputError, match=r"edited.xml: No such file .*; `dvc repro build`"):
        robot.read(tmp_path)
    write_text(tmp_path / "assets" / "edited.xml", robot_xml)
    assert robot.read(tmp_path) == robot_xml


def test_a_source_is_a_file_of_the_project(tmp_path: Path) -> None:
    for name in ("mine", "a" * 300):
        params = AS_IT_COMES.model_copy(update={"source": f"robots/{name}.xml"})
        with pytest.raises(InputError, match=rf"{name}.xml', which is not a file, allowed: ant"):
            robot.build(params, tmp_path)
    write_text(tmp_path / "robots" / "mine.xml", "<mujoco>")
    with pytest.raises(InputError, match=r"robot.source: mine.xml: not valid MJCF: no element"):
        robot.build(MINE, tmp_path)
    write_text(tmp_path / "robots" / "mine.xml", text("hopper"))
    summary = robot.summarize(MINE, robot.build(MINE, tmp_path), tmp_path)
    assert summary["source"]["file"] == "robots/mine.xml"


def test_a_source_may_include_others_in_all_that_is_built_from_it(tmp_path: Path) -> None:
    whole = text("hopper")
    motors = whole[whole.index("<actuator>") : whole.index("</mujoco>")]
    write_text(tmp_path / "robots" / "motors.xml", f"<mujocoinclude>{motors}</mujocoinclude>")
    made = []
    for source in (whole, whole.replace(motors, '<include file="motors.xml"/>')):
        write_text(tmp_path / "robots" / "mine.xml", source)
        xml = robot.build(MINE, tmp_path)
        summary = robot.summarize(MINE, xml, tmp_path)
        made.append([xml, robot.unedited(MINE, tmp_path), summary["before"], summary["after"]])
    assert made[0] == made[1]


def test_motors_of_one_joint_need_names(tmp_path: Path) -> None:
    motors = '<actuator><motor joint="a"/><motor joint="a"/></actuator>'
    body = '<body><joint name="a"/><geom size="1"/></body>'
    xml = f"<mujoco><worldbody>{body}</worldbody>{motors}</mujoco>"
    write_text(tmp_path / "robots" / "mine.xml", xml)
    with pytest.raises(InputError, match=r"^robot.source: robots/mine.xml: .* repeated name 'a'"):
        robot.build(MINE, tmp_path)
    named = xml.replace("<motor", '<motor name="b"', 1)
    write_text(tmp_path / "robots" / "mine.xml", named)
    summary = robot.summarize(MINE, robot.build(MINE, tmp_path), tmp_path)
    assert summary["before"]["peak_torque"] == {"b": 1.0, "a": 1.0}
