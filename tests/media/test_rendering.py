"""Videos: what the pictures show, how the camera moves, and what the files hold."""

import dataclasses
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
import pytest
from numpy.typing import NDArray
from recorded import simulate
from small_disk import small_disk

from jumping_ant.base.errors import InputError
from jumping_ant.media import rendering
from jumping_ant.params import params_file
from jumping_ant.params.blocks import RecordParams
from jumping_ant.sim import robot
from jumping_ant.sim.trajectory import Trajectory, frame_stride

STEPS = 12


@pytest.fixture(scope="module")
def episode(robot_xml: str) -> Trajectory:
    """The robot thrown up at 3 m/s, its motors commanded at random, for 0.6 s."""
    model = robot.load(robot_xml)
    ctrl = np.random.default_rng(0).uniform(-1, 1, (STEPS, model.nu))
    return simulate(model, ctrl, upward_speed=3.0)


def settings(**changes: Any) -> RecordParams:
    small = {"width": 128, "height": 96, "fps": 50, "seconds": 20.0}
    return params_file.load().record.model_copy(update=small | changes)


def draw(robot_xml: str, episode: Trajectory, **changes: Any) -> NDArray[np.uint8]:
    return np.array(list(rendering.frames(robot_xml, episode, settings(**changes))))


def robot_pixels(pictures: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Tell the warm robot from the cold floor and sky."""
    return pictures[..., 0].astype(int) > pictures[..., 2].astype(int) + 20


def moved(episode: Trajectory, offset: list[float]) -> Trajectory:
    qpos = episode.qpos.copy()
    qpos[:, :3] += offset
    return dataclasses.replace(episode, qpos=qpos)


def test_every_frame_shows_the_robot_in_the_middle(robot_xml: str, episode: Trajectory) -> None:
    pictures = draw(robot_xml, episode)
    assert pictures.shape == (STEPS * 5 // 2 + 1, 96, 128, 3)
    for picture in robot_pixels(pictures):
        rows, columns = np.nonzero(picture)
        assert len(rows) > 100
        assert abs(columns.mean() - 64) < 8
        assert 15 < rows.mean() < 80
        assert rows.min() > 0 and rows.max() < 95  # whole
    assert (np.abs(np.diff(pictures.astype(int), axis=0)).max(axis=(1, 2, 3)) > 30).all()


def test_a_jump_shows_against_a_horizon_that_stands_still(
    robot_xml: str, episode: Trajectory
) -> None:
    low, _, high = draw(robot_xml, episode, fps=5)[:3]
    assert episode.qpos[40, 2] > episode.qpos[0, 2] + 0.4
    heights = [np.nonzero(robot_pixels(picture))[0].mean() for picture in (low, high)]
    assert heights[1] < heights[0] - 5
    sky = slice(0, 15)
    np.testing.assert_allclose(low[sky].astype(int), high[sky], atol=3)


def test_the_camera_follows_along_the_ground(robot_xml: str, episode: Trajectory) -> None:
    here = draw(robot_xml, episode, fps=1)[0].astype(int)
    tiles = 2 * rendering.TILE
    there = draw(robot_xml, moved(episode, [30 * tiles, -20 * tiles, 0.0]), fps=1)[0].astype(int)
    assert np.abs(here - there).mean() < 1.0  # the same tiles below the same robot


def test_seconds_cut_long_episodes_only(robot_xml: str, episode: Trajectory) -> None:
    assert len(draw(robot_xml, episode, seconds=0.1, fps=100)) == 11
    assert len(draw(robot_xml, episode, seconds=99.0, fps=10)) == 7


@pytest.mark.parametrize("fps", [30, 200])
def test_frame_rates_that_do_not_divide_are_refused(fps: int) -> None:
    assert frame_stride(0.01, 20) == 5
    with pytest.raises(InputError, match=f"record.fps: given {fps}, allowed: .* 25, 50, 100"):
        frame_stride(0.01, fps)


def test_scene_leaves_the_robot_as_it_is(robot_xml: str) -> None:
    before, after = robot.load(robot_xml), rendering.scene(robot_xml, 1024)
    for name in ("body_mass", "geom_pos", "jnt_range", "actuator_gear", "qpos0"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_a_model_without_a_floor_is_refused() -> None:
    with pytest.raises(InputError, match="given no floor, allowed: a plane in the world"):
        rendering.scene("<mujoco/>", 0)


def test_a_film_plays_and_is_the_same_however_it_is_drawn(
    robot_xml: str, episode: Trajectory, tmp_path: Path
) -> None:
    content = rendering.film(robot_xml, episode, settings())
    assert content == rendering.film(robot_xml, episode, settings(), processes=2)
    assert content.find(b"moov") < content.find(b"mdat")  # a browser can start at once
    path = tmp_path / "film.mp4"
    path.write_bytes(content)
    reader: Any = imageio.get_reader(path)
    with reader:
        facts = reader.get_meta_data()
        pictures = np.array(list(iter(reader)))
    assert facts["fps"] == 50
    assert facts["codec"] == "h264"
    assert facts["pix_fmt"].startswith("yuv420p")
    drawn = draw(robot_xml, episode)
    assert pictures.shape == drawn.shape
    assert np.abs(pictures.astype(int) - drawn).mean() < 5  # the colours survive
    assert pictures.std(axis=(1, 2, 3)).min() > 10
    assert (pictures[1:] != pictures[:-1]).any(axis=(1, 2, 3)).all()


def test_a_film_that_is_cut_short_is_none() -> None:
    """As the encoder, a process of its own, leaves it on a full disk."""
    noise = np.random.default_rng(0).integers(256, size=(40, 96, 128, 3), dtype=np.uint8)
    whole = rendering.encode(noise, 50)
    with small_disk(len(whole) // 2), pytest.raises(OSError, match="is the disk full"):
        rendering.encode(noise, 50)
