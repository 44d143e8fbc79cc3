"""Rerun recordings: every shape and series is there, with the right values, at the right times."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from recorded import Content, simulate, story
from rerun.chunk import RrdReader

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.media import about, rendering
from jumping_ant.media import episode as recording
from jumping_ant.media.scene import METRES_PER_NEWTON, geom_paths
from jumping_ant.media.states import body_names, derive
from jumping_ant.params.model import Params
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

STEPS = 40
ROWS = STEPS * 5 + 1
LEGS = ["front_left_leg", "front_right_leg", "back_leg", "right_back_leg"]
MOTORS = ["hip_4", "ankle_4", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3"]
FPS = 50
SHADES = np.linspace(0, 255, FPS + 1).astype(np.uint8)  # of the film of the first second
FILM = rendering.encode((np.full((64, 64, 3), shade) for shade in SHADES), FPS)


def record(world: World, trajectory: Trajectory, path: Path) -> Content:
    path.write_bytes(recording.record(world, trajectory, story(), FILM).content)
    return Content(path)


@pytest.fixture(scope="module")
def episode(world: World) -> Trajectory:
    """A fall from 1.5 m with random torques, for 2 s."""
    ctrl = np.random.default_rng(1).uniform(-1, 1, (STEPS, world.model.nu))
    return simulate(world.model, ctrl, height=1.5)


@pytest.fixture(scope="module")
def file(world: World, episode: Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "episode.rrd"
    record(world, episode, path)
    return path


@pytest.fixture(scope="module")
def content(file: Path) -> Content:
    return Content(file)


def moving(content: Content, part: str) -> set[str]:
    return {path for path in content.moving if path.startswith(f"/{part}/")}


def test_reruns_own_tool_accepts_it_and_it_names_no_folder(file: Path, tmp_path: Path) -> None:
    rerun = Path(sys.executable).with_name("rerun")
    subprocess.run(
        [rerun, "rrd", "verify", file], env=os.environ | {"HOME": str(tmp_path)}, check=True
    )
    assert str(PROJECT_ROOT).encode() not in file.read_bytes()


def test_shapes_are_those_of_the_robot(world: World, content: Content) -> None:
    assert {"world/floor", "world/aux_1_foot/left_ankle_geom"} < set(geom_paths(world))
    for index, path in enumerate(geom_paths(world)):
        shape, geom = content.shape(f"/{path}"), world.model.geom(index)
        if geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE:
            assert shape["radii"] == pytest.approx(geom.size[0])
            assert shape["lengths"] == pytest.approx(2 * geom.size[1])
            half, turn = np.empty(3), np.roll(shape["quaternions"], 1).astype(np.float64)
            mujoco.mju_rotVecQuat(half, np.array([0.0, 0.0, geom.size[1]]), turn)
            np.testing.assert_allclose(shape["translations"] + half, geom.pos, atol=1e-6)
            np.testing.assert_allclose(turn, geom.quat, atol=1e-6)
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
    data = mujoco.MjData(world.model)
    for row in (0, 77, ROWS - 1):
        data.qpos[:] = episode.qpos[row]
        mujoco.mj_kinematics(world.model, data)
        for body, name in enumerate(body_names(world.model)[1:], start=1):
            place = content.column(f"/world/{name}", "Transform3D:translation")
            turn = content.column(f"/world/{name}", "Transform3D:quaternion")
            assert len(place) == len(turn) == ROWS
            np.testing.assert_allclose(place[row], data.xpos[body], atol=1e-5)
            np.testing.assert_allclose(np.roll(turn[row], 1), data.xquat[body], atol=1e-5)


def test_states_are_recorded_at_every_simulation_step(
    episode: Trajectory, content: Content
) -> None:
    np.testing.assert_array_equal(content.scalars("/height/torso"), episode.qpos[:, 2])
    np.testing.assert_array_equal(content.times("/height/torso"), 10_000_000 * np.arange(ROWS))
    assert content.steps("/height/torso")[:7] == [0, 0, 0, 0, 0, 1, 1]
    assert content.steps("/height/torso")[-1] == STEPS - 1
    strips = content.column("/trail", "LineStrips3D:strips")
    assert strips.shape == (ROWS - 1, 2, 3)
    np.testing.assert_allclose(strips[:, 1], episode.qpos[1:, :3], atol=1e-5)


def test_torques_and_rewards_are_recorded_in_every_control_step(
    known_params: Params, episode: Trajectory, content: Content
) -> None:
    assert moving(content, "torque") == {f"/torque/{name}" for name in MOTORS}
    for motor, name in enumerate(MOTORS):
        torques = known_params.robot.gear * episode.torques[:, motor]
        np.testing.assert_allclose(content.scalars(f"/torque/{name}"), torques)
    np.testing.assert_array_equal(content.scalars("/reward/torso_height"), episode.rewards)
    for path, begin in (("/torque/hip_1", 0), ("/reward/torso_height", 1)):
        times = 50_000_000 * (np.arange(STEPS) + begin)
        np.testing.assert_array_equal(content.times(path), times)
        assert content.steps(path) == list(range(STEPS))


def test_phases_alternate_with_the_contacts(content: Content) -> None:
    phases = content.column("/phase", "StateChange:state")
    assert phases[0] == "airborne"
    assert (phases[1:] != phases[:-1]).all()
    landing = int(np.flatnonzero(content.scalars("/contacts"))[0])
    assert content.times("/phase")[:2].tolist() == [0, landing * 10_000_000]
    fall = np.sqrt(2 * (1.5 - 0.33) / 9.81)  # [s] to the height at which the shins' tips touch
    assert 0.2 < landing / 100 < fall + 0.1


def test_contact_forces_carry_the_robot_at_rest(world: World) -> None:
    """All together, whatever the limbs do to each other."""
    states = derive(world, simulate(world.model, np.zeros((120, world.model.nu)), height=0.75))
    weight = 9.81 * world.model.body_subtreemass[0]
    normal = states.normal_forces[-50:].mean(axis=0)
    assert normal.sum() == pytest.approx(weight, rel=0.05)
    # The shins meet the floor at about right angles and share the weight evenly.
    np.testing.assert_allclose(normal[1:], weight / 4, rtol=0.2)
    total = states.contact_forces[-50:].sum(axis=1).mean(axis=0)
    np.testing.assert_allclose(total, [0.0, 0.0, weight], atol=0.05 * weight)
    assert np.abs(states.contact_points[-50:, 1:, 2]).max() < 0.02


def test_arrows_are_the_contact_forces(content: Content) -> None:
    contacts, num_arrows = content.scalars("/contacts"), np.zeros(ROWS, dtype=int)
    assert moving(content, "contact_force") == {f"/contact_force/{n}" for n in ["torso", *LEGS]}
    for limb in ["torso", *LEGS]:
        vectors = content.lists(f"/contact_arrow/{limb}", "Arrows3D:vectors")
        origins = content.lists(f"/contact_arrow/{limb}", "Arrows3D:origins")
        normal_forces = content.scalars(f"/contact_force/{limb}")
        assert len(vectors) == len(origins) == ROWS
        for vector, origin, normal_force in zip(vectors, origins, normal_forces, strict=True):
            assert len(vector) == len(origin) <= 1
            assert vector or normal_force == 0
            if vector and abs(origin[0][2]) < 0.02:  # on the floor, whose normal points up
                lift = vector[0][2] / METRES_PER_NEWTON
                assert lift == pytest.approx(normal_force, rel=1e-4, abs=1e-4)
        num_arrows += [len(vector) for vector in vectors]
    np.testing.assert_array_equal(num_arrows > 0, contacts > 0)
    assert 0 < num_arrows.astype(bool).mean() < 1


def test_frames_of_the_film_stand_at_their_times(content: Content) -> None:
    times = content.times("/film/frames").tolist()
    assert times == [number * 1_000_000_000 // FPS for number in range(FPS + 1)]
    assert content.column("/film/frames", "VideoFrameReference:timestamp").tolist() == times
    assert content.column("/film", "Clear:is_recursive").tolist() == [True]
    assert content.times("/film").tolist() == [times[-1] + 1_000_000_000 // FPS]
    assert content.shape("/film/frames")["blob"].astype(np.uint8).tobytes() == FILM


def test_the_page_describes_the_episode(
    content: Content, world: World, episode: Trajectory
) -> None:
    text = str(content.shape("/about")["text"])
    assert "SAC, seed 4, episode 11" in text
    assert "| 1,234 | 2.50 m | 12 | 1.2 of 2.0 s |" in text
    assert "1 m for 100 N" in text
    assert "Torso sand, front left leg coral" in text
    blind = story("mine", "open_loop", robot="unedited")
    text = about.episode_page(world, episode, blind, 0, 1)
    assert "ignores observations. Its robot is unedited." in text


def test_it_plays_the_highest_jump_of_the_film(file: Path, episode: Trajectory) -> None:
    reader = RrdReader(file)
    (entry,), (blueprint,) = reader.recordings(), reader.blueprints()
    assert entry.recording_id == "sac-seed-4-episode-11"
    panels: dict[str, list[Any]] = {}
    for chunk in reader.stream(store=blueprint):
        if chunk.entity_path == "/time_panel":
            panels |= chunk.to_record_batch().to_pydict()
    (selection,) = panels["TimePanelBlueprint:time_selection"][0]
    assert panels["TimePanelBlueprint:loop_mode"][0] == [2]  # the selection
    peak = int(np.argmax(episode.qpos[: 100 + 1, 2])) * 10_000_000
    assert selection["min"] <= peak <= selection["max"] <= 1_000_000_000


def test_an_episode_that_broke_off_is_recorded_up_to_there(
    world: World, episode: Trajectory, tmp_path: Path
) -> None:
    qpos: NDArray[np.float64] = episode.qpos.copy()
    qpos[13:] = np.nan
    content = record(world, dataclasses.replace(episode, qpos=qpos), tmp_path / "broken.rrd")
    assert len(content.scalars("/height/torso")) == 13
    assert len(content.scalars("/torque/hip_1")) == 3  # the third began
    assert len(content.scalars("/reward/torso_height")) == 2  # but did not end


def test_shapes_that_are_not_drawn_are_refused(world: World, episode: Trajectory) -> None:
    boxed = world.xml.replace(
        '<geom name="torso_geom" size="0.25"/>',
        '<geom name="torso_geom" type="box" size="0.25 0.25 0.25"/>',
    )
    with pytest.raises(InputError, match="'torso_geom' is a mjGEOM_BOX; allowed: planes"):
        recording.record(dataclasses.replace(world, xml=boxed), episode, story(), FILM)
