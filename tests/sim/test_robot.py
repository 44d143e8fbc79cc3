"""The edited robot, compiled: its numbers against those of Gymnasium's Ant."""

import hashlib
from typing import Any

import mujoco
import numpy as np
import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.params import article, presets
from jumping_ant.params.blocks import RobotParams
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World

# The source's own values: with these, nothing is edited.
UNEDITED = RobotParams(
    source="ant",
    density=5.0,
    gear=150.0,
    joint_gear={},
    torso_radius=0.25,
    leg_length=1.0,
    damping=1.0,
    friction=[1.0, 0.5, 0.5],
    contact_margin=0.01,
    edits={},
)


MOTORS = ["hip_4", "ankle_4", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3"]


def edited(**changes: Any) -> mujoco.MjModel:
    return robot.load(robot.build(UNEDITED.model_copy(update=changes)))


def gears(model: mujoco.MjModel) -> dict[str, float]:
    return {name: float(model.actuator(name).gear[0]) for name in MOTORS}


@pytest.fixture(scope="module")
def source(source_xml: str) -> mujoco.MjModel:
    return robot.load(source_xml)


def test_half_the_density_halves_every_mass(source: mujoco.MjModel) -> None:
    light = edited(density=2.5)
    np.testing.assert_allclose(light.body_mass, source.body_mass / 2, rtol=1e-12)
    np.testing.assert_allclose(light.body_inertia, source.body_inertia / 2, rtol=1e-12)


def test_actuators_are_named_after_the_joints_they_drive(robot_xml: str) -> None:
    model = robot.load(robot_xml)
    assert [model.actuator(i).name for i in range(model.nu)] == MOTORS
    assert [model.joint(i).name for i in model.actuator_trnid[:, 0]] == MOTORS


def test_gear_is_every_motors_peak_torque() -> None:
    assert gears(edited(gear=200.0)) == dict.fromkeys(MOTORS, 200.0)


def test_a_joints_own_gear_wins_over_its_kinds() -> None:
    changed = gears(edited(gear=200.0, joint_gear={"ankle_2": 50.0, "ankle": 250.0}))
    hips = dict.fromkeys((name for name in MOTORS if name.startswith("hip")), 200.0)
    ankles = dict.fromkeys((name for name in MOTORS if name.startswith("ankle")), 250.0)
    assert changed == hips | ankles | {"ankle_2": 50.0}


def test_peak_torque_acts_on_the_joint() -> None:
    model = edited(joint_gear={"hip_1": 77.0})
    data = mujoco.MjData(model)
    data.actuator("hip_1").ctrl[0] = 1.0
    mujoco.mj_forward(model, data)
    assert data.joint("hip_1").qfrc_actuator[0] == 77.0
    assert np.count_nonzero(data.qfrc_actuator) == 1


def test_torso_radius_sets_the_sphere_and_nothing_else(source: mujoco.MjModel) -> None:
    wide = edited(torso_radius=0.3)
    assert wide.geom("torso_geom").size[0] == 0.3
    sphere = 5.0 * 4 / 3 * np.pi * 0.3**3
    assert wide.body("torso").mass[0] == pytest.approx(sphere)
    rest = source.body_mass.copy()
    rest[source.body("torso").id] = sphere
    np.testing.assert_allclose(wide.body_mass, rest)
    np.testing.assert_array_equal(wide.body_pos, source.body_pos)


def test_leg_length_scales_every_segment(source: mujoco.MjModel) -> None:
    long = edited(leg_length=1.5)
    legs = [i for i in range(source.ngeom) if source.geom(i).name not in ("floor", "torso_geom")]
    assert len(legs) == 12
    np.testing.assert_allclose(long.geom_size[legs, 1], 1.5 * source.geom_size[legs, 1])
    np.testing.assert_array_equal(long.geom_size[legs, 0], source.geom_size[legs, 0])
    np.testing.assert_allclose(long.geom_pos[legs], 1.5 * source.geom_pos[legs])
    assert long.geom("torso_geom").size[0] == source.geom("torso_geom").size[0]
    np.testing.assert_array_equal(long.body("torso").pos, source.body("torso").pos)


def test_longer_legs_reach_farther(source: mujoco.MjModel) -> None:
    def reach(model: mujoco.MjModel) -> float:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        middle = data.geom("left_ankle_geom").xpos[:2]
        return float(np.hypot(*middle) + model.geom("left_ankle_geom").size[1])

    # Torso to tip: 0.2 + 0.2 + 0.4 along each axis, stretched out in the source's pose.
    assert reach(source) == pytest.approx(0.8 * np.sqrt(2))
    assert reach(edited(leg_length=1.5)) == pytest.approx(1.5 * 0.8 * np.sqrt(2))


ARTICLES = {
    "presets/article": presets.load("article").robot,
    "JumpingAnt-v0": article.ROBOT,
}


@pytest.fixture(scope="module", params=ARTICLES.values(), ids=ARTICLES.keys())
def articles(request: pytest.FixtureRequest) -> mujoco.MjModel:
    return robot.load(robot.build(request.param))


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


def test_the_articles_motors_joints_and_contacts(articles: mujoco.MjModel) -> None:
    assert gears(articles) == dict.fromkeys(MOTORS, 300.0)
    hinges = articles.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    assert hinges.sum() == 8
    np.testing.assert_array_equal(articles.dof_damping, np.repeat([0.0, 0.5], [6, 8]))
    np.testing.assert_array_equal(articles.jnt_dofadr[hinges], range(6, 14))
    assert articles.ngeom == 14  # the floor, too
    np.testing.assert_array_equal(articles.geom_friction, [[0.6, 0.3, 0.3]] * 14)
    assert (articles.geom_condim == 3).all()


def test_the_articles_robot_is_gymnasiums_but_for_that(
    articles: mujoco.MjModel, source: mujoco.MjModel
) -> None:
    for name in ("geom_size", "geom_pos", "body_pos", "jnt_range", "dof_armature", "geom_gap"):
        np.testing.assert_array_equal(getattr(articles, name), getattr(source, name), err_msg=name)
    assert articles.opt.timestep == source.opt.timestep == 0.01
    assert articles.opt.integrator == source.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4


def test_contacts_of_the_articles_robot_begin_where_they_did_in_its_mujoco(
    articles: mujoco.MjModel,
) -> None:
    """At the larger of its file's two margins of 0.01 m; MuJoCo 4.0 has the sum of two."""
    data = mujoco.MjData(articles)
    for lowered, begins in ((-1e-6, False), (1e-6, True)):
        mujoco.mj_resetData(articles, data)
        mujoco.mj_forward(articles, data)
        feet = (
            data.geom_xpos[:, 2]
            - articles.geom_size[:, 0]
            - np.abs(articles.geom_size[:, 1] * data.geom_xmat[:, 8])
        )
        lowest = feet[1:].min()  # without the floor
        data.qpos[2] -= lowest - 0.01 + lowered
        mujoco.mj_forward(articles, data)
        assert (data.ncon > 0) is begins


@pytest.mark.parametrize(("seed", "printed"), [(0, 265.6), (1, 222.6), (2, 226.7), (3, 227.3)])
def test_a_held_pose_returns_what_it_does_in_the_articles_mujoco(seed: int, printed: float) -> None:
    """The numbers are those of MuJoCo 2.3.6 and Gymnasium 0.28.1's Ant-v4, with the same starts.

    Command 3 of the article pushes all four feet down: the robot rises and stands still.
    """
    env = RobotEnv(World(robot.build(article.ROBOT), article.ENV))
    env.reset(seed=seed)
    torques = 0.5 * np.array(article.ENV.commands[3])
    total = sum(env.step(torques)[1] for _ in range(1000))
    assert total == pytest.approx(printed, abs=0.1)
    assert env.envs.qpos[0, 2] == pytest.approx(0.622043, abs=1e-6)  # [m]


@pytest.mark.parametrize("damping", [0.0, 2.5])
def test_damping_brakes_the_hinges_alone(damping: float) -> None:
    model = edited(damping=damping)
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[:] = 5.0, 2.0
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.qfrc_damper, np.repeat([0.0, -2.0 * damping], [6, 8]))


@pytest.mark.parametrize("friction", [0.1, 3.0])
def test_friction_is_that_of_the_contacts(friction: float) -> None:
    model = edited(friction=[friction, 0.2, 0.1])
    data = mujoco.MjData(model)
    data.qpos[2] = 0.05  # torso and feet in the floor
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    np.testing.assert_array_equal(data.contact.friction[:, :2], friction)
    np.testing.assert_array_equal(data.contact.friction[:, 2:], [[0.2, 0.1, 0.1]] * data.ncon)


def test_without_edits_the_dynamics_are_the_sources_to_the_last_bit(source: mujoco.MjModel) -> None:
    same = edited()
    states = []
    for model in (source, same):
        data = mujoco.MjData(model)
        torques = np.random.default_rng(0).uniform(-1, 1, (40, 8))
        for ctrl in torques:
            data.ctrl[:] = ctrl
            mujoco.mj_step(model, data, nstep=5)
        states.append(np.concatenate([data.qpos, data.qvel]))
    np.testing.assert_array_equal(states[1], states[0])


def test_no_digit_is_lost_in_the_text() -> None:
    third = 1 / 3
    model = edited(density=third, gear=third)
    assert gears(model)["hip_1"] == third
    assert model.body("torso").mass[0] == pytest.approx(third * 4 / 3 * np.pi * 0.25**3, rel=1e-14)


def test_the_same_edits_give_the_same_text(robot_xml: str, known_params: Params) -> None:
    assert robot.build(known_params.robot) == robot_xml
    assert robot.load(robot_xml).opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert robot.load(robot_xml).opt.timestep == 0.01


def test_summary_agrees_with_the_compiled_models(
    source: mujoco.MjModel, robot_xml: str, known_params: Params
) -> None:
    after = robot.load(robot_xml)
    summary = robot.summarize(known_params.robot, robot_xml)
    for told, model in ((summary["before"], source), (summary["after"], after)):
        mass = model.body_subtreemass[0]
        assert told["mass"] == pytest.approx(mass)
        assert sum(told["body_mass"].values()) == pytest.approx(mass)
        assert len(told["body_mass"]) == model.nbody - 1
        assert list(told["peak_torque"]) == MOTORS
        assert list(told["peak_torque"].values()) == list(model.actuator_gear[:, 0])
        weight = 9.81 * mass
        assert told["peak_torque_over_weight"] == pytest.approx(
            model.actuator_gear[:, 0].sum() / weight
        )
    assert summary["before"]["peak_torque"]["hip_1"] == 150
    assert (
        summary["source"]["sha256"]
        == hashlib.sha256(robot.source_path("ant").read_bytes()).hexdigest()
    )
    assert summary["versions"]["mujoco"] == mujoco.__version__


@pytest.mark.parametrize("name", ["knee", "hip_5", "floor"])
def test_unknown_joints_are_answered_with_those_there_are(name: str) -> None:
    with pytest.raises(InputError) as caught:
        edited(joint_gear={name: 1.0})
    assert str(caught.value) == (
        f"robot.joint_gear.{name}: unknown joint; allowed: hip, ankle, ankle_1, ankle_2, ankle_3, "
        "ankle_4, hip_1, hip_2, hip_3, hip_4"
    )


@pytest.mark.parametrize("changes", [{"density": 1e-300}, {"leg_length": 1e-300}])
def test_edits_that_do_not_compile_are_refused(changes: dict[str, float]) -> None:
    with pytest.raises(InputError, match="robot: these edits do not compile: "):
        edited(**changes)


@pytest.mark.parametrize(
    ("xml", "said"),
    [
        ("", "robot XML: not valid MJCF: "),
        ("<mujoco><worldbody>", "robot XML: not valid MJCF: "),
    ],
)
def test_other_robots_are_refused(xml: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        robot.load(xml)


def test_diverged_states_are_not_reset_behind_ones_back(robot_xml: str) -> None:
    model = robot.load(robot_xml)
    data = mujoco.MjData(model)
    data.qvel[8] = np.nan
    mujoco.mj_step(model, data)
    assert np.isnan(data.qvel).any()


def test_read_wants_the_robot_built(tmp_path: Any, robot_xml: str) -> None:
    with pytest.raises(InputError, match=r"edited.xml: No such file .*; `dvc repro build`"):
        robot.read(tmp_path)
    write_text(tmp_path / "assets" / "edited.xml", robot_xml)
    assert robot.read(tmp_path) == robot_xml


def test_leaving_out_constraint_islands_changes_no_bit(robot_xml: str) -> None:
    model = robot.load(robot_xml)
    states = []
    without = model.opt.disableflags
    for flags in (without, without - int(mujoco.mjtDisableBit.mjDSBL_ISLAND)):
        model.opt.disableflags = flags
        data, generator = mujoco.MjData(model), np.random.default_rng(0)
        for _ in range(300):
            data.ctrl[:] = generator.uniform(-1, 1, model.nu)
            mujoco.mj_step(model, data, nstep=5)
        states.append(np.concatenate([data.qpos, data.qvel]))
    assert np.array_equal(*states)


def test_edits_set_attributes_by_element_and_name() -> None:
    edits: Any = {
        "joint": {"ankle_[12]": {"range": [20.0, 60.0], "limited": True}},
        "option": {"*": {"timestep": 0.005}},
        "geom": {"floor": {"condim": 4}},
    }
    model, plain = edited(edits=edits), edited()
    for name in ("ankle_1", "ankle_2"):
        np.testing.assert_allclose(np.degrees(model.joint(name).range), [20, 60])
    np.testing.assert_array_equal(model.joint("ankle_3").range, plain.joint("ankle_3").range)
    assert model.opt.timestep == 0.005
    assert (model.geom("floor").condim[0], model.geom("torso_geom").condim[0]) == (4, 3)


@pytest.mark.parametrize(
    ("edits", "said"),
    [
        ({"wheel": {"*": {"size": 1}}}, r"robot.edits.wheel: no such element; allowed: .*geom.*"),
        (
            {"joint": {"knee*": {"damping": 1}}},
            r"robot.edits.joint.knee\*: matches no name; allowed: root, hip_1, .*",
        ),
        (
            {"joint": {"hip*": {"colour": "red"}}},
            r"robot.edits.joint.hip\*: not valid MJCF: .*unrecognized attribute: 'colour'",
        ),
        ({"geom": {"floor": {"size": "big"}}}, r"robot.edits.geom.floor: not valid MJCF: "),
        ({"geom": {"*": {"density": -1}}}, r"robot.edits.geom.\*: does not compile: "),
    ],
)
def test_edits_that_meet_nothing_are_refused(edits: Any, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        edited(edits=edits)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("edits", "said"),
    [
        (
            {"texture": {"*": {"fileright": "/tmp/pipe.png"}}},
            "given <texture fileright='/tmp/pipe.png'>",
        ),
        ({"texture": {"*": {"width": 10**9}}}, "allowed: whole numbers up to 8,192"),
        ({"option": {"*": {"iterations": 10**9}}}, "allowed: whole numbers up to 200"),
        ({"option": {"*": {"iterations": 16**9999}}}, "Exceeds the limit"),
        (
            {"geom": {"*": {'a=""/><include file="/etc/passwd"/><geom b': 1}}},
            "an include of '/etc/",
        ),
        ({"geom": {"*": {"name": "a\nb"}}}, r"name='a\\nb'>, allowed: text of one line"),
        ({"geom": {"*": {"name": "\0"}}}, "not valid MJCF: not well-formed"),
        ({"geom": {"*": {"name": "\ud800"}}}, "not valid MJCF: 'utf-8' codec can't"),
    ],
)
def test_edits_pass_the_same_check_as_files(edits: Any, said: str) -> None:
    with pytest.raises(InputError, match=rf"^robot.edits.\w+.\*: .*{said}") as caught:
        edited(edits=edits)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"option": {"*": {"gravity": "0 0 0"}}}, "given a weight of 0 N"),
        ({"motor": {"hip_1": {"gear": "inf"}}}, "given a weight of .* N and peak torques of inf N"),
    ],
)
def test_robots_without_a_finite_weight_and_torque_are_refused(changes: Any, said: str) -> None:
    params = UNEDITED.model_copy(update={"edits": changes})
    with pytest.raises(InputError, match=f"^robot: {said}"):
        robot.summarize(params, robot.build(params))
