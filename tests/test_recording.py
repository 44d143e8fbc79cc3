"""Rerun recordings: every shape and series is there, with the right values, at the right times."""

import dataclasses
import os
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader
from small_episode import simulate

from jumping_ant import params, recording, robot
from jumping_ant.errors import InputError
from jumping_ant.trajectory import Trajectory

STEPS = 40
ROWS = STEPS * 5 + 1
LEGS = ["front_left_leg", "front_right_leg", "back_leg", "right_back_leg"]


@pytest.fixture(scope="module")
def model(robot_xml: str) -> mujoco.MjModel:
    return robot.load(robot_xml)


@pytest.fixture(scope="module")
def episode(model: mujoco.MjModel) -> Trajectory:
    """A fall from 1.5 m with random torques, for 2 s."""
    ctrl = np.random.default_rng(1).uniform(-1, 1, (STEPS, model.nu))
    return simulate(model, ctrl, height=1.5)


@pytest.fixture(scope="module")
def file(robot_xml: str, episode: Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "episode.rrd"
    path.write_bytes(recording.record(robot_xml, episode, "sac"))
    return path


class Content:
    """The chunks of a recording, by entity."""

    def __init__(self, path: Path) -> None:
        self.moving: dict[str, list[Chunk]] = defaultdict(list)
        self.still: dict[str, list[Chunk]] = defaultdict(list)
        for chunk in RrdReader(path).stream():
            (self.still if chunk.is_static else self.moving)[chunk.entity_path].append(chunk)

    def column(self, entity: str, component: str) -> NDArray[Any]:
        """The values of a component over time, one a row."""
        (chunk,) = self.moving[entity]
        values = chunk.to_record_batch().column(component).to_pylist()
        assert all(len(value) == 1 for value in values)
        return np.array([value[0] for value in values])

    def scalars(self, entity: str) -> NDArray[Any]:
        return self.column(entity, "Scalars:scalars")

    def times(self, entity: str) -> NDArray[np.int64]:
        """Times in nanoseconds."""
        (chunk,) = self.moving[entity]
        column = chunk.to_record_batch().column("sim_time")
        return np.array(column.cast("int64").to_pylist())

    def steps(self, entity: str) -> list[int]:
        (chunk,) = self.moving[entity]
        return chunk.to_record_batch().column("control_step").to_pylist()

    def shape(self, entity: str) -> dict[str, NDArray[np.float64]]:
        """The components of a static entity."""
        values: dict[str, NDArray[np.float64]] = {}
        for chunk in self.still[entity]:
            batch = chunk.to_record_batch()
            for name in batch.schema.names[1:]:
                values[name.split(":")[1]] = np.array(batch.column(name).to_pylist()[0][0])
        return values


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
    assert shapes == {"/world/floor", "/world/torso/torso_geom"} | {
        f"/world/{segment}" for segment in segments
    }
    assert bodies == {path.rpartition("/")[0] for path in shapes} - {"/world"}


def test_shapes_are_those_of_the_robot(model: mujoco.MjModel, content: Content) -> None:
    paths = recording.geom_paths(model)
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
    model: mujoco.MjModel, episode: Trajectory, content: Content
) -> None:
    data = mujoco.MjData(model)
    names = recording.body_names(model)
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
    model: mujoco.MjModel, episode: Trajectory, content: Content
) -> None:
    names = ["hip_4", "ankle_4", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3"]
    gear = params.load().robot.gear
    assert {path for path in content.moving if path.startswith("/torque/")} == {
        f"/torque/{name}" for name in names
    }
    for motor, name in enumerate(names):
        torques = content.scalars(f"/torque/{name}")
        np.testing.assert_allclose(torques, gear * episode.ctrl[:, motor])
    starts = content.times("/torque/hip_1")
    np.testing.assert_array_equal(starts, 50_000_000 * np.arange(STEPS))
    np.testing.assert_array_equal(content.scalars("/reward/height"), episode.reward_height)
    np.testing.assert_array_equal(content.times("/reward/height"), starts + 50_000_000)
    assert content.steps("/reward/height") == content.steps("/torque/hip_1") == list(range(STEPS))


def test_every_series_has_a_name_and_a_colour(content: Content) -> None:
    series = {path for path in content.moving if path.split("/")[1] not in ("world", "trail")}
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
    robot_xml: str, model: mujoco.MjModel, tmp_path: Path
) -> None:
    resting = simulate(model, np.zeros((120, model.nu)), height=0.75)
    path = tmp_path / "rest.rrd"
    path.write_bytes(recording.record(robot_xml, resting, "random"))
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


def test_an_episode_that_broke_off_is_recorded_up_to_there(
    robot_xml: str, episode: Trajectory, tmp_path: Path
) -> None:
    qpos = episode.qpos.copy()
    qpos[13:] = np.nan
    path = tmp_path / "broken.rrd"
    path.write_bytes(recording.record(robot_xml, dataclasses.replace(episode, qpos=qpos), "sac"))
    content = Content(path)
    assert len(content.scalars("/height/torso")) == 13
    assert len(content.scalars("/torque/hip_1")) == 3  # the third began
    assert len(content.scalars("/reward/height")) == 2  # but did not end


def rerun_cli(*arguments: str | Path, home: Path) -> subprocess.CompletedProcess[str]:
    # Not `python -m rerun_cli`, which exits with 0 whatever it finds.
    return subprocess.run(
        [Path(sys.executable).with_name("rerun"), "rrd", *arguments],
        env=os.environ | {"CI": "true", "HOME": str(home)},  # no usage statistics
        capture_output=True,
        text=True,
        timeout=120,
    )


def everything(path: Path) -> list[tuple[str, dict[str, list[Any]]]]:
    """All that a recording holds, to the bit, but for the row numbers that Rerun draws."""
    chunks = [
        (chunk.entity_path, chunk.to_record_batch().drop_columns(["rerun.controls.RowId"]))
        for chunk in RrdReader(path).stream()
    ]
    return [(entity, batch.to_pydict()) for entity, batch in chunks]


def test_rerun_verifies_the_file(file: Path, tmp_path: Path) -> None:
    process = rerun_cli("verify", file, home=tmp_path)
    assert process.returncode == 0, process.stderr
    assert "1 file verified without error" in process.stdout + process.stderr


def test_two_recordings_hold_the_same_data(
    robot_xml: str, episode: Trajectory, file: Path, tmp_path: Path
) -> None:
    again, other = tmp_path / "again.rrd", tmp_path / "other.rrd"
    again.write_bytes(recording.record(robot_xml, episode, "sac"))
    assert rerun_cli("compare", file, again, home=tmp_path).returncode == 0
    assert everything(file) == everything(again)
    rewards = episode.reward_height.copy()
    rewards[5] += 0.01
    changed = dataclasses.replace(episode, reward_height=rewards)
    other.write_bytes(recording.record(robot_xml, changed, "sac"))
    assert rerun_cli("compare", file, other, home=tmp_path).returncode == 1
    assert everything(file) != everything(other)


def test_recording_leaves_rerun_as_it_was(robot_xml: str, episode: Trajectory) -> None:
    assert rr.strict_mode() is False
    recording.record(robot_xml, episode, "sac")
    assert rr.strict_mode() is False
    assert rr.get_recording_id() is None


def test_shapes_that_are_not_drawn_are_refused(robot_xml: str, episode: Trajectory) -> None:
    boxed = robot_xml.replace(
        '<geom name="torso_geom" size="0.25"/>',
        '<geom name="torso_geom" type="box" size="0.25 0.25 0.25"/>',
    )
    with pytest.raises(InputError, match="'torso_geom' is a mjGEOM_BOX; allowed: planes"):
        recording.record(boxed, episode, "sac")
