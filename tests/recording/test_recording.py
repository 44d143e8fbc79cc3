"""Rerun recordings: every shape and series is there, with the right values, at the right times."""

import dataclasses
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import rerun as rr
from numpy.typing import NDArray
from recorded import CURVES, FPS, Content, film, rerun_cli, story
from rerun.chunk import RrdReader
from small_episode import simulate

from jumping_ant.base.errors import InputError
from jumping_ant.experiment.models import Params
from jumping_ant.recording import about
from jumping_ant.recording import episode as recording
from jumping_ant.recording.curves import ticks
from jumping_ant.recording.parts import body_names, geom_paths
from jumping_ant.recording.scene import METRES_PER_NEWTON
from jumping_ant.recording.states import derive
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

STEPS = 40
ROWS = STEPS * 5 + 1
LEGS = ["front_left_leg", "front_right_leg", "back_leg", "right_back_leg"]
FILM = film(FPS + 1)  # of the first second


def record(world: World, trajectory: Trajectory) -> bytes:
    return recording.record(world, trajectory, story(), FILM)


@pytest.fixture(scope="module")
def world(robot_xml: str, known_params: Params) -> World:
    return World(robot_xml, known_params.env)


@pytest.fixture(scope="module")
def model(world: World) -> mujoco.MjModel:
    return world.model


@pytest.fixture(scope="module")
def episode(model: mujoco.MjModel) -> Trajectory:
    """A fall from 1.5 m with random torques, for 2 s."""
    ctrl = np.random.default_rng(1).uniform(-1, 1, (STEPS, model.nu))
    return simulate(model, ctrl, height=1.5)


@pytest.fixture(scope="module")
def file(world: World, episode: Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "episode.rrd"
    path.write_bytes(record(world, episode))
    return path


@pytest.fixture(scope="module")
def content(file: Path) -> Content:
    return Content(file)


def rotate(quaternion: NDArray[np.float64], vector: list[float]) -> NDArray[np.float64]:
    """Rotate a vector by a quaternion (x, y, z, w)."""
    result = np.empty(3)
    mujoco.mju_rotVecQuat(result, np.array(vector), np.roll(quaternion, 1).astype(np.float64))
    return result


def test_the_recording_is_named_after_agent_seed_and_episode(file: Path) -> None:
    reader = RrdReader(file)
    (entry,) = reader.recordings()
    assert entry.application_id == "jumping-ant"
    assert entry.recording_id == "sac-seed-4-episode-11"
    assert len(reader.blueprints()) == 1


def test_every_body_and_every_geom_is_there(content: Content) -> None:
    shapes = {path for path in content.still if path.startswith("/world/")}
    bodies = {path for path in content.moving if path.startswith("/world/")}
    segments = [f"{leg}/aux_{number}_geom" for number, leg in enumerate(LEGS, start=1)]
    thighs = ["left_leg_geom", "right_leg_geom", "back_leg_geom", "rightback_leg_geom"]
    shins = ["left_ankle_geom", "right_ankle_geom", "third_ankle_geom", "fourth_ankle_geom"]
    segments += [f"aux_{number}/{name}" for number, name in enumerate(thighs, start=1)]
    segments += [f"aux_{number}_foot/{name}" for number, name in enumerate(shins, start=1)]
    shapes -= {"/world/torso/camera"}
    assert shapes == {"/world/floor", "/world/torso/torso_geom"} | {
        f"/world/{segment}" for segment in segments
    }
    assert bodies == {path.rpartition("/")[0] for path in shapes} - {"/world"}


def test_shapes_are_those_of_the_robot(world: World, content: Content) -> None:
    model, paths = world.model, geom_paths(world)
    for index in range(model.ngeom):
        shape = content.shape(f"/{paths[index]}")
        geom = model.geom(index)
        if geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE:
            assert shape["radii"] == pytest.approx(geom.size[0])
            assert shape["lengths"] == pytest.approx(2 * geom.size[1])
            half = rotate(shape["quaternions"], [0.0, 0.0, geom.size[1]])
            np.testing.assert_allclose(shape["translations"] + half, geom.pos, atol=1e-6)
            np.testing.assert_allclose(np.roll(shape["quaternions"], 1), geom.quat, atol=1e-6)
        elif geom.type == mujoco.mjtGeom.mjGEOM_SPHERE:
            np.testing.assert_allclose(shape["half_sizes"], [geom.size[0]] * 3)
            np.testing.assert_allclose(shape["centers"], geom.pos)
        else:
            assert geom.name == "floor"
            np.testing.assert_allclose(shape["half_sizes"][:2], geom.size[:2])
            assert -0.02 < shape["centers"][2] + shape["half_sizes"][2] < 0


def test_bodies_move_as_in_the_simulation(
    world: World, episode: Trajectory, content: Content
) -> None:
    model, names = world.model, body_names(world)
    data = mujoco.MjData(model)
    for row in (0, 77, ROWS - 1):
        data.qpos[:] = episode.qpos[row]
        mujoco.mj_kinematics(model, data)
        for body in range(1, model.nbody):
            path = f"/world/{names[body]}"
            place = content.column(path, "Transform3D:translation")
            turn = content.column(path, "Transform3D:quaternion")
            assert len(place) == len(turn) == ROWS
            np.testing.assert_allclose(place[row], data.xpos[body], atol=1e-5)
            np.testing.assert_allclose(np.roll(turn[row], 1), data.xquat[body], atol=1e-5)


def test_states_are_recorded_at_every_simulation_step(
    episode: Trajectory, content: Content
) -> None:
    np.testing.assert_array_equal(content.scalars("/height/torso"), episode.qpos[:, 2])
    milliseconds = 10 * np.arange(ROWS)
    np.testing.assert_array_equal(content.times("/height/torso"), milliseconds * 1_000_000)
    assert content.steps("/height/torso")[:7] == [0, 0, 0, 0, 0, 1, 1]
    assert content.steps("/height/torso")[-1] == STEPS - 1
    strips = content.column("/trail", "LineStrips3D:strips")
    assert strips.shape == (ROWS - 1, 2, 3)
    np.testing.assert_allclose(strips[:, 1], episode.qpos[1:, :3], atol=1e-5)


def test_torques_and_rewards_are_recorded_in_every_control_step(
    known_params: Params, episode: Trajectory, content: Content
) -> None:
    names = ["hip_4", "ankle_4", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3"]
    gear = known_params.robot.gear
    assert {path for path in content.moving if path.startswith("/torque/")} == {
        f"/torque/{name}" for name in names
    }
    for motor, name in enumerate(names):
        torques = content.scalars(f"/torque/{name}")
        np.testing.assert_allclose(torques, gear * episode.torques[:, motor])
    starts = content.times("/torque/hip_1")
    np.testing.assert_array_equal(starts, 50_000_000 * np.arange(STEPS))
    np.testing.assert_array_equal(content.scalars("/reward/torso_height"), episode.rewards)
    np.testing.assert_array_equal(content.times("/reward/torso_height"), starts + 50_000_000)
    assert (
        content.steps("/reward/torso_height")
        == content.steps("/torque/hip_1")
        == list(range(STEPS))
    )


def test_every_series_has_a_name_and_a_colour(content: Content) -> None:
    scene = ("world", "trail", "contact_arrow", "film")
    series = {path for path in content.moving if path.split("/")[1] not in scene}
    assert len(series) == 1 + 1 + 8 + 5 + 1 + 1
    for path in series - {"/phase"}:
        assert {"names", "colors"} <= set(content.shape(path))


def test_phases_alternate_with_the_contacts(content: Content) -> None:
    contacts = content.scalars("/contacts")
    phases = content.column("/phase", "StateChange:state")
    times = content.times("/phase")
    assert phases[0] == "airborne"
    assert (phases[1:] != phases[:-1]).all()
    landing = int(np.flatnonzero(contacts)[0])
    assert times[:2].tolist() == [0, landing * 10_000_000]
    fall = np.sqrt(2 * (1.5 - 0.33) / 9.81)  # [s] to the height at which the shins' tips touch
    assert 0.2 < landing / 100 < fall + 0.1


def test_contact_forces_carry_the_robot_at_rest(
    world: World, model: mujoco.MjModel, tmp_path: Path
) -> None:
    resting = simulate(model, np.zeros((120, model.nu)), height=0.75)
    path = tmp_path / "rest.rrd"
    path.write_bytes(record(world, resting))
    content = Content(path)
    forces = [content.scalars(f"/contact_force/{name}") for name in ["torso", *LEGS]]
    assert {path for path in content.moving if path.startswith("/contact_force/")} == {
        f"/contact_force/{name}" for name in ["torso", *LEGS]
    }
    weight = 9.81 * model.body_subtreemass[0]
    assert sum(forces)[-50:].mean() == pytest.approx(weight, rel=0.05)
    # The shins meet the floor at about right angles and share the weight evenly.
    for force in forces[1:]:
        assert force[-50:].mean() == pytest.approx(weight / 4, rel=0.2)


def arrows(content: Content, limb: str) -> tuple[list[Any], list[Any]]:
    """Forces [N] and where they act [m], in each state: one or none."""
    path = f"/contact_arrow/{limb}"
    vectors = content.lists(path, "Arrows3D:vectors")
    forces = [[np.array(vector) / METRES_PER_NEWTON for vector in row] for row in vectors]
    return forces, content.lists(path, "Arrows3D:origins")


def test_arrows_are_the_contact_forces(content: Content) -> None:
    contacts, num_arrows = content.scalars("/contacts"), np.zeros(ROWS, dtype=int)
    for limb in ["torso", *LEGS]:
        forces, origins = arrows(content, limb)
        normal_forces = content.scalars(f"/contact_force/{limb}")
        assert len(forces) == len(origins) == ROWS
        for force, origin, normal_force in zip(forces, origins, normal_forces, strict=True):
            assert len(force) == len(origin) <= 1
            assert force or normal_force == 0
            if force and abs(origin[0][2]) < 0.02:  # on the floor, whose normal points up
                assert force[0][2] == pytest.approx(normal_force, rel=1e-4, abs=1e-4)
        num_arrows += [len(force) for force in forces]
    assert (num_arrows[contacts == 0] == 0).all(), "no arrow while it flies"
    assert (num_arrows[contacts > 0] > 0).all()
    assert 0 < num_arrows.astype(bool).mean() < 1


def test_forces_within_the_robot_cancel(world: World, model: mujoco.MjModel) -> None:
    """At rest all arrows together carry the weight, whatever the limbs do to each other."""
    resting = simulate(model, np.zeros((120, model.nu)), height=0.75)
    states = derive(world, resting, resting.rows())
    weight = 9.81 * model.body_subtreemass[0]
    total = states.contact_forces[-50:].sum(axis=1).mean(axis=0)
    np.testing.assert_allclose(total, [0.0, 0.0, weight], atol=0.05 * weight)
    assert np.abs(states.contact_points[-50:, 1:, 2]).max() < 0.02


def test_frames_of_the_film_stand_at_their_times(content: Content) -> None:
    (frames,), (clear,) = (
        [chunk.to_record_batch() for chunk in content.moving[path]]
        for path in ("/film/frames", "/film")
    )
    times = frames.column("sim_time").cast("int64").to_pylist()
    assert times == [number * 1_000_000_000 // FPS for number in range(FPS + 1)]
    references = frames.column("VideoFrameReference:timestamp").to_pylist()
    assert [reference[0] for reference in references] == times
    assert clear.column("Clear:is_recursive").to_pylist() == [[True]]
    cleared = clear.column("sim_time").cast("int64")
    assert cleared.to_pylist() == [times[-1] + 1_000_000_000 // FPS]
    (video,) = content.still["/film/frames"]
    assert bytes(video.to_record_batch().column("AssetVideo:blob").to_pylist()[0][0]) == FILM


def test_what_is_no_film_is_refused(world: World, episode: Trajectory) -> None:
    with pytest.raises(InputError, match="film: given 9 bytes that are not MP4"):
        recording.record(world, episode, story(), b"not a film"[:9])


def test_learning_curves_hold_the_evaluations(content: Content) -> None:
    for seed, (steps, returns) in CURVES.items():
        curve = content.shape(f"/learning/curves/seed-{seed}")
        np.testing.assert_allclose(curve["strips"], np.column_stack([steps, returns]))
        marks = content.shape(f"/learning/curves/seed-{seed}/marks")
        np.testing.assert_allclose(marks["positions"], [steps[0], returns[0]])  # the first one
    scale = content.shape("/learning/curves")["scale"]
    assert scale[0] * 400 == pytest.approx(16) and scale[1] * 1234.5 == pytest.approx(-5)


@pytest.mark.parametrize(
    ("high", "expected"),
    [
        (12000, [0, 5000, 10000]),
        (7.0, [0, 2, 4, 6]),
        (1.0, [0, 0.5, 1.0]),
        (400, [0, 100, 200, 300, 400]),
    ],
)
def test_ticks_are_round(high: float, expected: list[float]) -> None:
    np.testing.assert_allclose(ticks(high), expected)


def test_the_page_tells_the_episode(content: Content) -> None:
    (chunk,) = content.still["/about"]
    batch = chunk.to_record_batch()
    assert batch.column("TextDocument:media_type").to_pylist() == [["text/markdown"]]
    text = batch.column("TextDocument:text").to_pylist()[0][0]
    assert "SAC, seed 4, episode 11" in text
    assert "| 1,234 | 2.50 m | 12 | 1.2 of 2.0 s |" in text
    assert "1 m for 100 N" in text
    assert "front left leg coral" in text


@pytest.mark.parametrize(
    ("algorithm", "kind", "told"),
    [
        ("sac", "edited", "of `mine`: SAC.\n"),
        ("random", "edited", "of `mine`: a baseline that acts at random.\n"),
        ("open_loop", "unedited", "ignores observations. Its robot is unedited."),
    ],
)
def test_the_page_names_baselines_and_the_unedited_robot(
    algorithm: str, kind: str, told: str, world: World, episode: Trajectory
) -> None:
    about_it = story("mine", algorithm, robot=kind)
    assert told in about.episode_page(world, episode, about_it, about.Opening(0.5, 1.0))


def test_it_plays_the_highest_jump_of_the_film(file: Path, episode: Trajectory) -> None:
    (blueprint,) = RrdReader(file).blueprints()
    panels = [
        chunk.to_record_batch()
        for chunk in RrdReader(file).stream(store=blueprint)
        if chunk.entity_path == "/time_panel"
    ]
    columns = {
        name: panel.column(name).to_pylist() for panel in panels for name in panel.schema.names
    }
    (selection,) = columns["TimePanelBlueprint:time_selection"][0]
    assert columns["TimePanelBlueprint:loop_mode"][0] == [2]  # the selection
    peak = int(np.argmax(episode.qpos[: 100 + 1, 2])) * 10_000_000
    assert selection["min"] <= peak <= selection["max"]
    assert selection["max"] <= 1_000_000_000


def test_an_episode_that_broke_off_is_recorded_up_to_there(
    world: World, episode: Trajectory, tmp_path: Path
) -> None:
    qpos = episode.qpos.copy()
    qpos[13:] = np.nan
    path = tmp_path / "broken.rrd"
    path.write_bytes(record(world, dataclasses.replace(episode, qpos=qpos)))
    content = Content(path)
    assert len(content.scalars("/height/torso")) == 13
    assert len(content.scalars("/torque/hip_1")) == 3  # the third began
    assert len(content.scalars("/reward/torso_height")) == 2  # but did not end


def test_rerun_verifies_the_file(file: Path, tmp_path: Path) -> None:
    process = rerun_cli("verify", file, home=tmp_path)
    assert process.returncode == 0, process.stderr
    assert "1 file verified without error" in process.stdout + process.stderr


def test_equal_recordings_have_equal_bytes(world: World, episode: Trajectory, file: Path) -> None:
    assert record(world, episode) == file.read_bytes()
    rewards = episode.rewards.copy()
    rewards[5] += 0.01
    changed = dataclasses.replace(episode, terms={"torso_height": rewards})
    assert record(world, changed) != file.read_bytes()


def test_recording_leaves_rerun_as_it_was(world: World, episode: Trajectory) -> None:
    assert rr.strict_mode() is False
    record(world, episode)
    assert rr.strict_mode() is False
    assert rr.get_recording_id() is None


def test_shapes_that_are_not_drawn_are_refused(world: World, episode: Trajectory) -> None:
    boxed = world.xml.replace(
        '<geom name="torso_geom" size="0.25"/>',
        '<geom name="torso_geom" type="box" size="0.25 0.25 0.25"/>',
    )
    with pytest.raises(InputError, match="'torso_geom' is a mjGEOM_BOX; allowed: planes"):
        record(dataclasses.replace(world, xml=boxed), episode)
